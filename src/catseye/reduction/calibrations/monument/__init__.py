"""A monument: azimuth, levels, place."""
