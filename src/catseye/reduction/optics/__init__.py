"""Beam and link: arriving light, and its effect on a range."""
