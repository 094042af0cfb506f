"""The site's feed of weather and posture, or a motion script.

The feed sends unsolicited ZY lines:

    0<TAB>TS<TAB>WX 1, station, temperature_c, pressure_hpa, humidity_percent      none if a sensor value is missing
    0<TAB>TS<TAB>TEL 1, azimuth_deg, elevation_deg, azimuth_rate_deg_s, elevation_rate_deg_s

An observatory with its own weather and position sends these two lines.
"""

import asyncio
import csv
import io
import math
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, Environment, Tell, ticks_now
from catseye.errors import InputError
from catseye.ranger.client import ZyClient
from catseye.ranger.line import Reply
from catseye.records.night.live import TICKS_PER_DAY, LivePosture, LiveWeather

REAL = re.compile(r"[+-]?[0-9]{1,9}(\.[0-9]{0,20})?([eE][+-]?[0-9]{1,2})?")
STATION = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")
LOOK = 0.5  # s between two checks for silence
START_UP = 30.0  # s before a telescope without any posture counts as silent: its feed may start later
HELD_UP = 1.5  # s between two checks, above which the loop itself was late: pending input is read first
SKEW = 5.0  # s, limit of a reading's stamp from now
MOST_STATIONS = 64
WEATHER_LIMITS = ((-90.0, 90.0), (300.0, 1200.0), (0.0, 110.0))  # deg C, hPa, %: valid range
COLUMNS = ("mjd", "azimuth_deg", "elevation_deg")


@dataclass(frozen=True)
class FeedSettings:
    """Times in s: allowed silence, and back-off of reconnection."""

    weather_silent: float = 60.0
    telescope_silent: float = 2.0
    first_wait: float = 0.2
    longest_wait: float = 30.0
    growth: float = 1.33
    connect_timeout: float = 3.0


