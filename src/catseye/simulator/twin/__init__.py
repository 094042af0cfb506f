"""A site that lives: heads, beams, air, telescope, feed, in a world of its own."""
