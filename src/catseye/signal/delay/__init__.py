"""Arrival time of a known sound."""
