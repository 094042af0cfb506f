"""Positions of many targets from ranges to known stations."""
