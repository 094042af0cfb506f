"""Samplers: the last values of each kind, with times, in bounded rings.

M&C's archivist reads them.
"""

from collections import deque
from collections.abc import Iterable

from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.ranger.line import stamp_text
from catseye.records.night.live import Happening, LivePosture, LiveWeather

RING_LENGTH = 4096  # values of each sampler
Row = tuple[str, ...]  # a stamp, then values as sent
COLUMNS = {
    "RANGES": ("number", "ranger", "target", "status", "range_m", "u_range_m", "misfit_m"),
    "EPOCHS": ("epoch", "points", "shots", "rejected", "variance_factor", "degrees_of_freedom", "refractivity_ppm"),
    "POINTS": ("epoch", "point", "x_m", "y_m", "z_m"),
    "POSTURE": ("azimuth_rad", "elevation_rad", "azimuth_rate_rad_s", "elevation_rate_rad_s"),
    "WEATHER": ("station", "temperature_c", "pressure_hpa", "humidity_percent"),
    "EVENTS": ("severity", "who", "kind", "text"),
}


class Samplers:
    """Rings by name, with the columns of `COLUMNS`."""

    def __init__(self, length: int = RING_LENGTH):
        self._rings: dict[str, deque[Row]] = {name: deque(maxlen=length) for name in COLUMNS}

    def add(self, entry: Entry) -> list[tuple[str, Row]]:
        """Store the rows of an entry; the rows by sampler."""
        rows = list(rows_of(entry))
        for name, row in rows:
            self._rings[name].append(row)
        return rows

    def last(self, name: str, count: int) -> list[Row]:
        """Last rows of a sampler, oldest first."""
        ring = self._rings[name]
        return [ring[k] for k in range(max(0, len(ring) - count), len(ring))]

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
    """Rows of an epoch's answer; missing values are `none`."""
    answer, stamp = entry.answer, _stamp(entry.ticks)
    names, places = answer.get("names") or [], answer.get("x") or []
    epoch = _number(answer.get("number"))
    lists = (answer.get("names"), answer.get("used"), answer.get("rejected"))
    counted = ["none" if values is None else _number(len(values)) for values in lists]
    statistics = [_number(answer.get(key)) for key in COLUMNS["EPOCHS"][4:]]
    yield "EPOCHS", (stamp, epoch, *counted, *statistics)
    for name, place in zip(names, places, strict=False):
        yield "POINTS", (stamp, epoch, plain(str(name)), *(_number(v) for v in place))


def plain(text: str) -> str:
    """Text as a value of a line: printable ASCII without a comma."""
    return "".join(c if " " <= c <= "~" else "?" for c in text.replace(",", ";"))[:300].strip(" ")


def _number(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value or abs(value) == float("inf"):
        return "none"
    return repr(value)


def _stamp(ticks: int) -> str:
    return stamp_text(ticks)
