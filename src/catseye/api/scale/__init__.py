"""Functions for many nights, runs and years."""
