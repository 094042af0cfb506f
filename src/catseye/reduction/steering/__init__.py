"""Mirror pointing: guard, routing, tracking, search, visibility."""
