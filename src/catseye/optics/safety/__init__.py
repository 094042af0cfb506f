"""Laser safety: exposure limits, classes, hazard distances."""
