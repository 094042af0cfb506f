"""Moist air: index of refraction, speed of sound, means along a path."""
