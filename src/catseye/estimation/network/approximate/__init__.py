"""Where an adjustment begins: approximate coordinates and orientations, found for what a network does not give."""
