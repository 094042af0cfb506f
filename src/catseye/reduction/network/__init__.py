"""Recipes of networks: adjustment, comparison of two epochs, plan."""
