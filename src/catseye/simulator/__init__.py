"""A twin of the site: whole synthetic nights with known truth, sharing no formula with the reduction."""

from catseye.simulator.air import NIGHT, SUMMER_DAY, WINTER, Conditions
from catseye.simulator.faults import EFFECTS, Faults, Planted
from catseye.simulator.night import Night, simulate_night
from catseye.simulator.schedule import Schedule
from catseye.simulator.truth import Truth

__all__ = [
    "EFFECTS",
    "NIGHT",
    "SUMMER_DAY",
    "WINTER",
    "Conditions",
    "Faults",
    "Night",
    "Planted",
    "Schedule",
    "Truth",
    "simulate_night",
]
