"""Beams, glass, retroreflectors, coatings and laser safety on the way out."""
