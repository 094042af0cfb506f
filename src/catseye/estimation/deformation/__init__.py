"""Movements between epochs: congruence tests, comparison, group motions."""
