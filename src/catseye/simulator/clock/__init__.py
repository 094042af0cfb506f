"""Time that is passed in: a clock of the world, and an event loop in virtual time."""
