"""Paraboloids, poses, fields over a surface."""
