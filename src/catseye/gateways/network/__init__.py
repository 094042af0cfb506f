"""An adjusted, planned or compared network on the way out."""
