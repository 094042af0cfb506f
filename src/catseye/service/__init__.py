"""Processes of a living site: event loop, screen, logs; formulas are in other layers."""
