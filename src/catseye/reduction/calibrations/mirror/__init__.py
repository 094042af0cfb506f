"""A steered mirror: angles, encoders, stops, alignment, focus."""
