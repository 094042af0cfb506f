"""A twin of the site: whole synthetic nights with known truth, sharing no formula with the reduction."""

from catseye.simulator.night.air import NIGHT, SUMMER_DAY, WINTER, Conditions
from catseye.simulator.night.faults import EFFECTS, Faults, Planted
from catseye.simulator.night.night import Night
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import simulate_night
from catseye.simulator.night.truth import Truth

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
    "write_night",
]
