"""Output of panel setting."""
