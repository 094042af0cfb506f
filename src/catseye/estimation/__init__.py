"""Estimation of parameters and their covariance from observations."""
