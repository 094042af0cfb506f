"""State of a site at one moment: places, bodies, stations, motion, Earth rotation."""
