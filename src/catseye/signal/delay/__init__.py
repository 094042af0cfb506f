"""When a known sound arrives."""
