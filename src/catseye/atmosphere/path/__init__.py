"""The air along a path: profiles, means, bent rays."""
