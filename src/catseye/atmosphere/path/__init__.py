"""Air along a path: profiles, means, bent rays."""
