"""Version, in a module that every layer may import."""

__version__ = "0.9.0"
