"""Monument: azimuth, levels, place."""
