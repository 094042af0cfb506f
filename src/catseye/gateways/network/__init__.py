"""Output of an adjusted, planned or compared network."""
