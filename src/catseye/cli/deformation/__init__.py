"""Commands of positions and movements."""
