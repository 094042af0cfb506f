"""What moved between epochs: congruence, comparison, motions of groups."""
