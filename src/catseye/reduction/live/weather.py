"""Recent weather readings, without thermometers that contradict the others."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.allowance import STEEPEST_DOWN, STEEPEST_UP
from catseye.reduction.site.plausible.readings import LEAST_READINGS, TEMPERATURE, stuck
from catseye.reduction.site.plausible.weather import humidity_doubt, pressure_doubt

HISTORY = 7200.0  # s, of readings kept
SILENT = 1800.0  # s after its last reading, when a station is no longer used
JUMP_C = 1.5  # air changes by up to 0.5 °C in a minute
RECENT = 300.0  # s, of the median that a reading is compared with
FEWEST = 3  # readings for a level
ALONE = 600.0  # s, after which a single station is accepted again: nothing contradicts it
UNSEEN_C_PER_S = 0.002  # 7 °C an hour without readings, or without another station
SEEN_C_PER_S = 0.001  # 3.6 °C an hour, drift of the air at one station from that at another
APART_C = 1.5  # chosen: two thermometers of 0.3 °C each at 2.5 sigma, and air across a site
BACK = 0.7  # share of APART_C within which a station agrees again
UNDONE = 0.5  # share of a bias that a step must remove to end it
RETURNED = 3  # readings in a row
MOST_STRETCHES = 64  # of a station


@dataclass(frozen=True)
class BiasedPeriod:
    """A period in which a station's readings are biased.

    station       its name
    first, last   ticks, inclusive; last None: ongoing
    offset_c      °C by which they are too high; NaN if unknown
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
    elevation: float | None = None  # above the sea; None where no record gives it
    last: LiveWeather | None = None  # accepted or not: its own change can still be compared
    good: deque[LiveWeather] = field(default_factory=deque)
    level_since: int | None = None  # of the first reading at this level
    doubted_since: int | None = None
    doubt: str = ""
    first_doubt: str = ""  # in words, at `doubted_since`
    odd: bool = False  # rejected for its level, not for a jump
    passed: bool = False  # its level was compared with others' and agreed
    witnesses: dict[str, float] = field(default_factory=dict)  # others' °C when it was first rejected
    bias: tuple[float, bool] = (math.nan, False)  # °C too high as an epoch suspects, and True if from the ranges
    waiting: list[LiveWeather] = field(default_factory=list)  # readings that look like the end of a bias
    stuck_since: int | None = None  # ticks of the first repeated reading of a sensor that is stuck
    stretches: deque[BiasedPeriod] = field(default_factory=lambda: deque(maxlen=MOST_STRETCHES))


