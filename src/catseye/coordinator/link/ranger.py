"""A ranger's link: connect, make ready, supervise, shoot.

Nothing here raises for errors of a ranger or the network: they are logged as events, every wait has a timeout, and a
lost connection is retried with back-off: after 0.2 s, then a third longer each time, up to 30 s.
"""

import asyncio
import os
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.journal.entries import SentCommand
from catseye.coordinator.link.clock_watch import ClockWatch
from catseye.coordinator.link.handshake import Handshake, first_of
from catseye.coordinator.link.health import RangerHealth, asked_health
from catseye.coordinator.link.preparation import (
    PATIENCE,
    Preparation,
    Refused,
    counts_of,
    prepare,
    sampling_of,
    sampling_requests,
)
from catseye.coordinator.link.settings import Address, LinkSettings, Wanted
from catseye.coordinator.link.shooting import Shooter
from catseye.coordinator.link.status_watch import StatusWatch
from catseye.coordinator.link.wire import Sent
from catseye.coordinator.parts import Environment, PlannedShot, RequestGuard, Tell, ticks_now
from catseye.errors import CatseyeError, InputError
from catseye.ranger.client import SECOND_CLIENT_TID, ZyClient
from catseye.ranger.commands import COMMANDS
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import FIRST_CLIENT_TID, Reply, Request, format_request, stamp_text
from catseye.ranger.status import StatusWord
from catseye.records.night.live import LiveShot

State = Literal["down", "connected", "preparing", "ready"]
LONGEST_REPLY_TEXT = 200  # characters of a reply, in the journal
HEALTH_EVERY = 10.0  # s
LONGEST_PATIENCE = 60.0  # s between two attempts to make a ranger ready
HOLDER = f"ziy-{os.getpid() % 10**8}"  # name of this coordinator's lease; each coordinator has its own
LEASE_WITH_NUMBER, LEASE_WITH_TOKEN = 2, 4  # values: name, number of the connection, address, token
MOVERS = frozenset(["CIL", "TRK", "STT", "FHM", "RST", "CMEAS", "INI", "INITZY", "COO", "SCN"])


@dataclass(frozen=True)
class LinkListeners:
    """Callbacks of a link.

    tell         with events
    heard        with replies to another client (CMEAS ...)
    commanded    with each request sent that changes something, and its result
    health       with its health, every `HEALTH_EVERY` s
    """

    tell: Tell
    heard: Callable[["RangerLink", Reply], None] | None = None
    commanded: Callable[[SentCommand], None] | None = None
    health: Callable[[RangerHealth], None] | None = None


