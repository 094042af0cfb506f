"""Archiving: sources to units of work, each of which puts one night into an archive."""
