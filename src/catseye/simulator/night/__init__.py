"""Whole synthetic nights with known truth, as campaign directories."""