class FeedClient:
    """Client of a feed.

    weather, posture   called with each reading, in order of arrival
    stations           expected stations; those of the feed are added
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        environment: Environment,
        tell: Tell,
        weather: Callable[[LiveWeather], None],
        posture: Callable[[LivePosture], None],
        stations: tuple[str, ...] = (),
        settings: FeedSettings | None = None,
    ):
        self.host, self.port, self._settings = host, port, settings or FeedSettings()
        clock = environment.clock
        self._clock, self._weather, self._posture = clock, weather, posture
        self._tell, self._event_log = tell, EventLog("feed", clock, tell)
        self._rng = random.Random(f"{environment.seed} feed")
        self._network, self._key = environment.network, environment.key
        self._stations = {name: EventLog(name, clock, tell) for name in stations}
        self._telescope = EventLog("telescope", clock, tell)
        self._heard: dict[str, float] = {}  # loop time of the last good line, by station; "" is the telescope
        self._stamps: dict[str, int] = {}
        self._began: float | None = None
        self._looked: float | None = None

    @property
    def telescope_known(self) -> bool:
        """True if the posture is recent."""
        last_s = self._heard.get("")
        return last_s is not None and asyncio.get_running_loop().time() - last_s <= self._settings.telescope_silent

    async def run(self) -> None:
        """Connect, receive, reconnect; until cancelled."""
        self._began = asyncio.get_running_loop().time()
        looking = asyncio.ensure_future(self._look())
        try:
            wait = self._settings.first_wait
            while True:
                client = None
                try:
                    async with asyncio.timeout(self._settings.connect_timeout):
                        client = await ZyClient.connect(
                            self.host,
                            self.port,
                            heard=self.hear,
                            clock=asyncio.get_running_loop().time,
                            network=self._network,
                            key=self._key,
                            peer="feed",
                        )
                except InputError as problem:
                    why = str(problem)
                except TimeoutError:
                    why = f"{self.host} port {self.port} does not answer"
                if client is not None:
                    self._event_log.standing("feed-lost", None, over="the site's feed is connected")
                    why, wait = await self._listen(client), self._settings.first_wait
                self._event_log.standing("feed-lost", f"{why}; reconnecting", "warning")
                await asyncio.sleep(wait * self._rng.uniform(0.8, 1.2))
                wait = min(self._settings.growth * wait, self._settings.longest_wait)
        finally:
            looking.cancel()

    async def _listen(self, client: ZyClient) -> str:
        """Receive until the connection is over; give up a silent one."""
        patience = max(self._settings.weather_silent, self._settings.telescope_silent)
        try:
            while not client.closed.done():
                await asyncio.wait([client.closed], timeout=self._settings.weather_silent)
                client.check()
                last = max(self._heard.values(), default=self._began or 0.0)
                if asyncio.get_running_loop().time() - last > 2.0 * patience and not client.closed.done():
                    return f"no reading received for {2.0 * patience:g} s"
            return client.closed.result()
        finally:
            client.close()

    async def _look(self) -> None:
        """Check for silence repeatedly."""
        while True:
            await asyncio.sleep(LOOK)
            self.look()

    def look(self) -> None:
        """Log stations and telescope that fall silent or return."""
        time_s, limit = asyncio.get_running_loop().time(), self._settings.telescope_silent
        start_s = time_s if self._began is None else self._began
        silent = time_s - self._heard.get("", start_s)
        held_up, self._looked = time_s - (self._looked or time_s) > HELD_UP, time_s
        missed = silent > (limit if "" in self._heard else START_UP)
        text = f"no posture for {limit:g} s: tracking stops, fixed targets continue" if missed else None
        if not held_up:
            self._telescope.standing(
                "telescope-silent", text, "alarm", over="the telescope's posture is received again"
            )
        limit = self._settings.weather_silent
        for name, event_log in self._stations.items():
            silent = time_s - self._heard.get(name, start_s)
            text = f"{name}: no reading for {limit:g} s (check the station and its line)" if silent > limit else None
            event_log.standing("weather-silent", text, over=f"{name} is received again")

    def hear(self, reply: Reply) -> None:
        """Process a line of the feed; log and ignore invalid ones."""
        try:
            if reply.command == "WX":
                self._take_weather(weather_of(reply))
            elif reply.command == "TEL":
                self._take_posture(posture_of(reply))
        except InputError as problem:
            self._event_log.tell("bad-reading", str(problem), "warning", about=reply.command)

    def _take_weather(self, read: LiveWeather) -> None:
        if not self._fresh(read.station, read.ticks):
            return
        if read.station not in self._stations:
            if len(self._stations) >= MOST_STATIONS:
                raise InputError(f"WX: too many stations with {read.station} (expected at most {MOST_STATIONS})")
            self._stations[read.station] = EventLog(read.station, self._clock, self._tell)
        if not math.isnan(read.temperature_c + read.pressure_hpa + read.humidity_percent):
            self._heard[read.station] = asyncio.get_running_loop().time()
        self._weather(read)

    def _take_posture(self, read: LivePosture) -> None:
        if self._fresh("", read.ticks):
            self._heard[""] = asyncio.get_running_loop().time()
            self._posture(read)

    def _fresh(self, who: str, ticks: int) -> bool:
        """True for a stamp later than the last and near now."""
        skew = (ticks - ticks_now(self._clock)) / TICKS_PER_SECOND
        text = f"{who or 'the telescope'}'s stamps are {skew:+.1f} s from now (limit {SKEW:g} s); rejected"
        self._event_log.standing(f"feed-clock-{who or 'telescope'}", text if abs(skew) > SKEW else None)
        if abs(skew) > SKEW or ticks <= self._stamps.get(who, -1):
            return False
        self._stamps[who] = ticks
        return True


def weather_of(reply: Reply) -> LiveWeather:
    """Reading of a WX line.

    Raises InputError: another form, or an impossible reading.
    """
    values = _values(reply, 4)
    if not STATION.fullmatch(values[0]):
        raise InputError(f"WX: station {values[0][:20]!a} is not a name")
    read = []
    for text, (low, high), what in zip(values[1:], WEATHER_LIMITS, ("deg C", "hPa", "%"), strict=True):
        value = math.nan if text.lower() == "none" else _real(text, "WX")
        if not (math.isnan(value) or low <= value <= high):
            raise InputError(f"WX: {values[0]}: {text} {what} is outside {low:g} to {high:g}")
        read.append(value)
    return LiveWeather(values[0], int(reply.ticks or 0), *read)


def posture_of(reply: Reply) -> LivePosture:
    """Posture of a TEL line.

    Raises InputError: another form, or impossible angles.
    """
    angles = [_real(text, "TEL") for text in _values(reply, 4)]
    for angle, (low, high) in zip(angles, ((-360.0, 720.0), (-90.0, 180.0), (-10.0, 10.0), (-10.0, 10.0)), strict=True):
        if not low <= angle <= high:
            raise InputError(f"TEL: {angle:g} deg is outside {low:g} to {high:g}")
    return LivePosture(int(reply.ticks or 0), *(angle * DEGREE for angle in angles))


class MotionScript:
    """A motion given beforehand, instead of a feed.

    mjd                  (n,) days, rising; n = 1 for a fixed posture
    azimuth, elevation   (n,) rad, linear between; constant beyond the ends
    """

    def __init__(self, mjd: NDArray[np.float64], azimuth: NDArray[np.float64], elevation: NDArray[np.float64]):
        self.mjd, self.azimuth, self.elevation = mjd, azimuth, elevation

    @staticmethod
    def parse(text: str) -> "MotionScript":
        """Motion from `fixed AZ EL` in degrees, or a table's path.

        The table has the columns mjd,azimuth_deg,elevation_deg.

        Raises InputError with the problem and the expected form.

        >>> MotionScript.parse("fixed 145.3 30").at(5288900000000).elevation
        0.5235987755982988
        """
        words = text.split()
        if len(words) == 3 and words[0] == "fixed":
            angles = np.array([[_real(word, f"motion {text!a}")] for word in words[1:]]) * DEGREE
            return MotionScript(np.zeros(1), *angles)
        try:
            table = Path(text).read_text("utf-8")
        except (OSError, ValueError) as problem:
            raise InputError(f"motion {text!a} is not a readable file (expected one, or fixed AZ EL)") from problem
        return MotionScript.of_table(table, text)

    @staticmethod
    def of_table(table: str, name: str) -> "MotionScript":
        """Motion from a table's text.

        Raises InputError with its line.
        """
        rows = list(csv.reader(io.StringIO(table)))
        if not rows or tuple(word.strip() for word in rows[0]) != COLUMNS:
            raise InputError(f"{name} line 1: expected {','.join(COLUMNS)}")
        values: list[list[float]] = []
        for number, row in enumerate(rows[1:], 2):
            if len(row) != 3:
                raise InputError(f"{name} line {number}: {len(row)} values (expected {','.join(COLUMNS)})")
            values.append([_real(word.strip(), f"{name} line {number}") for word in row])
            if len(values) > 1 and values[-1][0] <= values[-2][0]:
                raise InputError(f"{name} line {number}: mjd {row[0]} is not later than the line before")
        if not values:
            raise InputError(f"{name} contains no motion (expected at least one line)")
        mjd, azimuth, elevation = np.array(values).T
        return MotionScript(mjd, azimuth * DEGREE, elevation * DEGREE)

    def at(self, ticks: int) -> LivePosture:
        """Angles and rates at a time."""
        day = ticks / TICKS_PER_DAY
        k = int(np.searchsorted(self.mjd, day, side="right"))
        angles = [float(np.interp(day, self.mjd, column)) for column in (self.azimuth, self.elevation)]
        if not 0 < k < len(self.mjd):
            return LivePosture(ticks, *angles)
        span = (self.mjd[k] - self.mjd[k - 1]) * SECONDS_PER_DAY
        rates = [float(column[k] - column[k - 1]) / float(span) for column in (self.azimuth, self.elevation)]
        return LivePosture(ticks, *angles, *rates)


async def play(
    script: MotionScript, clock: Clock, posture: Callable[[LivePosture], None], *, period: float = 0.1
) -> None:
    """Emit a script's postures at 10 Hz, until cancelled."""
    while True:
        posture(script.at(ticks_now(clock)))
        await asyncio.sleep(period)


def _values(reply: Reply, count: int) -> tuple[str, ...]:
    if reply.ok is not True or len(reply.values) != count or reply.ticks is None:
        raise InputError(f"{reply.command} {reply.text[:60]!a} (expected {count} values and a stamp)")
    return reply.values


def _real(text: str, what: str) -> float:
    if not REAL.fullmatch(text):
        raise InputError(f"{what}: {text[:20]!a} is not a number")
    return float(text)