class StationWatch:
    """Weather readings by arrival, and suspicions about their stations.

    names     of the stations
    heights   station: m; if missing, levels are compared as at one height
    """

    def __init__(self, names: tuple[str, ...], heights: Mapping[str, float] | None = None):
        known = heights or {}
        self._stations = {name: _Station(name, known.get(name, 0.0), known.get(name)) for name in names}
        self._moved: set[str] = set()

    @staticmethod
    def of(site: SiteFolder) -> "StationWatch":
        """Watch over a site's stations."""
        stations = site.site.weather_station
        return StationWatch(tuple(s.name for s in stations), {s.name: s.elevation_m for s in stations})

    def add(self, read: LiveWeather) -> str:
        """Add one reading; return the reason for rejection, else "".

        Rejected: a missing or impossible value, a time before the last, a temperature that has left the station's own
        median of five minutes by 1.5 °C more than the other stations have left theirs, one that contradicts all of
        two or more others which agree with each other, and one that repeats the last for longer than the series' own
        scatter allows. A step that removes the offset suspected by an epoch ends the
        bias: from the third such reading on the station is accepted, and its readings before are not.
        """
        station = self._stations.get(read.station)
        if station is None:
            return f"unknown station {read.station} (site.toml has {', '.join(self._stations)})"
        values = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
        if not all(math.isfinite(v) for v in values):
            return f"{read.station}: a sensor value is missing"
        if not (-60 <= values[0] <= 60 and 500 <= values[1] <= 1100 and 0 <= values[2] <= 100):
            return f"{read.station}: {values[0]:g} C, {values[1]:g} hPa, {values[2]:g} % out of range"
        if station.good and read.ticks <= station.good[-1].ticks:
            return f"{read.station}: reading older than the last one"
        before, station.last = station.last, read
        if self._undoes(read, before, station):
            station.waiting.append(read)
            if len(station.waiting) >= RETURNED:
                self._return(station)
                return ""
        else:
            station.waiting.clear()
        station.doubt = self._stuck(read, station) or self._jump(read, station) or self._odd(read, station)
        if station.doubt:
            self._disbelieve(read, station)
            return station.doubt
        self._believe(read, station)
        return ""

    def forget_after(self, ticks: int) -> None:
        """Discard everything stamped later, since the clock was set back."""
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
                station.stuck_since = None
                station.witnesses.clear()
            periods = [s for s in station.stretches if s.first <= ticks]
            station.stretches = deque(
                (replace(s, last=min(s.last, ticks)) if s.last is not None else s for s in periods),
                maxlen=MOST_STRETCHES,
            )

    def judged(self, suspicions: Mapping[str, tuple[float, bool]]) -> None:
        """Store an epoch's suspicions about stations.

        suspicions   station: °C by which it reads too high, and True if from the ranges

        A rejected station was not in the epoch: its earlier suspicion stays.
        """
        for name, station in self._stations.items():
            if station.doubted_since is None and not station.waiting:
                station.bias = suspicions.get(name, (math.nan, False))

    def moved(self) -> frozenset[str]:
        """Stations at a new level (new offset) since the last call."""
        moved, self._moved = frozenset(self._moved), set()
        return moved

    def stretches(self) -> tuple[BiasedPeriod, ...]:
        """Biased periods, ongoing ones included, by readings or ranges."""
        periods: list[BiasedPeriod] = []
        for name, station in self._stations.items():
            periods += station.stretches
            offset, by_ranges = station.bias
            if by_ranges and station.level_since is not None:
                why = f"{name}'s thermometer is biased by {offset:+.1f} °C according to the ranges"
                periods.append(BiasedPeriod(name, station.level_since, None, offset, why))
            if station.doubted_since is not None:
                periods.append(BiasedPeriod(name, station.doubted_since, None, math.nan, station.first_doubt))
        return tuple(periods)

    def doubting(self, name: str) -> bool:
        """True while a station's readings are rejected."""
        return name in self._stations and self._stations[name].doubted_since is not None

    def trusted_readings(self, ticks: int) -> list[LiveWeather]:
        """Readings of accepted stations heard recently, by station and time."""
        readings: list[LiveWeather] = []
        for station in self._stations.values():
            fresh = station.good and _seconds(ticks - station.good[-1].ticks) <= SILENT
            if fresh and station.doubted_since is None:
                readings += station.good
        if readings:
            return readings
        return [read for station in self._stations.values() for read in station.good]  # old readings rather than none

    def notes(self) -> tuple[str, ...]:
        """Problems of stations now, in words."""
        jumped = [s.doubt for s in self._stations.values() if s.doubted_since is not None]
        levels = [f"{s.name}'s {text}" for s in self._stations.values() if s.good for text in _implausible_levels(s)]
        return (*jumped, *levels)

    # Inside ----------------------------------------------------------------------------------------------------------

    def _disbelieve(self, read: LiveWeather, station: _Station) -> None:
        if station.doubted_since is None:
            station.doubted_since, station.first_doubt = read.ticks, station.doubt
            station.witnesses = {s.name: m for s in self._other_stations(station) if not math.isnan(m := _median(s))}
        if station.odd and not station.passed and station.good:  # since its first reading
            station.doubted_since = station.good[0].ticks
            station.good.clear()
        since = station.stuck_since
        while since is not None and station.good and station.good[-1].ticks >= since:
            station.doubted_since = station.good.pop().ticks

    def _believe(self, read: LiveWeather, station: _Station) -> None:
        if station.doubted_since is not None:
            self._over(read, station)
        if station.level_since is None:
            station.level_since = read.ticks
        station.good.append(read)
        while _seconds(read.ticks - station.good[0].ticks) > HISTORY:
            station.good.popleft()

    def _over(self, read: LiveWeather, station: _Station) -> None:
        """End a rejection; a changed level gets a new offset."""
        since, level = station.doubted_since or read.ticks, _median(station)
        station.stretches.append(BiasedPeriod(station.name, since, read.ticks - 1, math.nan, station.first_doubt))
        step = read.temperature_c - level - self._common_change(read, station)
        if station.odd or (not math.isnan(step) and abs(step) > JUMP_C):
            station.good.clear()
            self._at_a_new_level(station, read.ticks)
        station.doubted_since, station.odd = None, False
        station.witnesses.clear()

    def _return(self, station: _Station) -> None:
        """End a bias: earlier readings are rejected, new ones accepted."""
        offset, first = station.bias[0], station.waiting[0]
        if station.level_since is not None and station.good:
            less = "less" if offset > 0.0 else "more"
            why = (
                f"{station.name} reads about {abs(offset):.1f} °C {less} after one step, as the other stations and "
                f"the ranges predict: its thermometer was biased by {offset:+.1f} °C until then"
            )
            station.stretches.append(BiasedPeriod(station.name, station.level_since, first.ticks - 1, offset, why))
        station.good = deque(station.waiting)
        station.waiting = []
        station.doubted_since, station.doubt, station.odd = None, "", False
        station.stuck_since = None
        station.witnesses.clear()
        self._at_a_new_level(station, first.ticks)

    def _at_a_new_level(self, station: _Station, ticks: int) -> None:
        station.level_since, station.bias, station.passed = ticks, (math.nan, False), False
        self._moved.add(station.name)

    def _undoes(self, read: LiveWeather, before: LiveWeather | None, station: _Station) -> bool:
        """True if a reading removed the suspected bias at once."""
        level, offset = _median(station), station.bias[0]
        if math.isnan(level) or math.isnan(offset) or before is None:
            return False
        step = read.temperature_c - level - self._common_change(read, station)
        if abs(step + offset) > UNDONE * abs(offset):
            return False
        return bool(station.waiting) or abs(read.temperature_c - before.temperature_c) > UNDONE * abs(offset)

    def _stuck(self, read: LiveWeather, station: _Station) -> str:
        """Reason if the sensor repeats itself for too long, else ""."""
        if not station.good or station.good[-1].temperature_c != read.temperature_c:
            station.stuck_since = None
            return ""
        if station.stuck_since is None:
            readings = [*station.good, read]
            if any(r.temperature_c != read.temperature_c for r in readings[-LEAST_READINGS:]):
                return ""
            seconds = np.array([_seconds(r.ticks - readings[0].ticks) for r in readings])
            runs = stuck(seconds, np.array([r.temperature_c for r in readings]), TEMPERATURE)
            if not runs or runs[-1].last != len(readings) - 1:
                return ""
            station.stuck_since = readings[runs[-1].first + 1].ticks
        minutes = _seconds(read.ticks - station.stuck_since) / 60.0
        return (
            f"{read.station} has read {read.temperature_c:.2f} C for {minutes:.0f} min, longer than its own scatter "
            "allows: its sensor is stuck, rejected"
        )

    def _jump(self, read: LiveWeather, station: _Station) -> str:
        level = _median(station)
        if math.isnan(level):
            return ""
        change, common = read.temperature_c - level, self._common_change(read, station)
        confirmed = self._confirmed(read, station)
        if not confirmed and station.doubted_since and _seconds(read.ticks - station.doubted_since) > ALONE:
            station.odd = True  # no station to compare with: the air has changed, and its level is new
            return ""
        since = _seconds(read.ticks - station.good[-1].ticks)
        allowed = JUMP_C + (SEEN_C_PER_S if station.witnesses else UNSEEN_C_PER_S) * since
        if min(abs(change), abs(change - common)) <= allowed:  # a steady station is not rejected for others' jumps
            return ""
        return (
            f"{read.station} reads {read.temperature_c:.1f} C, {change:+.1f} C from its last five minutes while the "
            f"others changed by {common:+.1f} C (allowed {allowed:.1f}): rejected"
        )

    def _odd(self, read: LiveWeather, station: _Station) -> str:
        """Reason if two or more agreeing stations contradict a level, else ""."""
        levels = {
            s.name: m
            for s in self._other_stations(station)
            if s.doubted_since is None and not math.isnan(m := _median(s))
        }
        if len(levels) < 2:
            return ""
        spare = APART_C * (BACK if station.odd and station.doubted_since is not None else 1.0)
        stations = [self._stations[name] for name in levels]
        agree = all(
            _excess(levels[a.name] - levels[b.name], a.height - b.height, APART_C) == 0.0
            for i, a in enumerate(stations)
            for b in stations[:i]
        )
        off = [_excess(read.temperature_c - levels[s.name], station.height - s.height, spare) for s in stations]
        if not agree or not (all(v > 0.0 for v in off) or all(v < 0.0 for v in off)):
            station.passed = station.passed or agree
            return ""
        station.odd = True
        nearest = min(off, key=abs)
        return (
            f"{read.station} reads {read.temperature_c:.1f} C, {nearest:+.1f} C beyond any plausible gradient to "
            f"{' and '.join(sorted(levels))}, which agree with each other: rejected"
        )

    def _other_stations(self, station: _Station) -> list[_Station]:
        return [s for s in self._stations.values() if s is not station]

    def _confirmed(self, read: LiveWeather, station: _Station) -> bool:
        """True if another station observed the change of the air."""
        return any(_change(s, read.ticks) is not None for s in self._other_stations(station))

    def _common_change(self, read: LiveWeather, station: _Station) -> float:
        """Change of the others, °C, in five minutes or since rejection."""
        since = [
            s.last.temperature_c - station.witnesses[s.name]
            for s in self._other_stations(station)
            if s.name in station.witnesses and s.last is not None and _change(s, read.ticks) is not None
        ]
        lately = [c for s in self._other_stations(station) if (c := _change(s, read.ticks)) is not None]
        changes = since or lately
        return float(np.median(changes)) if changes else 0.0


