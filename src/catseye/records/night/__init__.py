"""A campaign, its shots, its weather; and a living night's records."""
