"""Commands for many nights, runs and years."""
