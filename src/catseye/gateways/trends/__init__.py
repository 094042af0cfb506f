"""Output of an archive's trends."""
