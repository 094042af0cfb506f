"""The uncertainty of one range: every input from the samples to metres, its slope, its share, and a Monte Carlo beside.

scene        one shot with everything that its range follows from
inputs       what of that is uncertain, with the slope of the range by each, worked out by hand
chain        the same range as one function of drawn inputs, nothing linearised
explanation  the recipe
"""
