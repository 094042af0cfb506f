"""A site: monuments, mirrors, targets, triplets, what is in the way."""
