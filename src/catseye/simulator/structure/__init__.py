"""Truth of a telescope that a structural model bends."""
