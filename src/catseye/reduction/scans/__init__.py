"""Measured scans over retroreflectors: spots, and returns by angle; searches."""
