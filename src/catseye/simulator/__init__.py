"""A twin of the site: whole synthetic nights with known truth, sharing no formula with the reduction.

`night.simulate.simulate_night` makes a night, `night.sheets.write_night` its campaign directory.
"""
