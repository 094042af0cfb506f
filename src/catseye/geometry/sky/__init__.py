"""Sun and stars, and time."""
