"""Table of all observations that connect points of a network, of any kind."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from catseye.estimation.least_squares.rows import variances
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.observations.kind import value
from catseye.estimation.observations.kinds import (
    Azimuths,
    Directions,
    Distances,
    FixedDistances,
    HeightDifferences,
    HorizontalAngles,
    HorizontalDistances,
    Inclinations,
    Joint,
    LevelPlanes,
    ObservationGroup,
    ObservedCoordinates,
    Vectors,
    ZenithAngles,
)
from catseye.estimation.observations.reading import reading_columns

RANGE, LEVEL, BEARING, ZENITH, DIFFERENCE, COORDINATE = range(6)
WORDS = ("range", "horizontal distance", "direction", "zenith angle", "coordinate difference", "coordinate")
GROUND = -1  # the "set" of a direction with known orientation: an azimuth


@dataclass(frozen=True, eq=False)
class Sightings:
    """Observations between two points (or of one) that can place a point, a table of m rows.

    code       RANGE ... COORDINATE
    origin     (m,) index of the point measured from; of a coordinate, the point
    target     (m,) index of the point measured to; -1 for a coordinate
    observed   (m,) m or rad; an inclination as a zenith angle, a range without scale and zero
    shift      (m, 3) m added to target minus origin
    sigma      (m,) m or rad
    which      (m,) set of a direction (GROUND: an azimuth), axis of a difference or coordinate; else 0
    """

    code: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    observed: np.ndarray
    shift: np.ndarray
    sigma: np.ndarray
    which: np.ndarray

    def only(self, chosen: np.ndarray) -> "Sightings":
        """Selected rows, by mask (m,) or indices."""
        return Sightings(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})

    def __len__(self) -> int:
        return len(self.code)


def parts_of(network: ObservationNetwork) -> Iterator[tuple[ObservationGroup, np.ndarray]]:
    """Groups with their variances; a joint group part by part."""
    for group in network.groups:
        if not isinstance(group, Joint):
            yield group, variances(group)
            continue
        cut = 0
        for part in group.parts:
            m = len(part.observed)
            yield replace(cast(Any, part), observed=group.observed[cut : cut + m]), variances(group)[cut : cut + m]
            cut += m


def sightings(network: ObservationNetwork) -> Sightings:
    """Table of a network's observations."""
    start = np.concatenate([np.zeros(3 * len(network.points.names)), [p.start for p in network.parameters]])
    tables: list[Sightings] = []
    sets = len(start)  # angles form additional sets, after those with an orientation parameter
    for group, variance in parts_of(network):
        if isinstance(group, HorizontalAngles):
            tables += _of_angles(group, variance, sets)
            sets += 2 * len(group.observed)
        elif isinstance(group, LevelPlanes):
            tables += _of_levels(group, variance)
        elif (table := _of_group(group, variance, start)) is not None:
            tables.append(table)
    if not tables:
        return Sightings(
            code=np.zeros(0, int),
            origin=np.zeros(0, int),
            target=np.zeros(0, int),
            observed=np.zeros(0),
            shift=np.zeros((0, 3)),
            sigma=np.zeros(0),
            which=np.zeros(0, int),
        )
    names = Sightings.__dataclass_fields__
    return Sightings(**{name: np.concatenate([getattr(t, name) for t in tables]) for name in names})


