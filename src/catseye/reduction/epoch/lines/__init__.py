"""Lines of a network: whole cycles, tests of each line, and points that nothing checks."""
