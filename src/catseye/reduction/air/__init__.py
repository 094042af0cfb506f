"""The air a night was measured in: refractometers, sound, what each path holds."""
