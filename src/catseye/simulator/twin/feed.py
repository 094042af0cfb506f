"""Site feed: weather readings and telescope posture in ZY lines.

    HELLO This is SITE gbt ver. 1 · CONNECT 1, port          the greeting, and then, unasked, TID 0, TS of the reading:
    WX 1, station, temperature_c, pressure_hpa, humidity_percent          `none` where the sensor is silent
    TEL 1, azimuth_deg, elevation_deg, azimuth_rate_deg_s, elevation_rate_deg_s

A silent station has no line. `bye` ends a connection, all other input is ignored.
"""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catseye.clock import Clock
from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.door import DEFAULT_ACCESS, Door, enable_keep_alive_probes, refuse_exposed_port
from catseye.ranger.entrance import Doorway, Entrance
from catseye.ranger.line import LONGEST_REQUEST, TICK_NS, Reply, format_reply, nanoseconds_to_ticks
from catseye.ranger.network import ConnectionMaker, Listener, Sockets
from catseye.records.night.live import LiveWeather
from catseye.simulator.twin.faults import FaultBoard

WEATHER_EVERY = 10.0  # s
POSTURES_A_SECOND = 10
MOST_CLIENTS = 32
MOST_UNSENT = 2**20  # bytes not taken by a client: an hour and a half of lines
MOST_LINES = 64  # lines of a client at once: the others are ignored
VERSION = "1"
WORDS = frozenset(["HLP", "HELP", "BYE", "KEY"])  # allowed beginnings of a client's first line
HELP = "WX and TEL lines come unasked; HLP or HELP says this; BYE closes the connection"
LOG = logging.getLogger(__name__)


class FeedWorld(Protocol):
    """Source of the feed's values; `Twin` is one."""

    faults: FaultBoard

    def seconds(self, ns: int, /) -> float:
        """Seconds since the start, of nanoseconds since MJD 0."""
        ...

    def posture(self, seconds: float, /) -> Sequence[NDArray[np.float64]]:
        """Azimuth, elevation, rad, and rates, rad/s, (1,) or numbers, from the encoders."""
        ...

    def weather(self, station: str, seconds: float, /) -> LiveWeather:
        """Reading of a station at an instant."""
        ...


class SiteFeed:
    """Server of the feed language, for many clients.

    name       of the site
    stations   of weather
    world      source of the values
    clock      UTC, the stamps of the readings
    """

    def __init__(
        self,
        name: str,
        stations: Sequence[str],
        world: FeedWorld,
        clock: Clock,
        *,
        weather_every: float = WEATHER_EVERY,
        network: ConnectionMaker | None = None,
        door: Door = DEFAULT_ACCESS,
    ):
        if weather_every <= 0.0:
            raise InputError(f"weather every {weather_every:g} s (expected more than 0)")
        self.name, self.stations, self.world, self.clock = name, tuple(stations), world, clock
        self._network: ConnectionMaker = network or Sockets(door.tls)
        self.door = door
        self.gate = Doorway(lambda: f"feed: port {self.port}", door, WORDS, _loop_time)
        self._weather_ns = round(weather_every * PER_SECOND)
        self._listener: Listener | None = None
        self.clients: set[FeedConnection] = set()
        self.port = 0

    async def start(self, host: str, port: int) -> None:
        """Listen. Raises InputError where the port is unavailable or unsafe.

        Unsafe: open to other hosts without a key.
        """
        refuse_exposed_port("feed", host, self.door)
        try:
            self._listener = await self._network.serve(self._joining, host, port)
        except OSError as problem:
            raise InputError(
                f"feed: {host} port {port} is not available: {problem.strerror or problem} (expected a free one)"
            ) from problem
        self.port = self._listener.port

    async def stop(self) -> None:
        """Close the connections and stop listening."""
        for client in tuple(self.clients):
            client.close()
        if self._listener is not None:
            listener, self._listener = self._listener, None
            await listener.close()

    async def serve(self) -> None:
        """Send every reading at its time, until cancelled; `start` first.

        Late readings are skipped.
        """
        step = PER_SECOND // POSTURES_A_SECOND
        next_weather = 0
        while True:
            instant = self.clock.now_ns()
            ticks = nanoseconds_to_ticks(instant)
            if instant >= next_weather:
                next_weather = instant - instant % self._weather_ns + self._weather_ns
                self._send(b"".join(self._weather(ticks)))
            self._send(self._posture(ticks))
            self.gate.check()
            self._close_idle()
            instant = self.clock.now_ns()
            await asyncio.sleep((step - instant % step) / PER_SECOND)

    def greeting(self) -> bytes:
        """Greeting of a new client: site name and present weather.

        The weather is read now, as clients ignore readings older than 5 s.
        """
        ticks = nanoseconds_to_ticks(self.clock.now_ns())
        hello = Reply("HELLO", None, (f"This is SITE {self.name} ver. {VERSION}",), 0, ticks)
        connected = Reply("CONNECT", True, (str(self.port),), 0, ticks)
        return b"".join([_line(hello), _line(connected), *self._weather(ticks)])

    def help_line(self, command: str) -> bytes:
        """Reply to HLP and HELP: unsolicited lines and commands."""
        ticks = nanoseconds_to_ticks(self.clock.now_ns())
        return _line(Reply(command, True, (HELP,), 0, ticks))

    def _joining(self) -> "FeedConnection":
        return FeedConnection(self)

    def _send(self, data: bytes) -> None:
        for client in tuple(self.clients):
            client.write(data)

    def _close_idle(self) -> None:
        """Close clients without a byte for long; they send an empty line each minute."""
        instant = _loop_time()
        for client in tuple(self.clients):
            if instant - client.heard > self.door.idle:
                client.say(Reply("LINE", False, (f"nothing was said for {self.door.idle:g} s",)))
                client.close()

    def _weather(self, ticks: int) -> list[bytes]:
        lines = []
        for station in self.stations:
            read = self.world.weather(station, self.world.seconds(ticks * TICK_NS))
            values = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
            if np.isfinite(values).any():
                texts = (
                    f"{v:.{digits}f}" if np.isfinite(v) else "none" for v, digits in zip(values, (3, 3, 2), strict=True)
                )
                lines.append(_line(Reply("WX", True, (station, *texts), 0, ticks)))
        return lines

    def _posture(self, ticks: int) -> bytes:
        """Posture at exactly the stamp's time."""
        seconds = self.world.seconds(ticks * TICK_NS)
        if self.world.faults.active("silent-telescope", "telescope", at=seconds) is not None:
            return b""
        angles = (np.asarray(v, dtype=float).item() / DEGREE for v in self.world.posture(seconds))
        return _line(Reply("TEL", True, tuple(f"{v:.9f}" for v in angles), 0, ticks))


