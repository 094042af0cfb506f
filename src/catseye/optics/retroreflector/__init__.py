"""Prisms, hollow cubes, cat's-eyes: where the target point is and what comes back."""
