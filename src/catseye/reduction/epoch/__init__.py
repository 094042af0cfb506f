"""The main path: a night's shots to ranges, whole cycles, coordinates, surface and pose."""
