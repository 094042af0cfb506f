"""Lengths in the laboratory: gauge blocks, height gauge, invar wire."""
