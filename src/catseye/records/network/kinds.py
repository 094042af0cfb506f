"""Rows of a file as groups of observations: one per kind, and one per correlated set."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from catseye.estimation.observations.kinds import (
    Azimuths,
    Directions,
    DistanceDifferences,
    Distances,
    FixedDistances,
    HeightDifferences,
    HorizontalAngles,
    HorizontalDistances,
    Inclinations,
    Joint,
    LevelPlanes,
    ObservedCoordinates,
    Reported,
    Vectors,
    ZenithAngles,
)

# Axes on which a kind depends at each of its points; default: all three.
TOUCHES = {
    "horizontal_distance": "xy",
    "direction": "xy",
    "angle": "xy",
    "azimuth": "xy",
    "height_difference": "z",
    "level_plane": "z",
}
LENGTHS = (
    *("slope_distance", "horizontal_distance", "distance_difference", "fixed_distance", "height_difference"),
    *("coordinates", "vector", "level_plane"),
)
ANGLES = ("direction", "angle", "azimuth", "zenith_angle", "inclination")
ENDS = {  # names of a kind's points in a file; default: from and to
    "angle": ("at", "backsight", "foresight"),
    "distance_difference": ("from", "to", "from_2", "to_2"),
    "coordinates": ("point",),
    "level_plane": ("point",),
}
ADDING = ("zero",)  # parameters that add to a length
SCALING = ("scale", "refractivity", "air", "station_air")  # and those that multiply it


@dataclass(frozen=True)
class Row:
    """Observation by the names of its points.

    kind         of `catseye.estimation.observations`
    ends         points: from, to, third
    value        m or rad
    u            standard uncertainty
    place        place in the file
    heights      m, of the instrument and of each target above its point, like ends; () for none
    parameters   role -> index among the network's parameters: orientation, zero, scale, refractivity, refraction, level
    claim        a, b, c of a standard uncertainty a + b D^c that grows with the length; b = 0: it is `u` alone
    component    "x", "y" or "z" of coordinates and vectors
    unit         "deg" or "gon" in which an angle was written, or ""
    constants    known values: "index" (reading of a metre), "offset" m, "refraction" (coefficient), "curved"
    """

    kind: str
    ends: tuple[str, ...]
    value: float
    u: float
    place: str
    heights: tuple[float, ...] = ()
    parameters: Mapping[str, int] = field(default_factory=dict)
    component: str = ""
    claim: tuple[float, float, float] = (0.0, 0.0, 1.0)
    unit: str = ""
    constants: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Arrays:
    """Rows of one kind as arrays for the constructors."""

    rows: Sequence[Row]
    names: Mapping[str, int]
    first: int

    def end(self, which: int) -> np.ndarray:
        return np.array([3 * self.names[row.ends[which]] for row in self.rows])

    def shift(self, which: int = 1) -> np.ndarray | None:
        """Target height minus instrument height, (m, 3), or None if no row has any."""
        if not any(any(row.heights) for row in self.rows):
            return None
        up = [row.heights[which] - row.heights[0] if row.heights else 0.0 for row in self.rows]
        return np.stack([np.zeros(len(up)), np.zeros(len(up)), np.array(up)], axis=1)

    def columns(self, role: str) -> np.ndarray | None:
        """Columns (m,) of the parameters in a role, -1 for none; None if no row has one."""
        if not any(role in row.parameters for row in self.rows):
            return None
        at = [row.parameters.get(role, -1) for row in self.rows]
        return np.array([self.first + a if a >= 0 else -1 for a in at])

    def several(self, roles: Sequence[str]) -> np.ndarray | None:
        columns = [c for c in map(self.columns, roles) if c is not None]
        return np.stack(columns, axis=1) if columns else None

    def constant(self, key: str, default: float) -> np.ndarray | float:
        if not any(key in row.constants for row in self.rows):
            return default
        return np.array([row.constants.get(key, default) for row in self.rows])

    def reading(self) -> dict[str, np.ndarray | float | None]:
        return {
            "scale": self.constant("index", 1.0),
            "offset": self.constant("offset", 0.0),
            "nuisance": self.several(ADDING),
            "scaling": self.several(SCALING),
        }


def _zenith_angles(name: str, observed: np.ndarray, covariance: np.ndarray, a: _Arrays) -> Reported:
    return ZenithAngles(
        name,
        observed,
        covariance,
        a.end(0),
        a.end(1),
        shift=a.shift(),
        refraction=a.constant("refraction", 0.0),
        refraction_column=a.columns("refraction"),
        curved=any(row.constants.get("curved") for row in a.rows),
    )


def _column(a: _Arrays, role: str) -> np.ndarray:
    columns = a.columns(role)
    return np.full(len(a.rows), -1) if columns is None else columns


def _axes(a: _Arrays) -> np.ndarray:
    return np.array(["xyz".index(row.component) for row in a.rows])


MAKERS: dict[str, Callable[[str, np.ndarray, np.ndarray, _Arrays], Reported]] = {
    "slope_distance": lambda n, o, c, a: Distances(n, o, c, a.end(0), a.end(1), shift=a.shift(), **a.reading()),  # type: ignore[arg-type]
    "horizontal_distance": lambda n, o, c, a: HorizontalDistances(n, o, c, a.end(0), a.end(1), **a.reading()),  # type: ignore[arg-type]
    "distance_difference": lambda n, o, c, a: DistanceDifferences(
        name=n,
        observed=o,
        covariance=c,
        origin=a.end(0),
        target=a.end(1),
        origin_2=a.end(2),
        target_2=a.end(3),
        **a.reading(),  # type: ignore[arg-type]
    ),
    "fixed_distance": lambda n, o, c, a: FixedDistances(n, o, c, a.end(0), a.end(1)),
    "direction": lambda n, o, c, a: Directions(
        name=n, observed=o, covariance=c, origin=a.end(0), target=a.end(1), orientation=_column(a, "orientation")
    ),
    "angle": lambda n, o, c, a: HorizontalAngles(
        name=n, observed=o, covariance=c, at=a.end(0), backsight=a.end(1), foresight=a.end(2)
    ),
    "azimuth": lambda n, o, c, a: Azimuths(n, o, c, a.end(0), a.end(1)),
    "zenith_angle": _zenith_angles,
    "height_difference": lambda n, o, c, a: HeightDifferences(n, o, c, a.end(0), a.end(1), shift=a.shift()),
    "inclination": lambda n, o, c, a: Inclinations(
        n, o, c, a.end(0), a.end(1), shift=a.shift(), zero=a.columns("zero")
    ),
    "level_plane": lambda n, o, c, a: LevelPlanes(
        name=n, observed=o, covariance=c, point=a.end(0), level=_column(a, "level"), height=a.constant("height", 0.0)
    ),
    "coordinates": lambda n, o, c, a: ObservedCoordinates(n, o, c, a.end(0), _axes(a)),
    "vector": lambda n, o, c, a: Vectors(n, o, c, a.end(0)[::3], a.end(1)[::3]),
}


def group_of(
    name: str, rows: Sequence[Row], covariance: np.ndarray, *, names: Mapping[str, int], first: int
) -> Reported:
    """Group of some rows.

    name         for reports
    rows         of any kinds
    covariance   (m,), (m, m) or blocks (b, 3, 3), m^2, rad^2, m rad
    names        point -> index
    first        column of the first parameter after the points
    """
    if len({row.kind for row in rows}) == 1:
        return _of_one_kind(name, rows, covariance, _Arrays(rows, names, first))
    starts = [0, *(i for i in range(1, len(rows)) if rows[i].kind != rows[i - 1].kind), len(rows)]
    parts = []
    for begin, end in pairwise(starts):
        some = rows[begin:end]
        variances = np.diag(covariance)[begin:end]
        parts.append(_of_one_kind(f"{name}: {some[0].kind}", some, variances, _Arrays(some, names, first)))
    return Joint.of(name, tuple(parts), covariance)


def _of_one_kind(name: str, rows: Sequence[Row], covariance: np.ndarray, arrays: _Arrays) -> Reported:
    observed = np.array([row.value for row in rows])
    return MAKERS[rows[0].kind](name, observed, covariance, arrays)


def blocks_of(correlated: Sequence[tuple[list[Row], np.ndarray]]) -> list[tuple[list[Row], np.ndarray]]:
    """Correlated sets; independent vectors are joined to one set with blocks (b, 3, 3)."""
    vectors: list[Row] = []
    blocks: list[np.ndarray] = []
    remainder: list[tuple[list[Row], np.ndarray]] = []
    for rows, covariance in correlated:
        b = len(rows) // 3
        apart = np.kron(np.eye(b), np.ones((3, 3))) if all(row.kind == "vector" for row in rows) else None
        if apart is None or np.any(covariance[apart == 0.0]):
            remainder.append((rows, covariance))
            continue
        vectors += rows
        blocks += [covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(b)]
    return [*([(vectors, np.array(blocks))] if vectors else []), *remainder]
