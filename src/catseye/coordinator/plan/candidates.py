"""Shot candidates of one ranger in a round: pointings, move times, allowed moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.coordinator.visibility.surroundings import BOX, FREE, PERHAPS, SUN, Surroundings
from catseye.geometry.mirror.encoder import HALF_TURN
from catseye.geometry.mirror.slew import trapezoid

AZIMUTH, ELEVATION = 1, 2
HALT = 0.1  # s, at a corner
WHY = {FREE: None, SUN: "the Sun", BOX: "a box"}


@dataclass(frozen=True, eq=False)
class ShotCandidates:
    """Present mirror position, row 0, and m possible shots.

    names     (1 + m) the first is ""
    middle    (1 + m, 2) counts in the middle of the round
    low, high (1 + m, 2) range of counts during it
    code      (1 + m, 1 + m) FREE, SUN or PERHAPS of a move from row to column, wherever both are by then
    moving    (1 + m, 1 + m) s, including moves around corners
    corner    (1 + m, 1 + m) 0: one move; AZIMUTH or ELEVATION: that axis first, alone
    units     (1 + m, 3) unit vectors to them, ground frame
    """

    names: tuple[str, ...]
    middle: Array
    low: Array
    high: Array
    code: NDArray[np.int8]
    moving: Array
    corner: NDArray[np.int8]
    units: Array

    def via(self, row: int, column: int) -> tuple[tuple[float, float], ...]:
        """Counts of intermediate stops."""
        code = int(self.corner[row, column])
        if code == 0:
            return ()
        azimuth, elevation = (column, row) if code == AZIMUTH else (row, column)
        return ((float(self.middle[azimuth, 0]), float(self.middle[elevation, 1])),)

    def may(self, row: int, column: int, around: Surroundings) -> str | None:
        """Reason why a move is not allowed, None if free; boxes checked once."""
        if self.code[row, column] == PERHAPS:
            entered = around.box_entered(self.middle[row], self.middle[column])
            self.code[row, column] = FREE if entered is None else BOX
        return WHY[int(self.code[row, column])]


def candidates(
    names: tuple[str, ...], looks: Array, units: Array, *, start: tuple[float, float], around: Surroundings
) -> tuple[ShotCandidates, dict[str, str]]:
    """Table of candidates, and reasons why others were left out.

    names    (m)
    looks    (m, nodes, 2) counts at times of the round; NaN beyond the stops
    units    (m, 3) towards them
    start    present counts of the mirror
    """
    unseen: dict[str, str] = {}
    reachable = np.asarray(np.isfinite(looks).all(axis=(1, 2)))
    steady = np.asarray(reachable & (np.ptp(np.where(np.isfinite(looks), looks, 0.0)[..., 0], axis=1) < HALF_TURN))
    pointing = np.full(len(names), FREE, dtype=np.int8)
    pointing[steady] = around.codes(looks[steady].min(axis=1), looks[steady].max(axis=1))
    for i, name in enumerate(names):
        if not reachable[i]:
            unseen[name] = "beyond the azimuth stops"
        elif not steady[i]:
            unseen[name] = "passes the end of the azimuth stops during the round"
        elif pointing[i] == SUN:
            unseen[name] = "too near the Sun"
        elif pointing[i] == PERHAPS:
            box = around.box_in(looks[i].min(axis=0), looks[i].max(axis=0))
            if box is not None:
                unseen[name] = f"too near {box}"
    indices = [i for i, name in enumerate(names) if name not in unseen]
    position = np.array(start, dtype=float)
    low = np.concatenate([position[None], looks[indices].min(axis=1)]) if indices else position[None]
    high = np.concatenate([position[None], looks[indices].max(axis=1)]) if indices else position[None]
    middle = np.concatenate([position[None], looks[indices, looks.shape[1] // 2]]) if indices else position[None]
    a, b = np.triu_indices(len(low))  # both directions are one rectangle
    code = np.empty((len(low), len(low)), dtype=np.int8)
    code[a, b] = code[b, a] = around.codes(np.minimum(low[a], low[b]), np.maximum(high[a], high[b]))
    code[0] = np.where(leaves(around, position, low, high), FREE, code[0])
    moving = trapezoid(middle[:, None], middle[None], around.vantage.pace).total
    corner = _round_corners(around, middle, low, high, code=code, moving=moving)
    chosen = np.concatenate([np.zeros((1, 3)), units[indices].reshape(-1, 3)])
    return ShotCandidates(
        names=("", *(names[i] for i in indices)),
        middle=middle,
        low=low,
        high=high,
        code=code,
        moving=moving,
        corner=corner,
        units=chosen,
    ), unseen


def _round_corners(
    around: Surroundings, middle: Array, low: Array, high: Array, *, code: NDArray[np.int8], moving: Array
) -> NDArray[np.int8]:
    """Axis to move first, alone, if both at once might hit a zone.

    Changes `code` and `moving`. A rectangle of counts that contains a zone is passed along its sides, if one of its
    other corners is free.
    """
    corner = np.zeros(code.shape, dtype=np.int8)
    free = np.asarray(around.codes(low, high) == FREE)
    start, end = np.nonzero(np.triu(code != FREE) & free[:, None] & free[None])
    if len(start) == 0:
        return corner
    best = np.full(len(start), np.inf)
    for first in (AZIMUTH, ELEVATION):
        azimuth, elevation = (end, start) if first == AZIMUTH else (start, end)
        at = [np.stack([side[azimuth, 0], side[elevation, 1]], axis=-1) for side in (low, high, middle)]
        total = np.full(len(start), HALT)
        good = np.ones(len(start), dtype=bool)
        for leg in (start, end):
            legs = np.minimum(low[leg], at[0]), np.maximum(high[leg], at[1])
            good &= around.codes(*legs) == FREE
            total = total + trapezoid(middle[leg], at[2], around.vantage.pace).total
        better = good & (total < best)
        corner[start[better], end[better]] = first
        corner[end[better], start[better]] = AZIMUTH + ELEVATION - first  # the same path back
        best = np.where(better, total, best)
    passable = np.isfinite(best)
    for i, j in ((start[passable], end[passable]), (end[passable], start[passable])):
        code[i, j], moving[i, j] = FREE, best[passable]
    return corner


def leaves(around: Surroundings, position: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """True for moves that leave the Sun's cone without coming nearer.

    Moves (n,) go from counts (2,) to anywhere in rectangles (n, 2).
    """
    present = float(around.from_sun(position, position))
    if present > 0.0:
        return np.zeros(len(low), dtype=bool)
    outside = around.from_sun(low, high) > 0.0
    path = around.from_sun(np.minimum(low, position), np.maximum(high, position))
    return np.asarray(
        outside & (path >= present - 1e-6) & ~around.near_boxes(np.minimum(low, position), np.maximum(high, position))
    )
