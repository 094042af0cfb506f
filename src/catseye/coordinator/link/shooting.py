"""Shots of a ranger: point or track, trigger, read amplitude, phase, samples."""

import asyncio
import math
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing, suppress
from dataclasses import dataclass

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.decode import BufferRead, Measurement, buffer_of, measurement_of, reals_of, shot_of
from catseye.coordinator.link.preparation import Refused
from catseye.coordinator.link.wire import Sent, Wire
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, PlannedShot, ticks_now
from catseye.errors import InputError
from catseye.ranger.line import Reply, Request, stamp_text
from catseye.records.night.live import LiveShot

SURELY = 12  # ticks, 10 ms: an earlier start stamp has passed by the ranger's clock, too
IN_HAND = 0.05  # s of it for replies and samples, which are received before the next shot
LONGEST_GAP = 5_000  # ticks, 4.3 s: longer planned gaps have another cause
GAP = 0.02  # s between two buffers of a stream, at most
AHEAD = 2  # outstanding triggers: the next runs while the last is answered
KINDS = (  # kind of a ranger's refusal of a move, by a word in it
    ("Sun", "sun-refused"),
    ("motor", "stuck-axis"),
    ("settled", "stuck-axis"),
    ("arrived", "stuck-axis"),
    ("homed", "lost-index"),
    ("no reply", "no-reply"),
    ("stops", "out-of-reach"),
)


@dataclass(frozen=True, eq=False)
class Trigger:
    """An outstanding CMEAS, and BUF unless the CMEAS is scheduled.

    TIDs and futures.
    """

    begin: int | None
    measured: Sent
    buffer: Sent | None


