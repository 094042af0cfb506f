"""Steered mirror: angles, encoders, stops, alignment, focus."""
