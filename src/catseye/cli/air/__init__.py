"""Commands about the air."""
