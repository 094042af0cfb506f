"""The panel setting instrument: heights of corners, turns of screws, the crew's statistics."""
