"""Tables of a design study: moves, points, numbers, maps."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.columns import Column, Table
from catseye.reduction.design.maps import DesignMap
from catseye.reduction.design.study import DesignStudy, PlaceMove

PAGE = "design.md"


def _place(axis: int, when: str) -> Column[DesignStudy]:
    letter = "xyz"[axis]
    doc = f"{letter} {when}, in `frame`; empty where the unit is not there"
    return Column(
        f"{letter}_{when}_m", "m", doc, lambda s: np.array([_of(move, when)[axis] for move in s.moves]), ".4f"
    )


def _of(move: PlaceMove, when: str) -> tuple[float, float, float]:
    return move.before if when == "before" else move.after


MOVES = Table[DesignStudy](
    "moves.csv",
    PAGE,
    (
        Column("unit", "", "ranger, target or triplet, the farthest move first", lambda s: [m.unit for m in s.moves]),
        Column("frame", "", "frame that carries it", lambda s: [m.frame for m in s.moves]),
        *(_place(axis, when) for when in ("before", "after") for axis in range(3)),
        Column("distance_m", "m", "length of the move", lambda s: np.array([m.distance for m in s.moves]), ".4f"),
    ),
)


def _axis(axis: int) -> Column[DesignStudy]:
    letter = "xyz"[axis]
    doc = f"{letter} of the unit vector along the longest axis after, ground frame, upwards"
    return Column(f"axis_{letter}", "", doc, lambda s: s.after.longest[1][:, axis], ".6f")


POINTS = Table[DesignStudy](
    "points.csv",
    PAGE,
    (
        Column("point", "", "point of interest", lambda s: list(s.aim.interest)),
        Column(
            "longest_before_mm",
            "mm",
            "longest semi-axis of its standard ellipsoid before",
            lambda s: s.before.longest[0] / MILLIMETRE,
            ".7f",
        ),
        Column("longest_after_mm", "mm", "the same after", lambda s: s.after.longest[0] / MILLIMETRE, ".7f"),
        *(_axis(axis) for axis in range(3)),
    ),
)

NUMBERS = Table[DesignStudy](
    "numbers.csv",
    PAGE,
    (
        Column("number", "", "rangers or targets, all together", lambda s: [n.number for n in s.numbers]),
        Column("u_mm", "mm", "root of the criterion", lambda s: np.array([n.u for n in s.numbers]) / MILLIMETRE, ".7f"),
        Column("change", "", "left out or added last", lambda s: [n.change for n in s.numbers]),
    ),
)

MAPS = Table[DesignMap](
    "map-one-more.csv",
    PAGE,
    (
        Column("x_m", "m", "place of the ranger, ground frame", lambda m: np.tile(m.x, len(m.y)), ".4f"),
        Column("y_m", "m", "likewise", lambda m: np.repeat(m.y, len(m.x)), ".4f"),
        Column(
            "u_mm",
            "mm",
            "root of the criterion with it; empty in an obstacle",
            lambda m: m.u.ravel() / MILLIMETRE,
            ".7f",
        ),
    ),
    also=("map-*.csv",),
)


def map_name(drawn: DesignMap) -> str:
    """Name of a map's files, without suffix."""
    return f"map-{drawn.ranger or 'one-more'}"
