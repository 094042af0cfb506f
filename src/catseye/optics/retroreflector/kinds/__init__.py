"""Kinds of retroreflector, a file each, and their registry."""
