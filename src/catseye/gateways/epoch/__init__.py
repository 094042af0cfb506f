"""Output of one night: ranges, coordinates, surface and pose as files, figures and text."""
