"""Poses and pointing models on the way out."""
