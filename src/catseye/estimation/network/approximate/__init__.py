"""Approximate coordinates and orientations of a network, as start of its adjustment."""
