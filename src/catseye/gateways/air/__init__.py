"""Air, sound and the instruments that measure them, on the way out."""
