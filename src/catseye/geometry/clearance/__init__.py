"""Obstructions of beams: boxes, solids, visibility."""
