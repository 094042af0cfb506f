"""Recent past of a site in bounded memory: the last hour, where no journal holds it."""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import Object, number

HOUR_TICKS = TICKS_PER_DAY // 24
MOST_SHOTS, MOST_POSTURES, MOST_READINGS = 81_920, 4096, 4096
MOST_EVENTS, MOST_EPOCHS, MOST_WORDS = 1024, 512, 8192
SHOT_ROW = np.dtype(
    [
        *(("number", "i8"), ("ticks", "i8"), ("ranger", "i4"), ("target", "i4"), ("status", "i4")),
        *(("range", "f8"), ("u_range", "f8"), ("misfit", "f8")),
    ]
)
POSTURE_ROW = np.dtype([("ticks", "i8"), *((name, "f8") for name in ("azimuth", "elevation", "u", "v"))])
POSTURE_EVERY = TICKS_PER_DAY // 86_400  # one a second is remembered


class Ring:
    """Last rows of a table, oldest first; all of its memory is taken at once."""

    def __init__(self, length: int, row: np.dtype[Any]):
        self._rows = np.ones(length, dtype=row)  # not zeros: pages that are not written yet would grow later
        self._count = 0

    def add(self, *values: Any) -> None:
        """Add a row; the oldest makes place."""
        self._rows[self._count % len(self._rows)] = values
        self._count += 1

    def since(self, ticks: int) -> NDArray[Any]:
        """Rows not older than ticks, as they came."""
        n = len(self._rows)
        rows = self._rows[: self._count] if self._count <= n else np.roll(self._rows, -(self._count % n))
        return rows[rows["ticks"] >= ticks]


class Words:
    """Numbers for names that repeat, at most 8192 of them."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._words: list[str] = []

    def number(self, word: str) -> int:
        """Number of a word; -1 beyond the bound."""
        k = self._numbers.get(word, -1)
        if k < 0 and len(self._words) < MOST_WORDS:
            k = self._numbers[word] = len(self._words)
            self._words.append(word)
        return k

    def word(self, k: int) -> str:
        """Word of a number, "?" beyond the bound."""
        return self._words[k] if k >= 0 else "?"


class RecentPast:
    """Events of the last hour, in bounded memory."""

    def __init__(self) -> None:
        self._shots, self._postures = Ring(MOST_SHOTS, SHOT_ROW), Ring(MOST_POSTURES, POSTURE_ROW)
        self._words = Words()
        self._posture_ticks = 0
        self._last_ticks = 0
        self.events: deque[Object] = deque(maxlen=MOST_EVENTS)
        self.epochs: deque[Object] = deque(maxlen=MOST_EPOCHS)
        self.readings: deque[Object] = deque(maxlen=MOST_READINGS)

    def shot(self, shot: Object, ticks: int) -> None:
        """Add a shot; the oldest makes place."""
        names = (self._words.number(shot[key]) for key in ("ranger", "target", "status"))
        values = (np.nan if shot[key] is None else shot[key] for key in ("range", "u_range", "misfit"))
        self._shots.add(shot["number"] or 0, ticks, *names, *values)
        self._last_ticks = max(self._last_ticks, ticks)

    def posture(self, posture: Object, ticks: int) -> None:
        """Add a posture, one a second."""
        self._last_ticks = max(self._last_ticks, ticks)
        if ticks - self._posture_ticks >= POSTURE_EVERY or ticks < self._posture_ticks:
            self._posture_ticks = ticks
            values = (np.nan if posture[key] is None else posture[key] for key in list(posture)[1:])
            self._postures.add(ticks, *values)

    @property
    def since(self) -> int:
        """Ticks from when on it is remembered."""
        return max(0, self._last_ticks - HOUR_TICKS)

    def shots(self, since_ticks: int = 0) -> Iterator[Object]:
        """Shots since then, oldest first."""
        for row in self._shots.since(max(since_ticks, self.since)).tolist():
            count, ticks, ranger, target, status, range_, u_range, misfit = row
            yield {
                "number": count,
                "mjd": ticks / TICKS_PER_DAY,
                "ranger": self._words.word(ranger),
                "target": self._words.word(target),
                "status": self._words.word(status),
                "range": number(range_),
                "u_range": number(u_range),
                "misfit": number(misfit),
            }

    def postures(self) -> Iterable[tuple[float, ...]]:
        """MJD, azimuth, elevation and their rates, one a second."""
        for ticks, *values in self._postures.since(self.since).tolist():
            yield ticks / TICKS_PER_DAY, *values
