"""Networks of points: datum, approximate coordinates, adjustment, plan, ranging networks."""
