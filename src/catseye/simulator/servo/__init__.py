"""Servo simulation: motion chip, motor and axis, step by step."""
