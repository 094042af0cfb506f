"""A dish's surface on the way out."""
