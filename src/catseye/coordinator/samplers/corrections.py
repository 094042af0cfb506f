"""Corrections for the telescope's control, with the record of the zero that they are relative to."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from catseye.coordinator.condition import verdict_of
from catseye.coordinator.journal.entries import Entry, EpochSolution
from catseye.coordinator.samplers.pose_rows import Row, number_word, offset_of_pose
from catseye.coordinator.samplers.rings import MOVED
from catseye.ranger.line import stamp_text
from catseye.records.night.live import Happening

FRAME = "reflector frame: azimuth along rising azimuth times cos E; focus along the axis away from the dish"
PIVOT = "dish about its vertex; feed about the prime focus"
MOST_MOVES = 4096  # remembered
NO_ZERO = ("none", "none", "none", "none")


@dataclass(frozen=True)
class ReferenceZero:
    """Epoch whose pose counts as zero.

    number               of the epoch
    ticks                its instant
    azimuth, elevation   rad, of the telescope then
    """

    number: int
    ticks: int
    azimuth: float
    elevation: float

    @property
    def words(self) -> tuple[str, ...]:
        """Number, MJD, azimuth and elevation, as sent."""
        angles = (number_word(self.azimuth), number_word(self.elevation))
        return (str(self.number), stamp_text(self.ticks), *angles)


class CorrectionOutput:
    """Corrections of each solution: the opposite of the beam's and the focus's offsets.

    gives   True if the telescope gets corrections

    `zero` is the present reference, None before there is one.
    """

    def __init__(self, gives: Callable[[], bool]):
        self._gives = gives
        self.zero: ReferenceZero | None = None
        self._last: ReferenceZero | None = None
        self._moves: deque[int] = deque(maxlen=MOST_MOVES)  # ticks

    @property
    def moves(self) -> int:
        """Number of recorded moves of other actuators since the reference epoch."""
        return 0 if self.zero is None else sum(ticks > self.zero.ticks for ticks in self._moves)

    def row(self, entry: Entry) -> Row | None:
        """Row of the sampler for a solution; None for another entry, of which moves are counted."""
        if isinstance(entry, Happening) and entry.kind == MOVED:
            self._moves.append(entry.ticks)
        return self._row(entry) if isinstance(entry, EpochSolution) and entry.answer else None

    def _row(self, entry: EpochSolution) -> Row:
        answer = entry.answer
        local = ReferenceZero(
            answer["number"], entry.ticks, answer.get("azimuth", np.nan), answer.get("elevation", np.nan)
        )
        self._find_zero(answer.get("reference", 0), local)
        self._last = local
        pose = answer.get("pose")
        offset, covariance = offset_of_pose(pose if isinstance(pose, Mapping) else {})
        state = self._state(entry, bool(np.isfinite(offset).all()))
        values = np.concatenate([0.0 - offset, np.sqrt(np.maximum(np.diag(covariance), 0.0))])
        if state != "given":
            values = np.full(6, np.nan)
        zero = NO_ZERO if self.zero is None else self.zero.words
        first = (stamp_text(entry.ticks), number_word(answer["number"]), state)
        return (*first, *map(number_word, values.tolist()), *zero, str(self.moves))

    def _state(self, entry: EpochSolution, known: bool) -> str:
        if not self._gives():
            return "off"
        if not known:
            return "unknown"
        return "given" if verdict_of(entry).word == "good" else "doubtful"

    def _find_zero(self, number: int, own: ReferenceZero) -> None:
        """Note another reference: it is the last epoch before this one, or this one itself."""
        if self.zero is not None and self.zero.number == number:
            return
        known = (own, *(() if self._last is None else (self._last,)))
        self.zero = next((item for item in known if item.number == number), None)
