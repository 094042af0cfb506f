"""Recipe for movements of points from changes of their ranges."""
