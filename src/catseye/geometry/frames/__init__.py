"""Axis systems: rotations, frames, local and plumb axes."""
