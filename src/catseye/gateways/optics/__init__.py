"""Output of beams, glass, retroreflectors, coatings and laser safety."""
