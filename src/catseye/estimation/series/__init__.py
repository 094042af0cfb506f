"""Series of readings: noise and time scales from the readings themselves, states between them."""
