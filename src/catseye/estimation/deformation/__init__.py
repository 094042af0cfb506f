"""Movements between epochs: congruence tests, comparison."""
