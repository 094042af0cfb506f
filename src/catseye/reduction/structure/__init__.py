"""A flexible telescope: its model, its fit to many epochs, its vibration."""
