"""Predicted covariance of a ranging network by its places, and the derivative of a criterion with respect to these."""
