"""What the light travels through: moist air, its index for light, and its mean along a path."""
