"""Flexible telescope: structural model, fit to many epochs, vibration."""
