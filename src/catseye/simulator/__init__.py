"""Simulated site: synthetic nights with known truth, independent of the reduction's formulas.

`night.simulate.simulate_night` makes a night, `night.sheets.write_night` its campaign directory.
"""