def _implausible_levels(station: _Station) -> list[str]:
    """Doubts on the pressure and humidity of a station's recent readings."""
    doubts = [("hygrometer", humidity_doubt(np.array([read.humidity_percent for read in station.good])))]
    if station.elevation is not None:
        pressure = float(np.median([read.pressure_hpa for read in station.good]))
        doubts.append(("barometer", pressure_doubt(pressure, station.elevation)))
    return [f"{instrument} {text}" for instrument, text in doubts if text]


def _excess(difference: float, rise: float, spare: float) -> float:
    """Difference of two levels beyond the plausible, °C; 0 if none.

    Plausible is what thermometers (`spare`) and the air over a rise (m) explain.
    """
    low, high = sorted((STEEPEST_DOWN * rise, STEEPEST_UP * rise))
    return float(max(difference - high - spare, 0.0) + min(difference - low + spare, 0.0))


def _change(station: _Station, ticks: int) -> float | None:
    """Change against its own five minutes, °C.

    None for a station that cannot be used for comparison: not heard recently, or without a level.
    """
    if station.last is None or _seconds(ticks - station.last.ticks) > RECENT:
        return None
    median = _median(station)
    return None if math.isnan(median) else station.last.temperature_c - median


def _median(station: _Station) -> float:
    """Median of recent good readings, °C; NaN below three."""
    recent = [w.temperature_c for w in station.good if _seconds(station.good[-1].ticks - w.ticks) <= RECENT]
    return float(np.median(recent)) if len(recent) >= FEWEST else math.nan


def _seconds(ticks: int) -> float:
    return ticks / TICKS_PER_DAY * SECONDS_PER_DAY
