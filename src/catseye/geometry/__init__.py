"""Frames of reference, rotations, Kelvin mounts, mirrors, the antenna."""
