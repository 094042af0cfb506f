"""Quality of a result: covariance, ellipsoids, reliability, robustness, variance components."""
