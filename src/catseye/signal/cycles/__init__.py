"""Whole cycles from coarse lengths or several modulation frequencies."""
