"""Recipes that join records to formulas: the page a visiting expert reads first."""
