"""Ranger calibrations: zero, leakage, linearity, oscillator, glass."""
