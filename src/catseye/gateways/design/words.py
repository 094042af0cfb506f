"""Words of a design study, which its sentences, tables and figures share."""

import numpy as np

from catseye.aliases import Array
from catseye.reduction.design.aim import DesignAim

QUANTITIES = {
    "trace": "root mean square u of a coordinate",
    "worst": "u along the worst axis",
    "pose": "u of a coordinate by the body's pose",
    "gain": "u of half-path errors",
}
COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")


def quantity_of(aim: DesignAim) -> str:
    """Name of the criterion's number.

    >>> quantity_of(DesignAim("worst", ("A",)))
    'u along the worst axis'
    """
    return QUANTITIES[aim.name]


def direction_of(axis: Array) -> str:
    """Direction of an axis, upwards, in words.

    >>> direction_of(np.array([0.0, 0.0, 1.0])), direction_of(np.array([0.8, 0.0, 0.6]))
    ('up', 'to the east, 37° up')
    """
    x, y, z = axis
    rise = np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))
    if rise > 80.0:
        return "up"
    bearing = np.degrees(np.arctan2(x, y)) % 360.0
    return f"to the {COMPASS[int(np.round(bearing / 45.0)) % 8]}, {rise:.0f}° up"
