"""Living simulated site: heads, beams, air, telescope, feed."""
