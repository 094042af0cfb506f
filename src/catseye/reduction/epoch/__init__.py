"""Main pipeline: shots to ranges, whole cycles, coordinates, surface and pose."""
