"""Retroreflectors: prisms, hollow cubes, cat's-eyes."""
