"""Samplers: the last values of each kind, with times, in bounded rings.

M&C's archivist reads them.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.coordinator.condition import verdict_of
from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.pose_rows import Row, number_word, pose_rows
from catseye.ranger.line import stamp_text
from catseye.records.night.live import Happening, LivePosture, LiveWeather

RING_LENGTH = 4096  # values of each sampler
MOVED = "actuator-moved"  # kind of the event of another actuator's move
PARAMETERS_ACTIVE = "parameters-active"  # kind of the event behind which a started set is in force
Listener = Callable[[str, "Row | EpochPoint"], None]  # a sampler, and its new row


class Samplers:
    """Rings by name, with the columns of `COLUMNS`.

    A point's row becomes text when somebody asks for it: an epoch may have thousands.
    """

    def __init__(self, length: int = RING_LENGTH):
        self._rings: dict[str, deque[Row | EpochPoint]] = {name: deque(maxlen=length) for name in COLUMNS}
        self.listeners: list[Listener] = []

    def add(self, entry: Entry) -> list[tuple[str, Row]]:
        """Store the rows of an entry; the rows by sampler, without points."""
        rows = list(rows_of(entry))
        for name, row in rows:
            self.put(name, row)
        if isinstance(entry, EpochSolution):
            for point in points_of(entry):
                self.put("POINTS", point)
        return rows

    def put(self, name: str, row: "Row | EpochPoint") -> None:
        """Store a row, and tell it to listeners."""
        self._rings[name].append(row)
        for listener in self.listeners:
            listener(name, row)

    def last(self, name: str, count: int) -> list[Row]:
        """Last rows of a sampler, oldest first."""
        ring = self._rings[name]
        rows = (ring[k] for k in range(max(0, len(ring) - count), len(ring)))
        return [row.row() if isinstance(row, EpochPoint) else row for row in rows]

    def lengths(self) -> dict[str, int]:
        """Number of values in each sampler."""
        return {name: len(ring) for name, ring in self._rings.items()}


def rows_of(entry: Entry) -> Iterable[tuple[str, Row]]:
    """Rows of a journal entry, by sampler."""
    if isinstance(entry, AnsweredShot):
        shot = entry.shot
        values = (number_word(v) for v in (entry.range_, entry.u_range, entry.misfit))
        yield "RANGES", (_stamp(shot.ticks), str(shot.number), shot.ranger, shot.target, plain(entry.status), *values)
    elif isinstance(entry, LivePosture):
        values = (number_word(v) for v in (entry.azimuth, entry.elevation, entry.azimuth_rate, entry.elevation_rate))
        yield "POSTURE", (_stamp(entry.ticks), *values)
    elif isinstance(entry, LiveWeather):
        values = (number_word(v) for v in (entry.temperature_c, entry.pressure_hpa, entry.humidity_percent))
        yield "WEATHER", (_stamp(entry.ticks), plain(entry.station), *values)
    elif isinstance(entry, Happening) and entry.kind == MOVED:
        yield "MOVES", (_stamp(entry.ticks), *(plain(str(entry.details.get(key, "none"))) for key in COLUMNS["MOVES"]))
        yield from _of_event(entry)
    elif isinstance(entry, Happening) and entry.severity != "debug":
        yield from _of_event(entry)
    elif isinstance(entry, EpochSolution):
        yield from _of_solution(entry)
        yield from pose_rows(entry)


def _of_event(entry: Happening) -> Iterable[tuple[str, Row]]:
    words = (entry.severity, plain(entry.who), plain(entry.kind), plain(entry.text))
    yield "EVENTS", (_stamp(entry.ticks), *words)


def _of_solution(entry: EpochSolution) -> Iterable[tuple[str, Row]]:
    """Row of an epoch's answer; missing values are `none`."""
    answer, stamp = entry.answer, _stamp(entry.ticks)
    lists = (answer.get("names"), answer.get("used"), answer.get("rejected"))
    counts = ["none" if values is None else number_word(len(values)) for values in lists]
    statistics = [number_word(answer.get(key)) for key in COLUMNS["EPOCHS"][4:7]]
    posture = [number_word(answer.get(key)) for key in ("azimuth", "elevation")]
    verdict = verdict_of(entry).word
    yield "EPOCHS", (stamp, number_word(answer.get("number")), *counts, *statistics, *posture, verdict)


@dataclass(frozen=True, slots=True, eq=False)
class EpochPoints:
    """Points of one solution.

    stamp, number   of the epoch, as sent
    names           n of them
    values          (n, 9): place, m, and its covariance's upper triangle, m^2
    used            number of shots used at each
    """

    stamp: str
    number: str
    names: tuple[str, ...]
    values: NDArray[np.float64]
    used: tuple[int | None, ...]


@dataclass(frozen=True, slots=True, eq=False)
class EpochPoint:
    """One point of a solution, by its row there."""

    points: EpochPoints
    at: int

    def row(self) -> Row:
        """Values of the sampler POINTS."""
        epoch, k = self.points, self.at
        values = (number_word(v) for v in epoch.values[k].tolist())
        return epoch.stamp, epoch.number, plain(epoch.names[k]), *values, number_word(epoch.used[k])


def points_of(entry: EpochSolution) -> Iterable[EpochPoint]:
    """Points of a solution, for the sampler."""
    names = tuple(map(str, entry.answer.get("names") or ()))
    places = np.array(entry.answer.get("x") or np.empty((0, 3)), dtype=float)
    count = min(len(names), len(places))
    if not count:
        return
    values = np.full((count, 9), np.nan)
    values[:, :3] = places[:count]
    values[:, 3:] = triangles_of(entry.covariance, count)
    counts: Sequence[int | None] = entry.answer.get("shots") or ()
    used = (*counts[:count], *([None] * (count - len(counts))))
    points = EpochPoints(_stamp(entry.ticks), number_word(entry.answer.get("number")), names[:count], values, used)
    yield from (EpochPoint(points, k) for k in range(count))


def triangles_of(covariance: NDArray[np.float64] | None, count: int) -> NDArray[np.float64]:
    """Covariance (n, 6) of each point by itself: xx, xy, xz, yy, yz, zz.

    covariance   (3n, 3n) of all; None or another size: unknown, NaN
    """
    if covariance is None or covariance.shape != (3 * count, 3 * count):
        return np.full((count, 6), np.nan)
    row = 3 * np.arange(count)
    return np.stack([covariance[row + i, row + j] for i in range(3) for j in range(i, 3)], axis=1)


def plain(text: str) -> str:
    """Text as a value of a line: printable ASCII without a comma.

    >>> plain("WX2, +2.5 °C")
    'WX2; +2.5 degC'
    """
    text = text.replace(",", ";").replace("°C", "degC").replace("°", " deg")
    return "".join(c if " " <= c <= "~" else "?" for c in text)[:300].strip(" ")


def _stamp(ticks: int) -> str:
    return stamp_text(ticks)
