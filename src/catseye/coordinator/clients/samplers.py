"""Samplers: the last values of each kind, with times, in bounded rings.

M&C's archivist reads them.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.coordinator.condition import verdict_of
from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.ranger.line import stamp_text
from catseye.records.night.live import Happening, LivePosture, LiveWeather

RING_LENGTH = 4096  # values of each sampler
Row = tuple[str, ...]  # a stamp, then values as sent
COLUMNS = {
    "RANGES": ("number", "ranger", "target", "status", "range_m", "u_range_m", "misfit_m"),
    "EPOCHS": (
        *("epoch", "points", "shots", "rejected", "variance_factor", "degrees_of_freedom", "refractivity_ppm"),
        *("azimuth_rad", "elevation_rad", "verdict"),
    ),
    "POINTS": (
        *("epoch", "point", "x_m", "y_m", "z_m"),
        *("xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2", "used"),
    ),
    "POSTURE": ("azimuth_rad", "elevation_rad", "azimuth_rate_rad_s", "elevation_rate_rad_s"),
    "WEATHER": ("station", "temperature_c", "pressure_hpa", "humidity_percent"),
    "EVENTS": ("severity", "who", "kind", "text"),
}


class Samplers:
    """Rings by name, with the columns of `COLUMNS`.

    A point's row becomes text when somebody asks for it: an epoch may have thousands.
    """

    def __init__(self, length: int = RING_LENGTH):
        self._rings: dict[str, deque[Row | EpochPoint]] = {name: deque(maxlen=length) for name in COLUMNS}

    def add(self, entry: Entry) -> list[tuple[str, Row]]:
        """Store the rows of an entry; the rows by sampler, without points."""
        rows = list(rows_of(entry))
        for name, row in rows:
            self._rings[name].append(row)
        if isinstance(entry, EpochSolution):
            self._rings["POINTS"].extend(points_of(entry))
        return rows

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
        values = (_number(v) for v in (entry.range_, entry.u_range, entry.misfit))
        yield "RANGES", (_stamp(shot.ticks), str(shot.number), shot.ranger, shot.target, plain(entry.status), *values)
    elif isinstance(entry, LivePosture):
        values = (_number(v) for v in (entry.azimuth, entry.elevation, entry.azimuth_rate, entry.elevation_rate))
        yield "POSTURE", (_stamp(entry.ticks), *values)
    elif isinstance(entry, LiveWeather):
        values = (_number(v) for v in (entry.temperature_c, entry.pressure_hpa, entry.humidity_percent))
        yield "WEATHER", (_stamp(entry.ticks), plain(entry.station), *values)
    elif isinstance(entry, Happening) and entry.severity != "debug":
        yield "EVENTS", (_stamp(entry.ticks), entry.severity, plain(entry.who), plain(entry.kind), plain(entry.text))
    elif isinstance(entry, EpochSolution):
        yield from _of_solution(entry)


def _of_solution(entry: EpochSolution) -> Iterable[tuple[str, Row]]:
    """Row of an epoch's answer; missing values are `none`."""
    answer, stamp = entry.answer, _stamp(entry.ticks)
    lists = (answer.get("names"), answer.get("used"), answer.get("rejected"))
    counts = ["none" if values is None else _number(len(values)) for values in lists]
    statistics = [_number(answer.get(key)) for key in COLUMNS["EPOCHS"][4:7]]
    posture = [_number(answer.get(key)) for key in ("azimuth", "elevation")]
    verdict = verdict_of(entry).word
    yield "EPOCHS", (stamp, _number(answer.get("number")), *counts, *statistics, *posture, verdict)


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
        values = (_number(v) for v in epoch.values[k].tolist())
        return epoch.stamp, epoch.number, plain(epoch.names[k]), *values, _number(epoch.used[k])


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
    points = EpochPoints(_stamp(entry.ticks), _number(entry.answer.get("number")), names[:count], values, used)
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


def _number(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value or abs(value) == float("inf"):
        return "none"
    return repr(value)


def _stamp(ticks: int) -> str:
    return stamp_text(ticks)
