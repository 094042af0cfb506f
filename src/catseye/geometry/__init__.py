"""Frames of reference, and where the mirrors stand in them: rotations, transforms, the Kelvin mount, the antenna."""
