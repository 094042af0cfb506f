"""Steered mirror: pointing, encoders, slews, tracks."""
