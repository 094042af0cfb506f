"""Output of a dish's surface."""
