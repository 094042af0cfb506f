"""Known ways in which a phase lies: leakage, cyclic terms, many paths, amplitude."""
