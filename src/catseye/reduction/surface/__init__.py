"""A dish's shape from its prisms, its change, and what its actuators should do."""
