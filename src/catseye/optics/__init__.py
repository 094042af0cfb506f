"""Optics: glass, retroreflectors, beams, detectors, laser safety."""
