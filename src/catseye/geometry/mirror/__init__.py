"""A steered mirror: pointing, encoders, slews, tracks."""
