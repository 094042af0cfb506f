"""Systematic phase errors: leakage, cyclic terms, multipath, amplitude coupling."""
