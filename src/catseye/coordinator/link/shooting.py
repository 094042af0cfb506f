"""A ranger's shots: point at a target or follow it, trigger, take amplitude and phase, take the samples."""

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

SURELY = 12  # ticks, 10 ms: a start stamp so long ago is over by the ranger's clock, too
IN_HAND = 0.05  # s of it for replies and samples, which are over when the next shot is asked for
LONGEST_WAY = 5_000  # ticks, 4.3 s: what is planned farther apart waits for something else
GAP = 0.02  # s between two buffers of a stream, at most
AHEAD = 2  # triggers on their way: the next runs while the last is answered
KINDS = (  # what a ranger's refusal of a move is called, by a word in it
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
    """A CMEAS on its way, and the BUF behind it unless the CMEAS waits for its time; TIDs and futures."""

    begin: int | None
    measured: Sent
    buffer: Sent | None


class Shooter:
    """Shots over one link.

    `aimed` is the cube that the mirror rests on, None where it is not known or the mirror follows one.
    """

    def __init__(self, link: Wire, event_log: EventLog, clock: Clock):
        self._link, self._event_log, self._clock = link, event_log, clock
        self.aimed: int | None = None
        self._before: PlannedShot | None = None
        self._stream: int | None = None  # TID of the stream that runs
        self._heard: asyncio.Queue[Reply] = asyncio.Queue()

    async def stream(self, planned: PlannedShot, take: Callable[[LiveShot], None], *, count: int) -> int:
        """As `RangerLink.stream`, of a link that is ready."""
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
            if link.connected:  # a connection that is gone has been told
                kind = problem.kind if isinstance(problem, Refused) else "bad-shot"
                text = f"{link.ranger} {planned.target}: {problem}"
                self._event_log.tell(kind, text, "warning", about=planned.target, target=planned.target)
        return came

    async def _one_by_one(self, planned: PlannedShot, begin: int | None, count: int) -> AsyncGenerator[LiveShot, None]:
        """A CMEAS and a BUF for each; the next is on its way while the last is answered."""
        waiting: deque[Trigger] = deque()
        triggered = 0
        while triggered < count or waiting:
            ahead = 1 if begin is not None and triggered <= 1 else AHEAD  # one without a time would run before it
            while triggered < count and len(waiting) < ahead:
                waiting.append(self._trigger(planned, begin if triggered == 0 else None))
                triggered += 1
            yield await self._shot(planned, waiting.popleft())

    async def _streams(self, planned: PlannedShot, begin: int | None, count: int) -> bool:
        """Begin a stream (STM); False where the ranger does not know the command."""
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
        """What a stream brings; it is stopped when nobody wants more."""
        link, came = self._link, 0
        try:
            while came < count:
                measurement = self._own(await self._next("CMEAS", planned.duration), planned)
                read = self._buffer(await self._next("BUF", 0.0), measurement.ticks, measurement.cube)
                came += 1
                yield shot_of(link.ranger, planned.target, measurement, buffer=read, usual=link.sampling)
        finally:
            self._stream = None
            if came < count and link.connected:
                with suppress(InputError):
                    link.send(Request("STM", (str(self._number(planned.target)), "0")))

    async def _next(self, command: str, seconds: float) -> Reply:
        """The stream's next line. Raises InputError: none in time, or another."""
        limit = seconds + self._link.settings.buffer_timeout
        try:
            async with asyncio.timeout(limit):
                reply = await self._heard.get()
        except TimeoutError:
            raise Refused("no-reply", f"the stream brought no {command} within {limit:.1f} s") from None
        if reply.command != command:
            raise InputError(f"the stream brought {reply.command} (expected {command})")
        return reply

    async def park(self) -> bool:
        """CIL on ZRG; False where it was refused or did not come, which is told."""
        try:
            reply = await self._link.sure(Request("CIL", ("0",)), self._link.settings.move_timeout)
            self._pointed(reply)
        except InputError as problem:
            self._event_log.tell("not-parked", f"{self._link.ranger}: {problem}", "warning")
            return False
        self.aimed = 0
        return True

    def hears(self, reply: Reply) -> bool:
        """Whether a line is the stream's; then it is kept for it."""
        streamed = reply.tid == self._stream and reply.command in ("CMEAS", "BUF")
        if streamed:
            self._heard.put_nowait(reply)
        return streamed

    def _own(self, reply: Reply, planned: PlannedShot) -> Measurement:
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
        """CIL or TRK; when the first buffer shall begin, None at once. Raises Refused."""
        link, number, settings = self._link, self._number(planned.target), self._link.settings
        await self._tell_of(number)
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
        way = self._way_to(planned)
        ahead = trip + (max(settings.lead, way - IN_HAND) if trip > settings.slow else settings.lead)
        begin = max(planned.begin_ticks, ticks_now(self._clock) + round(ahead * TICKS_PER_SECOND))
        late = (begin - planned.begin_ticks) / TICKS_PER_SECOND
        if late > settings.latest:
            raise Refused("late", f"its turn came {late:.1f} s late (limit {settings.latest:g} s)")
        self.aimed = None
        more = settings.slack + (count - 1) * (planned.duration + GAP)
        request = track(planned, number, begin, more=more)
        self._pointed(await link.sure(request, settings.probe_timeout + settings.buffer_timeout))
        late = (ticks_now(self._clock) - begin) / TICKS_PER_SECOND
        if late > settings.slack:  # the track would be over before the buffer is: nothing would return
            raise Refused("late", f"TRK was answered {late:.2f} s after its shot's time (limit {settings.slack:g} s)")
        return begin

    def _way_to(self, planned: PlannedShot) -> float:
        """s that the plan leaves the mirror from the shot before to this: it needs them when it is late, too."""
        before, self._before = self._before, planned
        if before is None or not 0 < planned.begin_ticks - before.begin_ticks < LONGEST_WAY:
            return 0.0
        return (planned.begin_ticks - before.begin_ticks) / TICKS_PER_SECOND - before.duration

    async def _tell_of(self, number: int) -> None:
        """A cube that the ranger was not told of at first."""
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
        """The replies of one trigger as a shot. Raises InputError."""
        link, limit = self._link, self._link.settings.buffer_timeout
        begin = trigger.begin
        ahead = 0.0 if begin is None else max(0, begin - ticks_now(self._clock)) / TICKS_PER_SECOND
        reply = await link.reply_of("CMEAS", trigger.measured, ahead + AHEAD * planned.duration + limit)
        measurement = self._own(reply, planned)
        buffer = link.send(Request("BUF")) if trigger.buffer is None else trigger.buffer
        read = self._buffer(await link.reply_of("BUF", buffer, limit), measurement.ticks, measurement.cube)
        return shot_of(link.ranger, planned.target, measurement, buffer=read, usual=link.sampling)

    def _buffer(self, reply: Reply, ticks: int, cube: int) -> BufferRead | None:
        """The samples; None where they did not come, and then the ranger's own amplitude and phase count.

        Raises InputError: samples that are damaged, or not this shot's; then nothing of it is believed.
        """
        if reply.ok is not True:
            text = f"{self._link.ranger}: BUF: {reply.text[:120]}; its own amplitude and phase are taken"
            self._event_log.tell("no-buffer", text, "warning")
            return None
        read = buffer_of(reply)
        if read.ticks != ticks or read.cube != cube:
            raise InputError(
                f"BUF is of cube {read.cube} at {stamp_text(read.ticks)} (expected {cube} at {stamp_text(ticks)})"
            )
        return read


def track(planned: PlannedShot, number: int, begin: int, *, more: float) -> Request:
    """TRK of a cube on its planned line from `begin` (ticks) on, and `more` s behind the shot's end."""
    rate = (planned.at_end - planned.at_begin) / planned.duration
    end = begin + round((planned.duration + more) * TICKS_PER_SECOND)
    places = [planned.at_begin + rate * ((t - planned.begin_ticks) / TICKS_PER_SECOND) for t in (begin, end)]
    first, last = (tuple(f"{v * 1e3:.4f}" for v in place) for place in places)
    return Request("TRK", (str(number), stamp_text(begin), *first, stamp_text(end), *last))
