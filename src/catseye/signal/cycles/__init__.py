"""Whole cycles: coarse lengths, several frequencies."""
