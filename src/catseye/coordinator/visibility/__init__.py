"""Visibility of targets from rangers, and zones to avoid."""
