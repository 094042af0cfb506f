"""Synthetic nights with known truth, as campaign directories."""
