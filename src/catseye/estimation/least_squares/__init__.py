"""Rows, normal equations, robust weights, conflicts: the solver itself."""
