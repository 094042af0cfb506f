"""Distance of new answers from the stored ones, in their unit and in their stored standard uncertainties."""

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.coordinator.journal.entries import EpochSolution, Json
from catseye.coordinator.journal.replay import Replayed

Array = NDArray[np.float64]
LEAST_U = 1e-15  # m, rad, °C: a smaller stored u is the rounding of what has none, of a pose at its own reference


class Moving(Enum):
    """A kind of quantity that may move; its value is its name in JSON."""

    POINTS = "points"  # places, m
    RANGES = "ranges"  # of single shots, m
    THERMOMETERS = "thermometers"  # offsets of the stations, °C
    ZEROS = "zeros"  # of the rangers, m
    BEAM = "beam"  # azimuth times cos E and elevation since the reference epoch, rad
    FOCUS = "focus"  # since the reference epoch, m


@dataclass(frozen=True)
class Furthest:
    """Largest movement of a kind: size, name, epoch (None: after the last)."""

    size: float
    name: str
    epoch: int | None


@dataclass(frozen=True)
class Movement:
    """Differences of one kind, new less stored, over all epochs.

    count         compared: points, stations, ... of each epoch
    rms           of their sizes, a point's being the length of its difference; m, rad, °C
    largest       of the sizes
    normalised    coordinates that have a stored u above zero
    rms_u         of the coordinates' differences, each over its u; NaN without any
    largest_u     of those, None without any
    """

    count: int
    rms: float
    largest: Furthest
    normalised: int
    rms_u: float
    largest_u: Furthest | None


@dataclass
class _Sum:
    """Sums of one kind of movement, which grow entry by entry."""

    count: int = 0
    squares: float = 0.0
    largest: Furthest | None = None
    normalised: int = 0
    squares_u: float = 0.0
    largest_u: Furthest | None = None

    def add(self, name: str, epoch: int | None, change: Array, u: Array) -> None:
        size = float(np.linalg.norm(change))
        if not math.isfinite(size):
            return
        self.count += 1
        self.squares += size**2
        if self.largest is None or size > self.largest.size:
            self.largest = Furthest(size, name, epoch)
        over = np.abs(in_u(change, u))
        if len(over):
            self.normalised += len(over)
            self.squares_u += float(over @ over)
            if self.largest_u is None or over.max() > self.largest_u.size:
                self.largest_u = Furthest(float(over.max()), name, epoch)

    def movement(self, largest: Furthest) -> Movement:
        rms_u = math.sqrt(self.squares_u / self.normalised) if self.normalised else math.nan
        return Movement(
            count=self.count,
            rms=math.sqrt(self.squares / self.count),
            largest=largest,
            normalised=self.normalised,
            rms_u=rms_u,
            largest_u=self.largest_u,
        )


@dataclass
class Movements:
    """All that a replay moves, taken in solution by solution.

    stations   names of the thermometers among what an answer says of the air
    """

    stations: Collection[str] = ()
    _sums: dict[Moving, _Sum] = field(default_factory=lambda: defaultdict(_Sum))

    def add(self, each: Replayed) -> None:
        """Take in one solution and the shots before it."""
        number = None if each.stored is None else each.stored.answer.get("number")
        for move in each.shots.moves:
            self._add(Moving.RANGES, f"{move.ranger} to {move.target}", number, move.change, move.u)
        if each.stored is None or each.new is None:
            return
        for name, change, u in point_moves(each.stored, each.new):
            self._add(Moving.POINTS, name, number, change, u)
        before, after = each.stored.answer, each.new.answer
        for name, shift, u_shift in _scalar_moves(before.get("air"), after.get("air")):
            if name in self.stations:
                self._add(Moving.THERMOMETERS, name, number, shift, u_shift)
        for name, shift, u_shift in _scalar_moves(before.get("zeros"), after.get("zeros")):
            self._add(Moving.ZEROS, name, number, shift, u_shift)
        for name, moving, shift, u_shift in _pose_moves(before.get("pose"), after.get("pose")):
            self._add(moving, name, number, shift, u_shift)

    def _add(self, moving: Moving, name: str, epoch: int | None, change: ArrayLike, u: ArrayLike) -> None:
        self._sums[moving].add(name, epoch, np.atleast_1d(_numbers(change)), np.atleast_1d(_numbers(u)))

    @property
    def found(self) -> dict[Moving, Movement]:
        """By kind, those of which there is something to compare."""
        sums = ((moving, self._sums[moving]) for moving in Moving if moving in self._sums)
        return {moving: each.movement(each.largest) for moving, each in sums if each.largest is not None}


def in_u(change: Array, u: Array) -> Array:
    """Changes over their u, of those that have a u above rounding.

    >>> in_u(np.array([3.0, 1.0]), np.array([2.0, 0.0])).tolist()
    [1.5]
    """
    known = np.isfinite(u) & (u > LEAST_U)
    return change[known] / u[known]


def point_moves(stored: EpochSolution, new: EpochSolution) -> Iterator[tuple[str, Array, Array]]:
    """Name, difference (3,) and stored u (3,), m, of each point of both; u is NaN where no covariance was stored."""
    before, after = places(stored), places(new)
    u = np.full((len(before), 3), np.nan)
    if stored.covariance is not None and stored.covariance.shape == (u.size, u.size):
        u = np.sqrt(np.diag(stored.covariance).clip(0.0)).reshape(-1, 3)
    for row, (name, place) in enumerate(before.items()):
        if name in after:
            yield name, after[name] - place, u[row]


def places(solution: EpochSolution) -> dict[str, Array]:
    """Places (3,) of a solution's points, m."""
    names, x = solution.answer.get("names") or [], solution.answer.get("x") or []
    return {name: _numbers(place) for name, place in zip(names, x, strict=False)}


def _scalar_moves(before: object, after: object) -> Iterator[tuple[str, float, float]]:
    """Name, difference and stored u of what both answers have as name: (estimate, u)."""
    if not (isinstance(before, Mapping) and isinstance(after, Mapping)):
        return
    for name in before:
        if name in after:
            (value, u), (again, _) = _numbers(before[name]), _numbers(after[name])
            yield name, float(again - value), float(u)


def _pose_moves(before: object, after: object) -> Iterator[tuple[str, Moving, float, float]]:
    """Name, kind, difference and stored u of the beam's two angles and the focus."""
    if not (isinstance(before, Mapping) and isinstance(after, Mapping)):
        return
    change = _numbers(after["offset"]) - _numbers(before["offset"])
    u = np.sqrt(np.diag(_numbers(before["covariance"])).clip(0.0))
    kinds = (("azimuth × cos E", Moving.BEAM), ("elevation", Moving.BEAM), ("focus", Moving.FOCUS))
    for k, (name, moving) in enumerate(kinds):
        yield name, moving, float(change[k]), float(u[k])


def _numbers(values: Json | ArrayLike) -> Array:
    """JSON's numbers as an array, NaN for None."""
    return np.array(values, dtype=float)
