"""Beam and link: what light arrives, and what it does to a range."""
