"""Output of poses and pointing models."""
