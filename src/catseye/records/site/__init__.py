"""Site records: monuments, mirrors, targets, triplets, obstacles, interlocks."""