class RangerLink:
    """A ranger behind its two ports.

    ranger       name, as in its greeting
    preparation  initialisation: geometry and cubes, from the site's records
    wanted       "listen": only query and listen, on the second port; "hold": connected, nothing sent that changes it;
                 "measure": made ready, and `fire` works
    """

    def __init__(
        self,
        ranger: str,
        address: Address,
        *,
        preparation: Preparation,
        guard: RequestGuard,
        environment: Environment,
        listeners: LinkListeners,
        wanted: Wanted = "measure",
        settings: LinkSettings | None = None,
    ):
        clock = environment.clock
        self.ranger, self.address, self.wanted = ranger, address, wanted
        self.preparation = preparation
        self.told: set[int] = set()  # cubes sent on demand
        self.names = {number: name for name, number in self.preparation.numbers.items()}
        self.state: State = "down"
        self.sampling = SamplingSettings()
        self.wanted_sampling: SamplingSettings | None = None  # None: as the ranger has it
        self.counts: tuple[float, float] | None = None
        self.busy, self.shots, self.failures = False, 0, 0  # failures in a row
        self.round_trip = float("nan")
        self._guard, self._clock = guard, clock
        self._heard_by, self._commanded, self._health_to = listeners.heard, listeners.commanded, listeners.health
        self._health_at = 0.0
        self.settings = settings or LinkSettings()
        self._event_log = EventLog(ranger, clock, listeners.tell)
        self._shooter = Shooter(self, self._event_log, clock)
        self._status = StatusWatch(ranger, self._event_log, self._restarted)
        self.host_believed: Callable[[], bool] = lambda: True
        self._watch = ClockWatch(clock, self._event_log, self.settings.clock_limit, lambda: self.host_believed())
        self._rng = random.Random(f"{environment.seed} {ranger}")
        self._network, self._key = environment.network, environment.key
        self._client: ZyClient | None = None
        self._handshake = Handshake()
        self._doubt = asyncio.Event()
        self._probed_at = 0.0
        self._heard_at = 0.0
        self._was_ready, self._patience = False, self.settings.probe_every
        self._lit_here = self._left = self._dark = False
        self._token: str | None = None  # of the lease, while this coordinator holds it
        self._leaseless = False  # the ranger does not know LEASE: everybody may command it

    @property
    def connected(self) -> bool:
        """True if a connection is up, as far as known."""
        return self._client is not None and not self._client.closed.done()

    @property
    def status(self) -> StatusWord:
        """Its status word as last received."""
        return self._status.word

    @property
    def clock_offset(self) -> float:
        """Last offset of its clock from ours, s; NaN before."""
        return self._watch.offset

    @property
    def clock_error(self) -> float:
        """Bound of that offset by the round trip, s."""
        return self._watch.error

    @property
    def clock_seen(self) -> int:
        """Our ticks at the last sample of its clock; 0 before."""
        return self._watch.seen

    @property
    def troubles(self) -> tuple[str, ...]:
        """Its ongoing problems, kinds of events."""
        return self._event_log.standings

    @property
    def ready(self) -> bool:
        """True if a shot can start now."""
        return self.state == "ready" and not self.busy and not self._dark and self.wanted == "measure"

    # Connection -----------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Connect, supervise, reconnect; until cancelled or left."""
        wait = self.settings.first_wait
        while True:
            self._was_ready = False
            why = await self._session()
            if self._left:
                return
            self.state, self._client, self._shooter.aimed = "down", None, None
            self._event_log.standing("lost", f"{self.ranger}: {why}; reconnecting", "warning")
            if self._was_ready:
                wait = self.settings.first_wait
            await asyncio.sleep(wait * self._rng.uniform(0.8, 1.2))
            wait = min(self.settings.growth * wait, self.settings.longest_wait)

    async def _session(self) -> str:
        """Run one connection; the reason why it ended."""
        why = "no port"
        ports = list(enumerate(self.address.ports))
        for place, port in ports[::-1] if self.wanted == "listen" else ports:
            problem = await self._connect(port, SECOND_CLIENT_TID if place else FIRST_CLIENT_TID)
            if problem is None:
                break
            why = problem
        client = self._client
        if client is None:
            return why
        self.state, self._health_at = "connected", asyncio.get_running_loop().time()
        self._event_log.standing("lost", None, over=f"{self.ranger} is connected")
        renewing = asyncio.ensure_future(self._renew(client))
        try:
            return await self._supervise(client)
        finally:
            renewing.cancel()
            client.close()
            self._client = None

    async def _connect(self, port: int, first_tid: int) -> str | None:
        """Connect and check the greeting; the problem if it fails."""
        loop, limit = asyncio.get_running_loop(), self.settings.probe_timeout
        self._handshake = Handshake()
        try:
            async with asyncio.timeout(limit):
                client = await ZyClient.connect(
                    self.address.host,
                    port,
                    first_tid=first_tid,
                    heard=self._hear,
                    clock=loop.time,
                    network=self._network,
                    key=self._key,
                )
        except InputError as problem:
            return str(problem)
        except TimeoutError:
            return f"{self.address.host} port {port} does not answer within {limit:g} s"
        wrong: str | None = "given up"
        try:
            wrong = await self._handshake.rejection_reason(self.ranger, port, client.closed, limit)
        finally:
            if wrong is not None:
                client.close()
        if wrong is None:
            self._client = client
        elif self._handshake.wrong_ranger:
            self._event_log.tell("wrong-ranger", wrong, "alarm")
        return wrong

    async def _supervise(self, client: ZyClient) -> str:
        """Supervise a connection until it is over."""
        while not client.closed.done():
            if self.wanted == "measure" and self.state == "connected":
                await self._make_ready(client)
            elif self.wanted != "measure" and self.state == "ready":
                self.state = "connected"
                await self._give_back()
            client.check()
            if (not self.busy or self._doubt.is_set()) and not client.closed.done():
                self._doubt.clear()
                if not await self._lives():
                    return f"hung: VER was not answered within {self._probe_timeout:g} s"
            await first_of(client.closed, self._doubt, self.settings.probe_every)
        return client.closed.result()

    @property
    def _probe_timeout(self) -> float:
        """Timeout of VER, s.

        Another client's moves may be queued before it.
        """
        return self.settings.probe_timeout if self.wanted == "measure" else self.settings.move_timeout

    async def _lives(self, *, idle: bool = False) -> bool:
        """Probe with VER, and check the clock by its stamp and round trip.

        idle   True if no shot is under way though `busy` is set
        """
        loop = asyncio.get_running_loop()
        sent = self._probed_at = loop.time()
        reply = await self._ask(Request("VER"), self._probe_timeout)
        if reply.ok is not True or reply.ticks is None:
            return (
                not self.connected or self._heard_at > sent
            )  # a lost connection is not hung: the session has the reason
        self.round_trip = loop.time() - sent
        self._was_ready = self._was_ready or self.wanted != "measure"
        limit = self.settings.slow
        slow = f"a round trip takes {self.round_trip:.2f} s (limit {limit:g} s)" if self.round_trip > limit else None
        self._event_log.standing("slow", slow, over=f"a round trip takes {self.round_trip:.3f} s again")
        right = self._watch.look(reply.ticks, self.round_trip)
        if self.wanted == "measure" and (idle or not self.busy):
            if right is not None:
                await self._ask(Request("STI", (stamp_text(right),)), self.settings.probe_timeout)
            if self.state == "ready" and self.status & StatusWord.LASER_OFF:  # switched off by the ranger itself
                await self._light()
        if self._health_to is not None and (idle or not self.busy) and loop.time() - self._health_at >= HEALTH_EVERY:
            self._health_at = loop.time()
            await self._look_at_health(self._health_to)
        return True

    async def _look_at_health(self, tell: Callable[[RangerHealth], None]) -> None:
        found = await asked_health(lambda request: self._ask(request, self._probe_timeout))
        if found.ticks is None:
            return
        tell(
            RangerHealth(
                ticks=found.ticks,
                ranger=self.ranger,
                state=self.state,
                laser=found.laser,
                supplies=found.supplies,
                temperature_c=found.temperature_c,
                errors=found.errors,
                status=self.status,
                clock_offset=self.clock_offset,
                round_trip=self.round_trip,
            )
        )

    async def _light(self) -> None:
        """Switch the laser on, from ZRG inside the instrument if refused.

        If that fails it stays dark, and takes no shots.
        """
        if self._left:  # switched off for good
            return
        if self.status & StatusWord.LATCHED:
            self._dark = True
            return
        reply = await self._ask(Request("PS", ("1",)), PATIENCE)
        if reply.ok is False and self._shooter.aimed != 0 and await self._shooter.park():
            reply = await self._ask(Request("PS", ("1",)), PATIENCE)
        self._dark = reply.ok is not True
        text = f"{self.ranger} stays dark: {reply.text[:160]}" if self._dark else None
        self._event_log.standing("dark", text, over=f"{self.ranger} is lit again")

    async def _make_ready(self, client: ZyClient) -> None:
        """Send the ranger what it lacks; after a failure wait with back-off."""
        self.state = "preparing"
        loop = asyncio.get_running_loop()
        start, was_dark = loop.time(), bool(self.status & StatusWord.LASER_OFF)
        try:
            await self._take_lease()
            self._teach_guard()
            self.told.clear()
            sent = await prepare(self.sure, self.preparation, lambda: self.status)
            self.sampling = await sampling_of(self._ask)
            self.counts = await counts_of(self._ask)
            if self.status & StatusWord.LASER_OFF:
                self._lit_here = self._lit_here or was_dark
                await self._light()
        except CatseyeError as problem:
            self.state = "connected"
            if self.connected:
                kind = problem.kind if isinstance(problem, Refused) else "not-initialised"
                text = f"{self.ranger}: {problem}; retry in {self._patience:g} s"
                if kind == "leased":
                    self._event_log.standing(kind, text)
                else:
                    self._event_log.tell(kind, text, "warning")
                await first_of(client.closed, self._doubt, self._patience)
                self._patience = min(2.0 * self._patience, LONGEST_PATIENCE)
            return
        if self.state == "preparing" and self.connected:
            self.state, self._was_ready, self._patience = "ready", True, self.settings.probe_every
            what = "made ready" if sent else "was still ready"
            self._event_log.tell("ready", f"{self.ranger} {what} in {loop.time() - start:.1f} s", always=True)

    async def _take_lease(self) -> None:
        """Take the lease that a ranger's commands need.

        A ranger that does not know the command has no lease, and takes commands from everybody. With its old token, as
        after a cut that the ranger has not noticed, the lease is still this coordinator's; a name proves nothing.

        Raises Refused: another client holds it.
        """
        if self._token is not None and (await self._ask(self._renewal(self._token), PATIENCE)).ok is True:
            return
        self._token = None
        lease = await self._ask(Request("LEASE"), PATIENCE)
        self._leaseless = lease.command == "UNKNOWN"
        if lease.ok is not True:
            return
        if lease.values[:1] != ("none",):
            raise Refused("leased", f"{_holder(lease)} holds the lease (expected LEASE none from the holder)")
        grant = await self._ask(Request("LEASE", (HOLDER,)), PATIENCE)
        self._token = grant.values[-1] if grant.ok is True and len(grant.values) == LEASE_WITH_TOKEN else None
        self._event_log.standing("leased", None, over=f"{self.ranger}: the coordinator holds the lease again")

    def _renewal(self, token: str) -> Request:
        return Request("LEASE", (HOLDER, token))

    async def _renew(self, client: ZyClient) -> None:
        """Renew the lease periodically, until cancelled."""
        while not client.closed.done():
            await asyncio.sleep(self.settings.renew_every)
            if self._token is not None:
                reply = await self._ask(self._renewal(self._token), self.settings.renew_every)
                if reply.ok is False and reply.ticks is not None:
                    self._on_lease_lost("another client", "none")

    async def _give_back(self) -> None:
        """Switch the laser off and free the lease of a link not measuring."""
        if self._token is None:
            return
        await self._darkened(self.settings.move_timeout)
        if self._token is not None and (await self._ask(Request("LEASE", ("none",)), PATIENCE)).ok is True:
            self._token = None

    def _on_lease(self, reply: Reply) -> None:
        """Note that another client took the lease, or that it is free."""
        if reply.ok is True:
            self._on_lease_lost(_holder(reply), reply.values[0] if reply.values else "none")

    def _on_lease_lost(self, who: str, name: str) -> None:
        self._token = None
        if self.wanted != "measure":
            return
        if name != "none" and self.state in ("ready", "preparing"):
            self._event_log.standing("leased", f"{self.ranger}: {who} holds the lease; commands are paused")
        if self.state == "ready":
            self.state, self._shooter.aimed = "connected", None
        if name == "none":
            self._doubt.set()

    def _on_latch(self, reply: Reply) -> None:
        """Log a latched stop order, or its end."""
        if reply.values[:1] == ("none",):
            over = f"{self.ranger}: the stop order is {' '.join(reply.values[1:]) or 'cleared'}"
            self._event_log.standing("darkened", None, over=over)
            self._doubt.set()
            return
        text = f"{self.ranger}: no {'; '.join(reply.values)[:160]} (expected UNLATCH at the ranger, by a person)"
        self._event_log.standing("darkened", text, "alarm")

    def _teach_guard(self) -> None:
        """Inform the guard of the ranger's cubes, which CIL n needs."""
        now_ticks = ticks_now(self._clock)
        for request in self.preparation.requests:
            self._guard.refusal(self.ranger, request, now_ticks)

    def clock_corrected(self, seconds: float) -> None:
        """Prepare the ranger and sample its clock anew after a correction of ours."""
        self._watch.corrected()
        self._restarted(f"{self.ranger} is prepared anew: our clock was corrected by {seconds:+.3f} s")

    # Asking ---------------------------------------------------------------------------------------------------------

    async def sure(self, request: Request, timeout: float) -> Reply:
        """Reply to a request past the guard.

        Raises InputError: refused by the guard, or not connected.
        """
        return await self.reply_of(request.command, self.send(request), timeout)

    def send(self, request: Request) -> Sent:
        """Send a request past the guard; its TID and a future of its reply.

        Raises InputError, as `sure`.
        """
        if self._client is None:
            raise InputError("not connected")
        asks = COMMANDS[request.command].only_asks(request)
        if not asks:
            refusal = self._guard.refusal(self.ranger, request, ticks_now(self._clock))
            if refusal is not None:
                raise Refused("refused", f"{request.command}: {refusal}")
        tid, future = self._client.request(request.command, *request.parameters, ticks=request.ticks)
        if not asks and self._commanded is not None:
            future.add_done_callback(partial(self._report, tid, format_request(replace(request, tid=tid))))
        return tid, future

    def _report(self, tid: int, line: str, future: "asyncio.Future[Reply]") -> None:
        """Report a request's result; a cancelled one had no reply."""
        reply = None if future.cancelled() else future.result()
        if self._commanded is None:
            return
        if reply is None:
            self._commanded(SentCommand(ticks_now(self._clock), self.ranger, tid, line))
            return
        text = "" if reply.command == "BUF" else reply.text[:LONGEST_REPLY_TEXT]  # samples have their own table
        came = reply.ticks is not None  # for a lost connection the client makes the answer
        ticks = reply.ticks if reply.ticks is not None else ticks_now(self._clock)
        self._commanded(
            SentCommand(ticks=ticks, ranger=self.ranger, tid=tid, line=line, reply=text, ok=reply.ok if came else None)
        )

    async def _ask(self, request: Request, timeout: float) -> Reply:
        """Reply to a request; f = 0 if late or refused by the guard."""
        try:
            return await self.sure(request, timeout)
        except InputError as problem:
            return Reply(request.command, False, (str(problem),), 0, None)

    async def reply_of(self, command: str, sent: Sent, timeout: float) -> Reply:
        """Reply to a sent request; f = 0, logged, if not in time."""
        client, (tid, future) = self._client, sent
        try:
            async with asyncio.timeout(timeout):
                reply = await future
        except TimeoutError:
            if client is not None:
                client.forget(tid)
            self._doubt.set()
            if command != "VER":
                text = f"{self.ranger} did not answer {command} within {timeout:.1f} s"
                self._event_log.tell("no-reply", text, "warning", about=command)
            return Reply(command, False, ("no reply",), tid, None)
        self._guard.heard(self.ranger, reply)
        return reply

    def _hear(self, reply: Reply) -> None:
        """Process unsolicited lines, and replies to another client."""
        self._heard_at = asyncio.get_running_loop().time()
        if self._shooter.hears(reply):
            return
        self._guard.heard(self.ranger, reply)
        self._handshake.hear(reply)
        if reply.command == "STW" and reply.ok is True:
            self._status.hear(reply.text)
        elif reply.command == "SUN" and reply.ok is False:
            self._event_log.tell("sun", f"{self.ranger}: {reply.text[:160]}", "alarm")
            self._shooter.aimed = None
        elif reply.command == "SAFE":
            self._event_log.tell("made-safe", f"{self.ranger}: {reply.text[:160]}", "alarm", always=True)
            self._restarted(f"{self.ranger} must be made ready again")
        elif reply.command == "LEASE":
            self._on_lease(reply)
        elif reply.command == "LATCH":
            self._on_latch(reply)
        elif reply.command in MOVERS:
            self._shooter.aimed = None
        if self._heard_by is not None and reply.command == "CMEAS":
            self._heard_by(self, reply)

    def _restarted(self, text: str) -> None:
        if self.state == "ready":
            self.state, self._shooter.aimed = "connected", None
            self._doubt.set()
            self._event_log.tell("restarted", text, "warning", always=True)

    async def fire(self, planned: PlannedShot) -> LiveShot | None:
        """One shot; None, logged, if it failed."""
        shots: list[LiveShot] = []
        await self.stream(planned, shots.append, count=1)
        return shots[0] if shots else None

    async def stream(self, planned: PlannedShot, take: Callable[[LiveShot], None], *, count: int) -> int:
        """Point once, and take buffers one after another; their number.

        planned   a moving target is tracked for all of them, on its line
        take      called with each
        """
        if not self.ready:
            return 0
        self.busy = True
        try:
            since = asyncio.get_running_loop().time() - self._probed_at  # a ranger that is always busy is probed, too
            if since > self.settings.probe_every and not await self._lives(idle=True):
                self._doubt.set()
                return 0
            if not await self._sampled():
                return 0
            return await self._shooter.stream(planned, take, count=count)
        finally:
            self.busy = False

    async def _sampled(self) -> bool:
        """Send the wanted sampling if the ranger has another; True if it has it now."""
        wanted = self.wanted_sampling
        if wanted is None or wanted == self.sampling:
            return True
        for request in sampling_requests(self.sampling, wanted):
            reply = await self._ask(request, PATIENCE)
            if reply.ok is not True:
                self.failures += 1
                self.sampling = await sampling_of(self._ask) if self.connected else self.sampling
                text = f"{self.ranger}: {request.command} {request.parameters[0]}: {reply.text[:160]}"
                self._event_log.tell("sampling-refused", text, "warning")
                return False
        self.sampling = wanted
        return True

    async def tell_sun(self, vector: Sequence[float]) -> None:
        """Send the unit vector to the Sun, in its frame."""
        if self.wanted == "measure" and self._client is not None:
            await self._ask(Request("SUN", tuple(f"{v:.7f}" for v in vector)), self.settings.move_timeout)

    async def park(self) -> bool:
        """Point at ZRG, inside the instrument; True if done."""
        if not self.ready:
            return False
        self.busy = True
        try:
            return await self._shooter.park()
        finally:
            self.busy = False

    async def darken(self) -> None:
        """Switch the laser off until the guard allows it again."""
        if self.wanted == "measure":
            await self._darkened(self.settings.move_timeout)

    async def _darkened(self, timeout: float) -> bool:
        """Send PS 0 if the lease is ours; False if not answered.

        From outside the lease it would be latched against the holder.
        """
        if self._token is None and not self._leaseless:
            return True
        return (await self._ask(Request("PS", ("0",)), timeout)).ok is True

    async def leave(self, timeout: float = 3.0) -> None:
        """Switch off a laser switched on here, and close for good."""
        self._left = True
        if self._client is not None and not self._client.closed.done():
            if self._lit_here and not await self._darkened(timeout):
                self._event_log.tell(
                    "laser-left-on", f"{self.ranger} did not answer PS 0: its laser may be on", "alarm"
                )
            self._client.close("the coordinator leaves")
        self._lit_here = False


def _holder(reply: Reply) -> str:
    """Name and address of the lease's holder, from a ranger's line."""
    return " at ".join((reply.values[0], reply.values[2])) if len(reply.values) > LEASE_WITH_NUMBER else reply.text
