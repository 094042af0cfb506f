"""Panel setting instrument: corner heights, screw turns, crew statistics."""
