"""What a site is at one moment: places, bodies, stations, motion, the Earth's turn."""
