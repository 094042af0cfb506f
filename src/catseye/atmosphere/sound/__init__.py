"""Speed of sound and wind."""
