"""Commands about beams, glass and laser safety."""
