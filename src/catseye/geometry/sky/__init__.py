"""Positions of Sun and stars, and time tags."""
