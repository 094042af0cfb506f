"""One night on the way out: ranges, coordinates, surface and pose as files, figures, words and pages."""
