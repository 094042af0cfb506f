"""Client of a coordinator's port: subscribes, polls, reconnects for ever."""

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from catseye.clock import Clock
from catseye.coordinator.condition import SIGNS
from catseye.coordinator.parts import ticks_now
from catseye.coordinator.samplers.rings import RING_LENGTH
from catseye.errors import InputError
from catseye.ranger.client import ZyClient
from catseye.ranger.line import Reply, parse_stamp
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import EPOCH, EVENT, POSTURE, SHOT, WEATHER, Object, keyed, mjd_of, number
from catseye.service.watch.recent import RecentPast

POLL = 1.0  # s between two polls
PATIENCE = 1.5  # s until an unanswered poll counts as silence
GIVE_UP = 10.0  # s of silence after which the connection is made anew
FIRST_RETRY, LONGEST_RETRY = 0.25, 3.0  # s between two attempts
CONNECTING = 5.0  # s
BACKLOG = {"EPOCHS": 360, "EVENTS": 500, "WEATHER": 360, "RANGES": RING_LENGTH}  # rows fetched at first
SUBSCRIBED = ("SHOT", "EPOCH", "EVENT", "POSTURE", "WEATHER")
STATIONS = 64  # at most
LOG = logging.getLogger(__name__)
Listener = Callable[[str, Object], None]
UNKNOWN_STATE: Object = {
    "mjd": None,
    "received": None,
    "source": "live",
    "connected": False,
    "trouble": "not connected yet",
    "word": None,
    "mode": None,
    "round": None,
    "shots": {"numbered": None, "acknowledged": None},
    "telescope": None,
    "clock": None,
    "disk": None,
    "journal": None,
    "lease": None,
    "problems": [],
    "verdict": None,
    "verdict_text": None,
    "epoch": None,
    "posture": None,
    "weather": [],
    "sun": None,
    "rangers": [],
}


class Silent(Exception):
    """No answer in time, or a lost connection."""


