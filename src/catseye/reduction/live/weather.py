"""Weather as it comes in: kept for a while, and a station that jumps away from the others is not believed."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather

KEPT = 7200.0  # s
SILENT = 1800.0  # s after its last reading, when a station counts no more
JUMP_C = 1.5  # air changes by up to 0.5 °C in a minute
RECENT = 300.0  # s, whose median a reading is held against
ALONE = 600.0  # s, after which a single station is believed again: nobody says otherwise


@dataclass
class _Station:
    last: LiveWeather | None = None  # believed or not: a witness's own change is a witness
    good: deque[LiveWeather] = field(default_factory=deque)
    doubted_since: int | None = None
    doubt: str = ""


class StationWatch:
    """Readings of all stations, in the order in which they came."""

    def __init__(self, names: tuple[str, ...]):
        self._stations = {name: _Station() for name in names}

    def add(self, read: LiveWeather) -> str:
        """One reading; why it is not believed, "" where it is.

        Not believed: a value that is missing or impossible, a time before the last, a temperature that has left the
        station's own median of five minutes by 1.5 °C more than the other stations have left theirs.
        """
        station = self._stations.get(read.station)
        if station is None:
            return f"station {read.station} is not in site.toml (expected one of {', '.join(self._stations)})"
        said = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
        if not all(math.isfinite(v) for v in said):
            return f"{read.station}: a sensor says nothing"
        if not (-60 <= said[0] <= 60 and 500 <= said[1] <= 1100 and 0 <= said[2] <= 100):
            return f"{read.station}: {said[0]:g} C, {said[1]:g} hPa, {said[2]:g} % cannot be"
        if station.good and read.ticks <= station.good[-1].ticks:
            return f"{read.station}: a reading of an earlier time came late"
        station.doubt = self._jump(read, station)
        station.last = read
        if station.doubt:
            station.doubted_since = station.doubted_since or read.ticks
            return station.doubt
        station.doubted_since = None
        station.good.append(read)
        while _seconds(read.ticks - station.good[0].ticks) > KEPT:
            station.good.popleft()
        return ""

    def forget_after(self, ticks: int) -> None:
        """Forget what was stamped later: the clock was set back."""
        for station in self._stations.values():
            while station.good and station.good[-1].ticks > ticks:
                station.good.pop()
            if station.last is not None and station.last.ticks > ticks:
                station.last = None
            if station.doubted_since is not None and station.doubted_since > ticks:
                station.doubted_since, station.doubt = None, ""

    def believed(self, ticks: int) -> list[LiveWeather]:
        """Readings of the stations that speak and are believed, in order of station and time."""
        readings: list[LiveWeather] = []
        for station in self._stations.values():
            fresh = station.good and _seconds(ticks - station.good[-1].ticks) <= SILENT
            if fresh and station.doubted_since is None:
                readings += station.good
        if readings:
            return readings
        return [read for station in self._stations.values() for read in station.good]  # better old than none

    def notes(self) -> tuple[str, ...]:
        """What is wrong with stations now."""
        jumped = [s.doubt for s in self._stations.values() if s.doubted_since is not None]
        humid = [
            f"{name}: {text}"
            for name, s in self._stations.items()
            for text in humidity_doubts([read.humidity_percent for read in s.good])
        ]
        return (*jumped, *humid)

    def _jump(self, read: LiveWeather, station: _Station) -> str:
        own = _median(station)
        if math.isnan(own):
            return ""
        left = read.temperature_c - own
        changes = [_change(s, read.ticks) for s in self._stations.values() if s is not station]
        went = [change for change in changes if change is not None]
        if not went and station.doubted_since and _seconds(read.ticks - station.doubted_since) > ALONE:
            station.good.clear()  # nobody to ask: the air has changed
            return ""
        by_others = float(np.median(went)) if went else 0.0
        since = _seconds(read.ticks - station.good[-1].ticks)
        allowed = JUMP_C + 0.002 * since  # °C, and 7 °C an hour while nothing came or nothing was believed
        if min(abs(left), abs(left - by_others)) <= allowed:  # a station that stays is not doubted for others' jumps
            return ""
        return (
            f"{read.station} reads {read.temperature_c:.1f} C, {left:+.1f} C off its last five minutes while the "
            f"others changed by {by_others:+.1f} C (allowed {allowed:.1f}): not believed"
        )


def _change(station: _Station, ticks: int) -> float | None:
    """°C, of a station that has spoken lately against its own five minutes; None of one that is no witness."""
    if station.last is None or _seconds(ticks - station.last.ticks) > RECENT:
        return None
    median = _median(station)
    return None if math.isnan(median) else station.last.temperature_c - median


def _median(station: _Station) -> float:
    """°C, of the last good readings; NaN of fewer than three."""
    recent = [w.temperature_c for w in station.good if _seconds(station.good[-1].ticks - w.ticks) <= RECENT]
    return float(np.median(recent)) if len(recent) >= 3 else math.nan


def _seconds(ticks: int) -> float:
    return ticks / TICKS_PER_DAY * SECONDS_PER_DAY
