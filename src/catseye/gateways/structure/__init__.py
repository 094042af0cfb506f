"""Output of a flexible telescope's structural model."""
