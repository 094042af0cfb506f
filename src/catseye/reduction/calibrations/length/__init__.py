"""Lengths in the laboratory: gauge blocks, height gauge, Invar wire."""
