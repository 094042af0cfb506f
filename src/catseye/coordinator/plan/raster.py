"""The dish's prisms in turn: each feed-arm ranger goes to and fro over all that it sees, a stretch of it a round."""

import numpy as np
from numpy.typing import NDArray

from catseye.coordinator.visibility.surroundings import FREE, Surroundings
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage
from catseye.geometry.mirror.slew import trapezoid

Array = NDArray[np.float64]
BAND = 400.0  # counts of elevation in which a pass goes along the azimuth: 5.8 deg of the beam
WINDOW = 120  # prisms looked at in a round
MOST_PASSED = 12  # of them, before the rest waits for the next round


class DishRaster:
    """One ranger's way over the prisms that it sees.

    vantage   of the ranger, on the feed arm
    retros    the prisms, reflector frame

    The way is ordered by the mirror's own counts, in bands of elevation, to and fro in azimuth: short moves.
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
        each: float,
        shift: Array,
        left_alone: frozenset[str],
        visited: set[str],
    ) -> tuple[list[tuple[int, float]], dict[str, str]]:
        """The next prisms that fit: index and s from now at which the mirror has moved; and why some were left out.

        start        (2,) counts where the mirror stands
        seconds      that there are
        each         s that a shot takes besides the move
        shift        (3,) m, by which the ranger stands beside its record
        left_alone   names
        visited      names that some ranger has shot since all were: passed over in silence

        What is passed over for the Sun or a box is passed: it comes again the next time round.
        """
        ahead = self._ahead(visited)
        counts = self.vantage.look(self.points[ahead] - shift)
        known = np.isfinite(counts).all(axis=1) & np.array([self.names[i] not in left_alone for i in ahead], dtype=bool)
        free = np.zeros(len(ahead), dtype=bool)
        free[known] = around.codes(counts[known], counts[known]) == FREE
        pairs = np.concatenate([start[None], counts[free]])
        times = trapezoid(pairs[:-1], pairs[1:], self.vantage.pace).total
        codes = around.codes(np.minimum(pairs[:-1], pairs[1:]), np.maximum(pairs[:-1], pairs[1:]))
        chosen: list[tuple[int, float]] = []
        unseen: dict[str, str] = {}
        here, spent, row, last = start, 0.0, 0, 0
        for place, index in enumerate(ahead.tolist()):
            name = self.names[index]
            if not free[place]:
                unseen[name] = "too near the Sun or a box" if known[place] else "left alone, or beyond the stops"
                continue
            row += 1
            there, move, code = counts[place], float(times[row - 1]), int(codes[row - 1])
            if last != row - 1:  # something between was left out
                move, code = self._from(here, there, around)
            if code != FREE:
                unseen[name] = "the way there passes the Sun or a box"
                if len(unseen) < MOST_PASSED:
                    continue
                self.next = int(index + 1) % len(self.names)
                break
            if spent + move + each > seconds:
                self.next = index
                break
            chosen.append((index, spent + move))
            spent, here, last = spent + move + each, there, row
        else:
            self.next = int(ahead[-1] + 1) % len(self.names) if len(ahead) else 0
        return chosen, unseen

    def _ahead(self, visited: set[str]) -> NDArray[np.int64]:
        """The next prisms, by index, that nobody has visited."""
        n = len(self.names)
        ahead = [i for k in range(n) if self.names[i := (self.next + k) % n] not in visited]
        return np.array(ahead[:WINDOW], dtype=np.int64)

    def begin(self, share: float) -> None:
        """Go on from a share 0 to 1 of the way."""
        self.next = int(share * len(self.names)) % max(len(self.names), 1)

    def _from(self, here: Array, there: Array, around: Surroundings) -> tuple[float, int]:
        """Time and code of a move that no table has."""
        move = float(trapezoid(here, there, self.vantage.pace).total)
        return move, int(around.codes(np.minimum(here, there), np.maximum(here, there)))
