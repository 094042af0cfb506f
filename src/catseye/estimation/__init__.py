"""From observations to parameters and their covariance."""
