"""A flexible telescope on the way out."""
