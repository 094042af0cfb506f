"""Triplet units in use: `triplets reduce`, `bound`, `aim`, `adjust`; records of measured units."""