def _table(
    code: int,
    ends: tuple[Any, ...],
    *,
    observed: np.ndarray,
    variance: np.ndarray,
    shift: np.ndarray | None = None,
    which: Any = 0,
) -> Sightings:
    """Rows (m,) of one code, from columns of the parameter vector at both ends."""
    m = len(observed)
    wide = np.broadcast_to(np.zeros(3) if shift is None else shift, (m, 3))
    origin, target = (np.broadcast_to(np.asarray(end) // 3, (m,)) for end in ends)
    number = np.broadcast_to(np.asarray(which), (m,))
    return Sightings(
        code=np.full(m, code),
        origin=origin,
        target=target,
        observed=observed,
        shift=wide,
        sigma=np.sqrt(variance),
        which=number,
    )


def _of_group(group: ObservationGroup, variance: np.ndarray, start: np.ndarray) -> Sightings | None:
    """Rows of all kinds except angles and level planes.

    None for kinds that cannot place a point.
    """
    common: dict[str, Any] = {"observed": group.observed, "variance": variance, "shift": getattr(group, "shift", None)}
    match group:
        case Distances():
            return _table(RANGE, group.ends, **common | {"observed": _length(group, start)})
        case FixedDistances():
            return _table(RANGE, group.ends, **common)
        case HorizontalDistances():
            return _table(LEVEL, group.ends, **common | {"observed": _length(group, start)})
        case Directions():
            return _table(BEARING, group.ends, **common, which=group.orientation)
        case Azimuths():
            return _table(BEARING, group.ends, **common, which=GROUND)
        case ZenithAngles():
            return _table(ZENITH, group.ends, **common)
        case Inclinations():
            zenith = np.pi / 2 - group.observed + value(start, group.columns[:, 6])
            return _table(ZENITH, group.ends, **common | {"observed": zenith})
        case HeightDifferences():
            return _table(DIFFERENCE, group.ends, **common, which=2)
        case Vectors():
            wide = np.broadcast_to(np.zeros(3) if group.shift is None else group.shift, (len(group.origin), 3))
            axis = np.tile(np.arange(3), len(group.origin))
            return _table(DIFFERENCE, group.ends, **common | {"shift": np.repeat(wide, 3, axis=0)}, which=axis)
        case ObservedCoordinates():
            return _table(COORDINATE, (group.point, -1), **common, which=group.axis)
    return None


def _of_angles(group: HorizontalAngles, variance: np.ndarray, sets: int) -> Iterator[Sightings]:
    """Sights of angles as directions of sets, numbered from `sets`."""
    for at, target, reading, row, circle in _circles(group):
        shift = group.foresight_shift if target == group.foresight[row] else group.backsight_shift
        row_shift = None if shift is None else np.broadcast_to(shift, (len(variance), 3))[[row]]
        yield _table(
            BEARING,
            (at, target),
            observed=np.array([reading]),
            variance=variance[[row]],
            shift=row_shift,
            which=sets + circle,
        )


def _of_levels(group: LevelPlanes, variance: np.ndarray) -> Iterator[Sightings]:
    """Heights, or height differences to the first point of each level plane of unknown height."""
    height = group.observed - group.height
    for level in np.unique(group.columns[:, 1]):
        members = np.flatnonzero(group.columns[:, 1] == level)
        point, up, v = group.point[members], height[members], variance[members]
        if level < 0:
            yield _table(COORDINATE, (point, -1), observed=up, variance=v, which=2)
        else:
            ends, rise = (point[0], point[1:]), up[1:] - up[0]
            yield _table(DIFFERENCE, ends, observed=rise, variance=v[1:] + v[0], which=2)


def _length(group: Distances | HorizontalDistances, start: np.ndarray) -> np.ndarray:
    """Observed lengths (m,) corrected for offset and scale, from the start values."""
    nuisance, scaling = reading_columns(group)
    offset = group.offset + np.sum(np.where(nuisance < 0, 0.0, group.coefficient) * value(start, nuisance), axis=1)
    factor = np.sum(np.where(scaling < 0, 0.0, group.scaling_coefficient) * value(start, scaling), axis=1)
    return (group.observed - offset) / (group.scale + factor)


def _circles(group: HorizontalAngles) -> Iterator[tuple[int, int, float, int, int]]:
    """Angles as circle readings, one circle per connected sights: (at, target, reading, row, circle)."""
    ties: dict[tuple[int, int], list[tuple[int, float, int]]] = defaultdict(list)
    for row, (at, back, fore) in enumerate(zip(group.at, group.backsight, group.foresight, strict=True)):
        ties[at, back].append((fore, group.observed[row], row))
        ties[at, fore].append((back, -group.observed[row], row))
    visited: set[tuple[int, int]] = set()
    for circle, first in enumerate(ties):
        waiting = [(first[1], 0.0, ties[first][0][2])]
        while waiting:
            target, reading, row = waiting.pop()
            if (first[0], target) not in visited:
                visited.add((first[0], target))
                yield first[0], target, reading, row, circle
                waiting += [(neighbour, reading + angle, k) for neighbour, angle, k in ties[first[0], target]]
