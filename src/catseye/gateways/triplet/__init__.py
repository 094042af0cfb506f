"""Triplet units on the way out."""
