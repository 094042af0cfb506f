"""Samplers: rings of time-tagged values of ranges, points, pose, beam, surface, health, corrections."""
