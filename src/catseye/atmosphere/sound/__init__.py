"""The speed of sound, and wind."""
