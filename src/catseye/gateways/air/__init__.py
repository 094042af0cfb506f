"""Output of air, sound and the instruments that measure them."""
