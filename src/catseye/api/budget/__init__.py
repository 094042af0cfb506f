"""Uncertainty by input: of one shot, and of coordinates."""
