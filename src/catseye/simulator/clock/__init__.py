"""Simulated clocks: manual time, and an event loop in virtual time."""
