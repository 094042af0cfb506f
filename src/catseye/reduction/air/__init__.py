"""Air of a night: refractometers, sound, index along each path."""
