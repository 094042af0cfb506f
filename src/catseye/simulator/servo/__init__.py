"""A mirror's motion chip, its motor and axis, step by step."""
