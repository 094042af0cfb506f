"""Calibrations from tables of readings; `kinds` lists them."""
