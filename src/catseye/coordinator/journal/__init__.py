"""Durable storage of a night before acknowledgement, and its replay."""