class SitePort:
    """State of a site from its coordinator's port.

    rangers   names that are listed before the first answer
    network   connections; None: sockets
    key       of the site; None: none
    tell      called on the loop with kind and object of all that comes
    """

    def __init__(
        self,
        address: tuple[str, int],
        *,
        rangers: tuple[str, ...],
        clock: Clock,
        tell: Listener,
        network: ConnectionMaker | None = None,
        key: str | None = None,
    ):
        self.address, self._clock, self._network, self._key, self._tell = address, clock, network, key, tell
        self._state = UNKNOWN_STATE | {"rangers": [_unknown_ranger(name) for name in rangers]}
        self.past = RecentPast()
        self.points: Object | None = None  # of the last epoch
        self._client: ZyClient | None = None
        self._last: dict[str, Object] = {}  # each ranger's last shot
        self._weather: dict[str, Object] = {}
        self._posture: Object | None = None
        self._wanted_points = asyncio.Event()
        self._heard_ticks = 0
        self._is_silent = True
        self.keeps_points = False

    @property
    def connected(self) -> bool:
        """True while the coordinator answers."""
        return not self._is_silent

    @property
    def client(self) -> ZyClient:
        """Connection to the coordinator.

        Raises InputError without one.
        """
        if self._client is None or self._client.closed.done() or self._is_silent:
            raise InputError(f"the site is not connected: {self._state['trouble']}")
        return self._client

    def state(self) -> Object:
        """State as of the last answers."""
        return self._state

    # Running ---------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Keep a connection, and poll, until cancelled."""
        ticking = asyncio.ensure_future(self._tick())
        retry = FIRST_RETRY
        try:
            while True:
                try:
                    await self._session()
                except (InputError, OSError, Silent) as problem:
                    if self._heard_ticks:
                        retry, self._heard_ticks = FIRST_RETRY, 0
                    self._silent(str(problem))
                await asyncio.sleep(retry)
                retry = min(LONGEST_RETRY, 1.5 * retry)
        finally:
            ticking.cancel()
            await asyncio.gather(ticking, return_exceptions=True)
            if self._client is not None:
                self._client.close()

    async def _tick(self) -> None:
        """Tell the state once a second, also while nothing answers."""
        while True:
            self._tell("state", self._state)
            await asyncio.sleep(POLL)

    async def _session(self) -> None:
        host, port = self.address
        try:
            async with asyncio.timeout(CONNECTING):
                client = await ZyClient.connect(
                    host,
                    port,
                    heard=self._heard,
                    clock=asyncio.get_running_loop().time,
                    network=self._network,
                    key=self._key,
                    peer="coordinator",
                )
        except TimeoutError:
            raise Silent(f"no coordinator answers at {host} port {port} within {CONNECTING:g} s") from None
        self._client = client
        try:
            await self._backlog(client)
            points = asyncio.ensure_future(self._fetch_points(client))
            try:
                await self._polls(client)
            finally:
                points.cancel()
                await asyncio.gather(points, return_exceptions=True)
        finally:
            client.close()

    async def _backlog(self, client: ZyClient) -> None:
        """Subscribe, then fetch what was before."""
        await self._asked(client, "SUBSCRIBE", " ".join(SUBSCRIBED))
        self.past = RecentPast()
        for name, count in BACKLOG.items():
            for reply in await self._all(client, "SAMPLER", name, count):
                if reply.ok and len(reply.values) > 2:
                    self._take(_pushed(name, reply), new=False)
        self._wanted_points.set()

    async def answers(self, command: str, *parameters: object) -> list[Reply]:
        """All replies to a question.

        Raises InputError: refused, or not answered.
        """
        try:
            replies = await self._all(self.client, command, *parameters)
        except Silent as problem:
            raise InputError(str(problem)) from problem
        refused = next((reply for reply in replies if reply.ok is False), None)
        if refused is not None:
            raise InputError(refused.text or f"{command} was refused without a reason")
        return replies

    async def _polls(self, client: ZyClient) -> None:
        loop = asyncio.get_running_loop()
        answered = loop.time()
        while not client.closed.done():
            began = loop.time()
            try:
                await self._poll(client)
                answered = loop.time()
            except Silent as problem:
                self._silent(str(problem))
                if client.closed.done() or loop.time() - answered > GIVE_UP:
                    raise
            client.check()
            await asyncio.sleep(max(0.05, POLL - (loop.time() - began)))
        raise Silent(client.closed.result())

    async def _poll(self, client: ZyClient) -> None:
        status = await self._asked(client, "STATUS")
        rangers = await self._all(client, "RANGERS")
        plan = await self._all(client, "PLAN")
        alarms = await self._all(client, "ALARMS")
        sun = await self._asked(client, "SUN")
        if status.ok is not True or len(status.values) < 12:
            raise Silent(f"STATUS is answered {status.text[:80]!r}")
        try:
            self._state = self._assembled(status, rangers, plan, alarms, sun)
        except (ValueError, IndexError, OverflowError, InputError) as problem:
            raise Silent(f"the coordinator's answers cannot be read: {problem}") from problem
        self._heard_ticks = ticks_now(self._clock)
        if self._is_silent:
            self._is_silent = False
            LOG.info("connected to the coordinator at %s port %d", *self.address)

    async def _asked(self, client: ZyClient, command: str, *parameters: object) -> Reply:
        try:
            async with asyncio.timeout(PATIENCE):
                return await client.ask(command, *parameters)
        except TimeoutError:
            raise Silent(f"no answer to {command} within {PATIENCE:g} s") from None

    async def _all(self, client: ZyClient, command: str, *parameters: object) -> list[Reply]:
        """All replies to a command, perhaps none: a VER behind it marks their end."""
        limit = PATIENCE if command != "SAMPLER" else GIVE_UP
        replies: list[Reply] = []
        tid, _ = client.request(command, *parameters, then=replies.append)
        try:
            async with asyncio.timeout(limit):
                await client.ask("VER")
        except TimeoutError:
            raise Silent(f"no answer to {command} within {limit:g} s") from None
        finally:
            client.forget(tid)
        return replies

    def _silent(self, why: str) -> None:
        if not self._is_silent:
            LOG.warning("the coordinator at %s port %d is lost: %s", *self.address, why)
        self._is_silent = True
        self._state = self._state | {"connected": False, "trouble": why}

    async def _fetch_points(self, client: ZyClient) -> None:
        """Fetch the points of each epoch, where nobody else has them."""
        while self.keeps_points:
            await self._wanted_points.wait()
            self._wanted_points.clear()
            epoch = next(reversed(self.past.epochs), None)
            if epoch is None or not epoch["points"]:
                continue
            with suppress(Silent):
                replies = await self._all(client, "SAMPLER", "POINTS", min(RING_LENGTH, epoch["points"]))
                rows = [r.values for r in replies if r.ok and len(r.values) >= 13]
                own = [row for row in rows if row[2] == rows[-1][2]]
                self.points = _points_of(own) if own else None

    # What comes ------------------------------------------------------------------------------------------------------

    def _heard(self, reply: Reply) -> None:
        if reply.ok is True and reply.command in SUBSCRIBED and reply.ticks is not None:
            self._take((reply.command, reply.ticks, reply.values), new=True)

    def _take(self, pushed: tuple[str, int, tuple[str, ...]], *, new: bool) -> None:
        """Remember what came, and tell it."""
        kind, ticks, values = pushed
        try:
            item = _READERS[kind](mjd_of(ticks), values)
        except (ValueError, IndexError, OverflowError):
            LOG.warning("a line of the coordinator cannot be read: %s %s", kind, ", ".join(values)[:200])
            return
        if kind == "SHOT":
            self._last[item["ranger"]] = item
            self.past.shot(item, ticks)
        elif kind == "EPOCH":
            if item["number"] is None:
                return  # not solved; an event says so
            self.past.epochs.append(item)
            self._wanted_points.set()
        elif kind == "EVENT":
            self.past.events.append(item)
        elif kind == "POSTURE":
            self._posture = item
            self.past.posture(item, ticks)
        else:
            if len(self._weather) < STATIONS:
                self._weather[item["station"]] = item
            self.past.readings.append(item)
        if new:
            self._tell(kind.lower(), item)

    def _assembled(
        self, status: Reply, rangers: list[Reply], plan: list[Reply], alarms: list[Reply], sun: Reply
    ) -> Object:
        """State of all replies of a poll."""
        v = status.values
        epoch = next(reversed(self.past.epochs), None)
        word = v[8].partition(" ")[2] or None
        upcoming = {r.values[0]: r.values for r in reversed(plan) if r.ok and len(r.values) >= 3}
        problems = [_problem(r.values) for r in alarms if r.ok and len(r.values) >= 8]
        why = next((p["text"] for p in problems if p["id"] == "epoch"), None)
        return {
            "mjd": mjd_of(status.ticks),
            "received": mjd_of(ticks_now(self._clock)),
            "source": "live",
            "connected": True,
            "trouble": None,
            "word": v[7],
            "mode": v[0],
            "round": _whole(v[4]),
            "shots": {"numbered": _whole(v[2]), "acknowledged": _whole(v[3])},
            "telescope": v[5],
            "clock": v[9],
            "disk": v[10],
            "journal": v[6],
            "lease": None if v[11] == "nobody" else v[11],
            "problems": problems,
            "verdict": word,
            "verdict_text": why,
            "epoch": epoch,
            "posture": self._posture,
            "weather": list(self._weather.values()),
            "sun": _sun(sun),
            "rangers": [
                self._ranger(r.values, upcoming.get(r.values[0])) for r in rangers if r.ok and len(r.values) >= 7
            ],
        }

    def _ranger(self, row: tuple[str, ...], upcoming: tuple[str, ...] | None) -> Object:
        name, state, shots, failures, stream, _, trouble = row[:7]
        word = row[7] if len(row) > 7 else state
        last = self._last.get(name)
        return {
            "name": name,
            "mjd": None if last is None else last["mjd"],
            "state": state,
            "word": word,
            "sign": SIGNS.get(word, "?"),
            "trouble": None if trouble == "none" else trouble,
            "shots": _whole(shots),
            "failures": _whole(failures),
            "stream": None if stream == "none" else stream,
            "last": None if last is None else {key: last[key] for key in SHOT if key not in ("mjd", "ranger")},
            "next": None if upcoming is None else upcoming[2],
            "next_mjd": None if upcoming is None else mjd_of(parse_stamp(upcoming[1])),
        }


