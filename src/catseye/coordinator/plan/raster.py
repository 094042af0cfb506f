"""Raster of the dish's prisms: a stretch per round and ranger."""

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.coordinator.visibility.surroundings import FREE, Surroundings
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage
from catseye.geometry.mirror.slew import trapezoid

BAND = 400.0  # counts of elevation of a pass in azimuth: 5.8 deg of the beam
WINDOW = 120  # prisms considered in a round
MOST_PASSED = 12  # skipped ones of them, before the others wait for the next round


class DishRaster:
    """Raster of one ranger over the prisms that it sees.

    vantage   of the ranger, on the feed arm
    retros    the prisms, reflector frame

    Ordered by the mirror's own counts, in bands of elevation, to and fro in azimuth: short moves.
    """

    def __init__(self, vantage: Vantage, retros: tuple[SeenRetroreflector, ...]):
        points = np.array([r.point for r in retros]).reshape(-1, 3)
        counts = vantage.look(points)
        within = np.flatnonzero(np.isfinite(counts).all(axis=1))
        band = np.floor(counts[within, 1] / BAND).astype(int)
        along = np.where(band % 2 == 0, counts[within, 0], -counts[within, 0])
        order = within[np.lexsort((along, band))]
        self.vantage = vantage
        self.names = tuple(retros[i].name for i in order)
        self.points = points[order]
        self.next = 0

    def stretch(
        self,
        start: Array,
        seconds: float,
        around: Surroundings,
        *,
        shot_seconds: float,
        shift: Array,
        left_alone: frozenset[str],
        visited: set[str],
    ) -> tuple[list[tuple[int, float]], dict[str, str]]:
        """Next prisms that fit, and reasons why others were left out.

        The former are indices and times from now, s, at which the mirror has moved.

        start        (2,) present counts of the mirror
        seconds      available
        shot_seconds  s of a shot besides the move
        shift        (3,) m, of the ranger from its record
        left_alone   names of suspended prisms
        visited      names that any ranger has shot in this lap: skipped silently

        A prism skipped for the Sun or a box is not retried before the next lap.
        """
        ahead = self._ahead(visited)
        counts = self.vantage.look(self.points[ahead] - shift)
        usable = np.isfinite(counts).all(axis=1) & np.array(
            [self.names[i] not in left_alone for i in ahead], dtype=bool
        )
        free = np.zeros(len(ahead), dtype=bool)
        free[usable] = around.codes(counts[usable], counts[usable]) == FREE
        pairs = np.concatenate([start[None], counts[free]])
        times = trapezoid(pairs[:-1], pairs[1:], self.vantage.pace).total
        codes = around.codes(np.minimum(pairs[:-1], pairs[1:]), np.maximum(pairs[:-1], pairs[1:]))
        chosen: list[tuple[int, float]] = []
        unseen: dict[str, str] = {}
        position, spent, row, last = start, 0.0, 0, 0
        for place, index in enumerate(ahead.tolist()):
            name = self.names[index]
            if not free[place]:
                unseen[name] = "too near the Sun or a box" if usable[place] else "suspended, or beyond the stops"
                continue
            row += 1
            goal, move, code = counts[place], float(times[row - 1]), int(codes[row - 1])
            if last != row - 1:  # a prism between was left out
                move, code = self._from(position, goal, around)
            if code != FREE:
                unseen[name] = "the path passes the Sun or a box"
                if len(unseen) < MOST_PASSED:
                    continue
                self.next = int(index + 1) % len(self.names)
                break
            if spent + move + shot_seconds > seconds:
                self.next = index
                break
            chosen.append((index, spent + move))
            spent, position, last = spent + move + shot_seconds, goal, row
        else:
            self.next = int(ahead[-1] + 1) % len(self.names) if len(ahead) else 0
        return chosen, unseen

    def _ahead(self, visited: set[str]) -> NDArray[np.int64]:
        """Indices of the next prisms not yet visited."""
        n = len(self.names)
        ahead = [i for k in range(n) if self.names[i := (self.next + k) % n] not in visited]
        return np.array(ahead[:WINDOW], dtype=np.int64)

    def begin(self, share: float) -> None:
        """Continue from a share 0 to 1 of the raster."""
        self.next = int(share * len(self.names)) % max(len(self.names), 1)

    def _from(self, position: Array, goal: Array, around: Surroundings) -> tuple[float, int]:
        """Time and code of a move that is not in the table."""
        move = float(trapezoid(position, goal, self.vantage.pace).total)
        return move, int(around.codes(np.minimum(position, goal), np.maximum(position, goal)))
