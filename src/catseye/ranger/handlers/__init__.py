"""Handlers of ZY commands, functions of state and request values."""
