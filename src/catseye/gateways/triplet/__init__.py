"""Output of triplet units."""
