"""Air over time and in space: a logger's series, air along a path, sound over an array."""
