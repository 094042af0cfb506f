"""Ranging networks solved by block elimination: the input, the solver, the answer."""
