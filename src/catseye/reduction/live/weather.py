"""Weather as it comes in: kept for a while, and a thermometer that contradicts the others is not believed."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.allowance import STEEPEST_DOWN, STEEPEST_UP

KEPT = 7200.0  # s
SILENT = 1800.0  # s after its last reading, when a station counts no more
JUMP_C = 1.5  # air changes by up to 0.5 °C in a minute
RECENT = 300.0  # s, whose median a reading is held against
FEWEST = 3  # readings that make a level
ALONE = 600.0  # s, after which a single station is believed again: nobody says otherwise
UNSEEN_C_PER_S = 0.002  # 7 °C an hour while nothing came, or nobody could tell
SEEN_C_PER_S = 0.001  # 3.6 °C an hour by which the air at one station leaves that at another
APART_C = 1.5  # chosen: two thermometers of 0.3 °C each at 2.5 sigma, and air across a site
BACK = 0.7  # share of that within which a station agrees again
UNDONE = 0.5  # share of a bias that a step takes away, when it ends it
RETURNED = 3  # readings in a row
MOST_STRETCHES = 64  # of a station


@dataclass(frozen=True)
class Stretch:
    """Readings of a station that do not say what the air was.

    station       its name
    first, last   ticks, both in it; last None: it goes on
    offset_c      °C by which they are too high; NaN where nobody says
    why           in words
    """

    station: str
    first: int
    last: int | None
    offset_c: float
    why: str


@dataclass
class _Station:
    name: str
    height: float
    last: LiveWeather | None = None  # believed or not: a witness's own change is a witness
    good: deque[LiveWeather] = field(default_factory=deque)
    level_since: int | None = None  # of the first reading at this level
    doubted_since: int | None = None
    doubt: str = ""
    first_doubt: str = ""  # in words, of `doubted_since`
    odd: bool = False  # doubted by its level, not by a jump
    passed: bool = False  # its level was held against others' and agreed
    witnesses: dict[str, float] = field(default_factory=dict)  # others' °C when it was doubted first
    bias: tuple[float, bool] = (math.nan, False)  # °C too high as an epoch suspects, and whether the ranges say so
    waiting: list[LiveWeather] = field(default_factory=list)  # readings that look like the end of a bias
    stretches: deque[Stretch] = field(default_factory=lambda: deque(maxlen=MOST_STRETCHES))


class StationWatch:
    """Readings of all stations, in the order in which they came, and what epochs suspect of them.

    names     of the stations
    heights   station: m; without it levels are compared as if all stood at one height
    """

    def __init__(self, names: tuple[str, ...], heights: Mapping[str, float] | None = None):
        self._stations = {name: _Station(name, (heights or {}).get(name, 0.0)) for name in names}
        self._moved: set[str] = set()

    @staticmethod
    def of(site: SiteFolder) -> "StationWatch":
        """The watch over a site's stations."""
        stations = site.site.weather_station
        return StationWatch(tuple(s.name for s in stations), {s.name: s.elevation_m for s in stations})

    def add(self, read: LiveWeather) -> str:
        """One reading; why it is not believed, "" where it is.

        Not believed: a value that is missing or impossible, a time before the last, a temperature that has left the
        station's own median of five minutes by 1.5 °C more than the other stations have left theirs, and one that all
        of two or more others contradict which agree with each other. A step that takes away what an epoch suspects of
        a station is the end of its bias: from the third such reading on it is believed, and what it said before is not.
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
        before, station.last = station.last, read
        if self._undoes(read, before, station):
            station.waiting.append(read)
            if len(station.waiting) >= RETURNED:
                self._return(station)
                return ""
        else:
            station.waiting.clear()
        station.doubt = self._jump(read, station) or self._odd(read, station)
        if station.doubt:
            self._disbelieve(read, station)
            return station.doubt
        self._believe(read, station)
        return ""

    def forget_after(self, ticks: int) -> None:
        """Forget what was stamped later: the clock was set back."""
        for station in self._stations.values():
            while station.good and station.good[-1].ticks > ticks:
                station.good.pop()
            station.waiting = [read for read in station.waiting if read.ticks <= ticks]
            if station.last is not None and station.last.ticks > ticks:
                station.last = None
            if station.level_since is not None and station.level_since > ticks:
                station.level_since = None
            if station.doubted_since is not None and station.doubted_since > ticks:
                station.doubted_since, station.doubt, station.odd = None, "", False
                station.witnesses.clear()
            kept = [s for s in station.stretches if s.first <= ticks]
            station.stretches = deque(
                (replace(s, last=min(s.last, ticks)) if s.last is not None else s for s in kept), maxlen=MOST_STRETCHES
            )

    def judged(self, suspected: Mapping[str, tuple[float, bool]]) -> None:
        """Take in an epoch's suspicions: station, °C by which it reads too high, whether the ranges say so.

        A station that is not believed was not in the epoch: what was suspected of it before stays.
        """
        for name, station in self._stations.items():
            if station.doubted_since is None and not station.waiting:
                station.bias = suspected.get(name, (math.nan, False))

    def moved(self) -> frozenset[str]:
        """Stations that have begun to read at another level since this was asked last: their offsets are new."""
        moved, self._moved = frozenset(self._moved), set()
        return moved

    def stretches(self) -> tuple[Stretch, ...]:
        """All stretches that are not believed, those that last included: by doubt of readings, and by the ranges."""
        found: list[Stretch] = []
        for name, station in self._stations.items():
            found += station.stretches
            offset, by_ranges = station.bias
            if by_ranges and station.level_since is not None:
                why = f"{name}'s thermometer is biased by {offset:+.1f} °C, by the ranges"
                found.append(Stretch(name, station.level_since, None, offset, why))
            if station.doubted_since is not None:
                found.append(Stretch(name, station.doubted_since, None, math.nan, station.first_doubt))
        return tuple(found)

    def doubting(self, name: str) -> bool:
        """True while a station is not believed."""
        return name in self._stations and self._stations[name].doubted_since is not None

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

    # Inside ----------------------------------------------------------------------------------------------------------

    def _disbelieve(self, read: LiveWeather, station: _Station) -> None:
        if station.doubted_since is None:
            station.doubted_since, station.first_doubt = read.ticks, station.doubt
            station.witnesses = {s.name: m for s in self._others(station) if not math.isnan(m := _median(s))}
        if station.odd and not station.passed and station.good:  # it has been so since its first reading
            station.doubted_since = station.good[0].ticks
            station.good.clear()

    def _believe(self, read: LiveWeather, station: _Station) -> None:
        if station.doubted_since is not None:
            self._over(read, station)
        if station.level_since is None:
            station.level_since = read.ticks
        station.good.append(read)
        while _seconds(read.ticks - station.good[0].ticks) > KEPT:
            station.good.popleft()

    def _over(self, read: LiveWeather, station: _Station) -> None:
        """A doubt has ended: the station is where it was, or believed at another level."""
        since, own = station.doubted_since or read.ticks, _median(station)
        station.stretches.append(Stretch(station.name, since, read.ticks - 1, math.nan, station.first_doubt))
        left = read.temperature_c - own - self._by_others(read, station)
        if station.odd or (not math.isnan(left) and abs(left) > JUMP_C):
            station.good.clear()
            self._at_a_new_level(station, read.ticks)
        station.doubted_since, station.odd = None, False
        station.witnesses.clear()

    def _return(self, station: _Station) -> None:
        """Its bias has ended: what it said until then is not believed, what it says now is."""
        offset, first = station.bias[0], station.waiting[0]
        if station.level_since is not None and station.good:
            less = "less" if offset > 0.0 else "more"
            why = (
                f"{station.name} reads some {abs(offset):.1f} °C {less} than before in one step, as the others and "
                f"the ranges expect: its thermometer was biased by {offset:+.1f} °C until then"
            )
            station.stretches.append(Stretch(station.name, station.level_since, first.ticks - 1, offset, why))
        station.good = deque(station.waiting)
        station.waiting = []
        station.doubted_since, station.doubt, station.odd = None, "", False
        station.witnesses.clear()
        self._at_a_new_level(station, first.ticks)

    def _at_a_new_level(self, station: _Station, ticks: int) -> None:
        station.level_since, station.bias, station.passed = ticks, (math.nan, False), False
        self._moved.add(station.name)

    def _undoes(self, read: LiveWeather, before: LiveWeather | None, station: _Station) -> bool:
        """True where a reading has left the suspected bias in one step."""
        own, offset = _median(station), station.bias[0]
        if math.isnan(own) or math.isnan(offset) or before is None:
            return False
        left = read.temperature_c - own - self._by_others(read, station)
        if abs(left + offset) > UNDONE * abs(offset):
            return False
        return bool(station.waiting) or abs(read.temperature_c - before.temperature_c) > UNDONE * abs(offset)

    def _jump(self, read: LiveWeather, station: _Station) -> str:
        own = _median(station)
        if math.isnan(own):
            return ""
        left, by_others = read.temperature_c - own, self._by_others(read, station)
        seen = self._seen(read, station)
        if not seen and station.doubted_since and _seconds(read.ticks - station.doubted_since) > ALONE:
            station.odd = True  # nobody to ask: the air has changed, and its level is new
            return ""
        since = _seconds(read.ticks - station.good[-1].ticks)
        allowed = JUMP_C + (SEEN_C_PER_S if station.witnesses else UNSEEN_C_PER_S) * since
        if min(abs(left), abs(left - by_others)) <= allowed:  # a station that stays is not doubted for others' jumps
            return ""
        return (
            f"{read.station} reads {read.temperature_c:.1f} C, {left:+.1f} C off its last five minutes while the "
            f"others changed by {by_others:+.1f} C (allowed {allowed:.1f}): not believed"
        )

    def _odd(self, read: LiveWeather, station: _Station) -> str:
        """Why a station's level cannot be, where all of two or more others contradict it that agree with each other."""
        levels = {
            s.name: m for s in self._others(station) if s.doubted_since is None and not math.isnan(m := _median(s))
        }
        if len(levels) < 2:
            return ""
        spare = APART_C * (BACK if station.odd and station.doubted_since is not None else 1.0)
        others = [self._stations[name] for name in levels]
        agree = all(
            _beyond(levels[a.name] - levels[b.name], a.height - b.height, APART_C) == 0.0
            for i, a in enumerate(others)
            for b in others[:i]
        )
        off = [_beyond(read.temperature_c - levels[s.name], station.height - s.height, spare) for s in others]
        if not agree or not (all(v > 0.0 for v in off) or all(v < 0.0 for v in off)):
            station.passed = station.passed or agree
            return ""
        station.odd = True
        nearest = min(off, key=abs)
        return (
            f"{read.station} reads {read.temperature_c:.1f} C, {nearest:+.1f} C beyond what air can be between it and "
            f"{' and '.join(sorted(levels))}, which agree with each other: not believed"
        )

    def _others(self, station: _Station) -> list[_Station]:
        return [s for s in self._stations.values() if s is not station]

    def _seen(self, read: LiveWeather, station: _Station) -> bool:
        """True where another station has seen how the air changed."""
        return any(_change(s, read.ticks) is not None for s in self._others(station))

    def _by_others(self, read: LiveWeather, station: _Station) -> float:
        """°C by which the other stations have changed: in five minutes, or since the station was doubted first."""
        since = [
            s.last.temperature_c - station.witnesses[s.name]
            for s in self._others(station)
            if s.name in station.witnesses and s.last is not None and _change(s, read.ticks) is not None
        ]
        lately = [c for s in self._others(station) if (c := _change(s, read.ticks)) is not None]
        changes = since or lately
        return float(np.median(changes)) if changes else 0.0


def _beyond(difference: float, rise: float, spare: float) -> float:
    """°C by which two levels differ more than thermometers and the air over a rise (m) explain; 0 where they do not."""
    low, high = sorted((STEEPEST_DOWN * rise, STEEPEST_UP * rise))
    return float(max(difference - high - spare, 0.0) + min(difference - low + spare, 0.0))


def _change(station: _Station, ticks: int) -> float | None:
    """°C, of a station that has spoken lately against its own five minutes; None of one that is no witness."""
    if station.last is None or _seconds(ticks - station.last.ticks) > RECENT:
        return None
    median = _median(station)
    return None if math.isnan(median) else station.last.temperature_c - median


def _median(station: _Station) -> float:
    """°C, of the last good readings; NaN of fewer than three."""
    recent = [w.temperature_c for w in station.good if _seconds(station.good[-1].ticks - w.ticks) <= RECENT]
    return float(np.median(recent)) if len(recent) >= FEWEST else math.nan


def _seconds(ticks: int) -> float:
    return ticks / TICKS_PER_DAY * SECONDS_PER_DAY
