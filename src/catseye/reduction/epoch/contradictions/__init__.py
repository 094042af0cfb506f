"""Contradictions between records and ranges, and the records that explain them."""
