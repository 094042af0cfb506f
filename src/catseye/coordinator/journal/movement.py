"""Differences of a replay's answers from the stored ones, also in u."""

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.coordinator.journal.entries import EpochSolution, Json
from catseye.coordinator.journal.replay import Replayed

LEAST_U = 1e-15  # m, rad, °C: a smaller stored u is rounding of zero, as of a pose at its own reference


class Moving(Enum):
    """Kind of quantity compared; its value is its name in JSON."""

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

    count         number compared: points, stations, ... of each epoch
    rms           of their sizes, a point's being the length of its difference; m, rad, °C
    largest       of the sizes
    normalised    number of coordinates with a stored u above zero
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
    """Running sums of one kind of movement."""

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
    """Differences of a replay, accumulated solution by solution.

    stations   names of the thermometers among an answer's air parameters
    """

    stations: Collection[str] = ()
    _sums: dict[Moving, _Sum] = field(default_factory=lambda: defaultdict(_Sum))

    def add(self, replayed: Replayed) -> None:
        """Add one solution and the shots before it."""
        number = None if replayed.stored is None else replayed.stored.answer.get("number")
        for move in replayed.shots.moves:
            self._add(Moving.RANGES, f"{move.ranger} to {move.target}", number, move.change, move.u)
        if replayed.stored is None or replayed.new is None:
            return
        for name, change, u in point_moves(replayed.stored, replayed.new):
            self._add(Moving.POINTS, name, number, change, u)
        before, after = replayed.stored.answer, replayed.new.answer
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
        """Differences by kind, if there is something to compare."""
        sums = ((moving, self._sums[moving]) for moving in Moving if moving in self._sums)
        return {moving: total.movement(total.largest) for moving, total in sums if total.largest is not None}


def in_u(change: Array, u: Array) -> Array:
    """Changes over their u, of those with a u above rounding.

    >>> in_u(np.array([3.0, 1.0]), np.array([2.0, 0.0])).tolist()
    [1.5]
    """
    significant = np.isfinite(u) & (u > LEAST_U)
    return change[significant] / u[significant]


def point_moves(stored: EpochSolution, new: EpochSolution) -> Iterator[tuple[str, Array, Array]]:
    """Name, difference (3,) and stored u (3,), m, of each common point.

    u is NaN if no covariance was stored.
    """
    before, after = places(stored), places(new)
    u = np.full((len(before), 3), np.nan)
    if stored.covariance is not None and stored.covariance.shape == (u.size, u.size):
        u = np.sqrt(np.diag(stored.covariance).clip(0.0)).reshape(-1, 3)
    for row, (name, place) in enumerate(before.items()):
        if name in after:
            yield name, after[name] - place, u[row]


def places(solution: EpochSolution) -> dict[str, Array]:
    """Positions (3,) of a solution's points, m."""
    names, x = solution.answer.get("names") or [], solution.answer.get("x") or []
    return {name: _numbers(place) for name, place in zip(names, x, strict=False)}


def _scalar_moves(before: object, after: object) -> Iterator[tuple[str, float, float]]:
    """Name, difference and stored u of values (estimate, u) in both answers."""
    if not (isinstance(before, Mapping) and isinstance(after, Mapping)):
        return
    for name in before:
        if name in after:
            (value, u), (new_value, _) = _numbers(before[name]), _numbers(after[name])
            yield name, float(new_value - value), float(u)


def _pose_moves(before: object, after: object) -> Iterator[tuple[str, Moving, float, float]]:
    """Name, kind, difference and stored u of beam angles and focus."""
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
