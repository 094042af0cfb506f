"""Nobody looks into the Sun or a box: requests, moves, beams at rest."""