class Shooter:
    """Shots over one link.

    `aimed` is the cube that the mirror points at, None if unknown or tracking.
    """

    def __init__(self, link: Wire, event_log: EventLog, clock: Clock):
        self._link, self._event_log, self._clock = link, event_log, clock
        self.aimed: int | None = None
        self._before: PlannedShot | None = None
        self._stream: int | None = None  # TID of the running stream
        self._heard: asyncio.Queue[Reply] = asyncio.Queue()

    async def stream(self, planned: PlannedShot, take: Callable[[LiveShot], None], *, count: int) -> int:
        """Shots as of `RangerLink.stream`, of a ready link."""
        link, came = self._link, 0
        try:
            begin = await self._point(planned, count)
            shots = self._one_by_one(planned, begin, count)
            if count > 1 and await self._streams(planned, begin, count):
                shots = self._streamed(planned, count)
            async with aclosing(shots):
                async for shot in shots:
                    came += 1
                    link.shots, link.failures = link.shots + 1, 0
                    take(shot)
        except InputError as problem:
            link.failures, self.aimed = link.failures + 1, None
            if link.connected:  # a lost connection is logged already
                kind = problem.kind if isinstance(problem, Refused) else "bad-shot"
                text = f"{link.ranger} {planned.target}: {problem}"
                self._event_log.tell(kind, text, "warning", about=planned.target, target=planned.target)
        return came

    async def _one_by_one(self, planned: PlannedShot, begin: int | None, count: int) -> AsyncGenerator[LiveShot, None]:
        """Shots by a CMEAS and a BUF each.

        The next is sent before the last is answered.
        """
        waiting: deque[Trigger] = deque()
        triggered = 0
        while triggered < count or waiting:
            ahead = 1 if begin is not None and triggered <= 1 else AHEAD  # an unscheduled one would run before it
            while triggered < count and len(waiting) < ahead:
                waiting.append(self._trigger(planned, begin if triggered == 0 else None))
                triggered += 1
            yield await self._shot(planned, waiting.popleft())

    async def _streams(self, planned: PlannedShot, begin: int | None, count: int) -> bool:
        """Start a stream (STM); False if the command is unknown to the ranger."""
        link = self._link
        if begin is not None:
            await asyncio.sleep(max(0, begin - ticks_now(self._clock)) / TICKS_PER_SECOND)
        sent = link.send(Request("STM", (str(self._number(planned.target)), str(count))))
        self._stream, self._heard = sent[0], asyncio.Queue()
        reply = await link.reply_of("STM", sent, link.settings.buffer_timeout)
        if reply.ok is False:
            raise Refused("move-refused", f"STM: {reply.text[:200]}")
        return reply.command == "STM"

    async def _streamed(self, planned: PlannedShot, count: int) -> AsyncGenerator[LiveShot, None]:
        """Shots of a stream, which is stopped at the generator's end."""
        link, came = self._link, 0
        try:
            while came < count:
                measurement = self._checked_measurement(await self._next("CMEAS", planned.duration), planned)
                read = self._buffer(await self._next("BUF", 0.0), measurement.ticks, measurement.cube)
                came += 1
                yield shot_of(link.ranger, planned.target, measurement, buffer=read, usual=link.sampling)
        finally:
            self._stream = None
            if came < count and link.connected:
                with suppress(InputError):
                    link.send(Request("STM", (str(self._number(planned.target)), "0")))

    async def _next(self, command: str, seconds: float) -> Reply:
        """Next line of the stream.

        Raises InputError: none in time, or another command.
        """
        limit = seconds + self._link.settings.buffer_timeout
        try:
            async with asyncio.timeout(limit):
                reply = await self._heard.get()
        except TimeoutError:
            raise Refused("no-reply", f"no {command} from the stream within {limit:.1f} s") from None
        if reply.command != command:
            raise InputError(f"{reply.command} from the stream (expected {command})")
        return reply

    async def park(self) -> bool:
        """Point at ZRG (CIL); False, logged, if refused or unanswered."""
        try:
            reply = await self._link.sure(Request("CIL", ("0",)), self._link.settings.move_timeout)
            self._pointed(reply)
        except InputError as problem:
            self._event_log.tell("not-parked", f"{self._link.ranger}: {problem}", "warning")
            return False
        self.aimed = 0
        return True

    def hears(self, reply: Reply) -> bool:
        """True if a line belongs to the stream; then it is queued."""
        streamed = reply.tid == self._stream and reply.command in ("CMEAS", "BUF")
        if streamed:
            self._heard.put_nowait(reply)
        return streamed

    def _checked_measurement(self, reply: Reply, planned: PlannedShot) -> Measurement:
        measurement = measurement_of(reply)
        if self._link.names.get(measurement.cube) != planned.target:
            raise InputError(f"CMEAS answers for cube {measurement.cube} (expected {planned.target})")
        return measurement

    def _number(self, target: str) -> int:
        number = self._link.preparation.numbers.get(target)
        if number is None:
            raise Refused("unknown-target", f"not among its {len(self._link.names)} cubes")
        return number

    async def _point(self, planned: PlannedShot, count: int) -> int | None:
        """Point or track (CIL or TRK); start of the first buffer, None: at once.

        Raises Refused.
        """
        link, number, settings = self._link, self._number(planned.target), self._link.settings
        await self._send_cube(number)
        for azimuth, elevation in planned.via:
            self.aimed = None
            halt = Request("CIL", ("0", f"{azimuth:.0f}", f"{elevation:.0f}"))
            self._pointed(await link.sure(halt, settings.move_timeout))
        if planned.fixed:
            if self.aimed != number:
                reply = await link.sure(Request("CIL", (str(number),)), settings.move_timeout)
                self._pointed(reply)
                self.aimed = number
            return planned.begin_ticks if planned.begin_ticks > ticks_now(self._clock) else None
        trip = 0.0 if math.isnan(link.round_trip) else link.round_trip
        move_time = self._planned_gap(planned)
        ahead = trip + (max(settings.lead, move_time - IN_HAND) if trip > settings.slow else settings.lead)
        begin = max(planned.begin_ticks, ticks_now(self._clock) + round(ahead * TICKS_PER_SECOND))
        late = (begin - planned.begin_ticks) / TICKS_PER_SECOND
        if late > settings.latest:
            raise Refused("late", f"its start was {late:.1f} s late (limit {settings.latest:g} s)")
        self.aimed = None
        more = settings.slack + (count - 1) * (planned.duration + GAP)
        request = track(planned, number, begin, more=more)
        self._pointed(await link.sure(request, settings.probe_timeout + settings.buffer_timeout))
        late = (ticks_now(self._clock) - begin) / TICKS_PER_SECOND
        if late > settings.slack:  # the track would end before the buffer: no return
            raise Refused("late", f"TRK was answered {late:.2f} s after its shot's time (limit {settings.slack:g} s)")
        return begin

    def _planned_gap(self, planned: PlannedShot) -> float:
        """Planned time between the previous shot and this, s.

        A late mirror needs it, too.
        """
        before, self._before = self._before, planned
        if before is None or not 0 < planned.begin_ticks - before.begin_ticks < LONGEST_GAP:
            return 0.0
        return (planned.begin_ticks - before.begin_ticks) / TICKS_PER_SECOND - before.duration

    async def _send_cube(self, number: int) -> None:
        """Send a cube that was left for on demand."""
        link = self._link
        requests = link.preparation.on_demand.get(number, ())
        if number in link.told or not requests:
            return
        limit = link.settings.probe_timeout + link.settings.buffer_timeout
        for reply in await asyncio.gather(*(link.sure(request, limit) for request in requests)):
            if reply.ok is not True:
                raise Refused("not-initialised", f"{reply.command}: {reply.text[:200]}")
        link.told.add(number)

    def _pointed(self, reply: Reply) -> None:
        if reply.ok is not True:
            kind = next((kind for word, kind in KINDS if word in reply.text), "move-refused")
            raise Refused(kind, f"{reply.command}: {reply.text[:200]}")
        azimuth, elevation = reals_of(reply, 2)
        self._link.counts = (azimuth, elevation)

    def _trigger(self, planned: PlannedShot, begin: int | None) -> Trigger:
        request = Request("CMEAS", ("2", str(self._number(planned.target))), ticks=begin)
        measured = self._link.send(request)
        waits = begin is not None and begin + SURELY > ticks_now(self._clock)
        return Trigger(begin, measured, None if waits else self._link.send(Request("BUF")))

    async def _shot(self, planned: PlannedShot, trigger: Trigger) -> LiveShot:
        """Shot from the replies to one trigger.

        Raises InputError.
        """
        link, limit = self._link, self._link.settings.buffer_timeout
        begin = trigger.begin
        ahead = 0.0 if begin is None else max(0, begin - ticks_now(self._clock)) / TICKS_PER_SECOND
        reply = await link.reply_of("CMEAS", trigger.measured, ahead + AHEAD * planned.duration + limit)
        measurement = self._checked_measurement(reply, planned)
        buffer = link.send(Request("BUF")) if trigger.buffer is None else trigger.buffer
        read = self._buffer(await link.reply_of("BUF", buffer, limit), measurement.ticks, measurement.cube)
        return shot_of(link.ranger, planned.target, measurement, buffer=read, usual=link.sampling)

    def _buffer(self, reply: Reply, ticks: int, cube: int) -> BufferRead | None:
        """Samples of a shot; None if not received.

        The ranger's own amplitude and phase are then used.

        Raises InputError: damaged samples, or those of another shot; then the shot is rejected.
        """
        if reply.ok is not True:
            text = f"{self._link.ranger}: BUF: {reply.text[:120]}; its own amplitude and phase are used"
            self._event_log.tell("no-buffer", text, "warning")
            return None
        read = buffer_of(reply)
        if read.ticks != ticks or read.cube != cube:
            raise InputError(
                f"BUF is of cube {read.cube} at {stamp_text(read.ticks)} (expected {cube} at {stamp_text(ticks)})"
            )
        return read


def track(planned: PlannedShot, number: int, begin: int, *, more: float) -> Request:
    """TRK of a cube along its planned line, starting at `begin` (ticks).

    It ends `more` s after the shot.
    """
    rate = (planned.at_end - planned.at_begin) / planned.duration
    end = begin + round((planned.duration + more) * TICKS_PER_SECOND)
    places = [planned.at_begin + rate * ((t - planned.begin_ticks) / TICKS_PER_SECOND) for t in (begin, end)]
    first, last = (tuple(f"{v * 1e3:.4f}" for v in place) for place in places)
    return Request("TRK", (str(number), stamp_text(begin), *first, stamp_text(end), *last))
