"""Uncertainty budget of one range, from samples to metres.

scene        one shot with everything that its range follows from
inputs       its uncertain inputs, with analytical slopes of the range by each
chain        the same range as one function of drawn inputs, not linearised
explanation  the recipe, with a Monte Carlo for comparison
"""
