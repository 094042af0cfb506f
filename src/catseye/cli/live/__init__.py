"""Commands of a living site."""