def _unknown_ranger(name: str) -> Object:
    """A ranger before the first answer."""
    words = dict.fromkeys(("mjd", "trouble", "shots", "failures", "stream", "last", "next", "next_mjd"))
    return {"name": name, "state": "unknown", "word": "unknown", "sign": "?", **words}


def _pushed(sampler: str, reply: Reply) -> tuple[str, int, tuple[str, ...]]:
    """Kind, ticks and values of a sampler's row, as if pushed."""
    kinds = {"RANGES": "SHOT", "EPOCHS": "EPOCH", "EVENTS": "EVENT", "WEATHER": "WEATHER"}
    return kinds[sampler], parse_stamp(reply.values[1]), reply.values[2:]


def _float(text: str) -> float | None:
    return None if text == "none" else number(float(text))


def _whole(text: str) -> int | None:
    return int(float(text)) if text != "none" else None


def _shot(mjd: float | None, v: tuple[str, ...]) -> Object:
    values = (_whole(v[0]), mjd, v[1], v[2], v[3], *(_float(text) for text in v[4:7]))
    return keyed(SHOT, values)


def _epoch(mjd: float | None, v: tuple[str, ...]) -> Object:
    posture = [_float(text) for text in v[7:9]] if len(v) > 8 else [None, None]
    verdict = v[9] if len(v) > 9 else None
    counts = (_whole(text) for text in v[1:4])
    values = (_whole(v[0]), mjd, *counts, *(_float(text) for text in v[4:7]), *posture, verdict)
    return keyed(EPOCH, values) | {"verdict_text": None}