class FeedConnection(asyncio.Protocol):
    """Connection of one client of the feed."""

    def __init__(self, feed: SiteFeed):
        self._feed = feed
        self._transport: asyncio.Transport | None = None
        self._entrance: Entrance | None = None
        self._unread = b""
        self.heard = _loop_time()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        enable_keep_alive_probes(transport)
        self._entrance = Entrance(self._feed.gate, transport, self.say)
        self._entrance.begin()
        if self._entrance.admitted:
            self._join()

    def _join(self) -> None:
        """Take a place among the clients, if one is free."""
        if len(self._feed.clients) >= MOST_CLIENTS:
            self.say(Reply("CONNECT", False, (f"{MOST_CLIENTS} clients are connected already (expected fewer)",)))
            self.close()
            return
        self._feed.clients.add(self)
        self.write(self._feed.greeting())

    def connection_lost(self, exc: Exception | None) -> None:
        if self._entrance is not None:
            self._entrance.over()
        self._feed.clients.discard(self)

    def data_received(self, data: bytes) -> None:
        if self._entrance is None or self._transport is None or self._transport.is_closing():
            return
        self.heard, was_in = _loop_time(), self._entrance.admitted
        more = self._entrance.take(data)
        if more is None:
            return
        if not was_in:
            self._join()
        *lines, remainder = (self._unread + more).split(b"\n")
        words = [line.strip().upper().decode("ascii", "replace") for line in lines[:MOST_LINES]]
        for word in words:
            if word in ("HLP", "HELP"):
                self.write(self._feed.help_line(word))
        if "BYE" in words:
            self.close()
        self._unread = remainder[-LONGEST_REQUEST:]

    def say(self, reply: Reply) -> None:
        """Send a reply, stamped with this instant."""
        self.write(_line(replace(reply, ticks=nanoseconds_to_ticks(self._feed.clock.now_ns()))))

    def write(self, data: bytes) -> None:
        """Send; a client that does not take it is disconnected."""
        if self._transport is None or self._transport.is_closing() or not data:
            return
        self._transport.write(data)
        if self._transport.get_write_buffer_size() > MOST_UNSENT:
            LOG.warning("feed: a client is disconnected: more than %d bytes not taken", MOST_UNSENT)
            self._transport.abort()

    def close(self) -> None:
        if self._transport is not None:
            self._transport.close()


def _line(reply: Reply) -> bytes:
    return format_reply(reply).encode("ascii") + b"\n"


def _loop_time() -> float:
    """Time of the running loop, s."""
    return asyncio.get_running_loop().time()
