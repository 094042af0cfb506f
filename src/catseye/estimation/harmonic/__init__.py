"""Series of harmonics with elevation or azimuth, of many points at once."""