def _event(mjd: float | None, v: tuple[str, ...]) -> Object:
    return keyed(EVENT, (mjd, *v[:4]))


def _posture(mjd: float | None, v: tuple[str, ...]) -> Object:
    return keyed(POSTURE, (mjd, *(_float(text) for text in v[:4])))


def _reading(mjd: float | None, v: tuple[str, ...]) -> Object:
    return keyed(WEATHER, (mjd, v[0], *(_float(text) for text in v[1:4])))


_READERS: dict[str, Callable[[float | None, tuple[str, ...]], Object]] = {
    "SHOT": _shot,
    "EPOCH": _epoch,
    "EVENT": _event,
    "POSTURE": _posture,
    "WEATHER": _reading,
}


def _problem(v: tuple[str, ...]) -> Object:
    """Problem of a row of ALARMS."""
    instants = [None if text == "none" else parse_stamp(text) / TICKS_PER_DAY for text in (v[2], v[4], v[6])]
    return {
        "id": v[0],
        "severity": v[1],
        "text": v[7],
        "since": instants[0],
        "acknowledged_by": None if v[3] == "none" else v[3],
        "acknowledged_at": instants[1],
        "shelved_by": None if v[5] == "none" else v[5],
        "shelved_until": instants[2],
    }


def _sun(reply: Reply) -> Object | None:
    if reply.ok is not True or len(reply.values) < 4:
        return None
    azimuth, elevation, cone = (_float(text) for text in reply.values[:3])
    return {"azimuth": azimuth, "elevation": elevation, "cone": cone, "avoided": reply.values[3] == "avoided"}


def _points_of(rows: list[tuple[str, ...]]) -> Object:
    """Points of one epoch from rows of the sampler POINTS: name, stamp, epoch, point, 9 numbers, shots."""
    table = [[_float(text) for text in row[4:13]] for row in rows]
    columns: dict[str, Any] = {"name": [row[3] for row in rows]}
    columns |= {axis: [row[k] for row in table] for k, axis in enumerate("xyz")}
    keys = ("xx", "xy", "xz", "yy", "yz", "zz")
    columns["covariance"] = {key: [row[3 + k] for row in table] for k, key in enumerate(keys)}
    columns["shots"] = [_whole(row[13]) if len(row) > 13 else None for row in rows]
    return {"number": _whole(rows[-1][2]), "points": columns}
