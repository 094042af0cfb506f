"""How good an answer is: covariance, ellipsoids, reliability, robustness, variance components."""
