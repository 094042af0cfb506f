"""Drift of the electronics: reference shots, noise, random walks."""
