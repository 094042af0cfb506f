"""Warm up a twin: rangers initialised and homed before anybody connects.

A power-up takes a ranger half a minute: thousands of lines, and the search for two indices. A simulation starting
with it would show little else in its first minute, so the head's clock is advanced as fast as the work is done.
Rangers of a lane are made ready one after another, as many as the time before the start allows; lanes share its clock.
"""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from catseye.aliases import Progress
from catseye.clock import Clock
from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.link.preparation import Preparation
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, utc_text
from catseye.ranger.cubes import Cube
from catseye.ranger.initialisation import SiteCommands
from catseye.ranger.line import FIRST_CLIENT_TID, Reply, Request, format_request, nanoseconds_to_ticks
from catseye.ranger.ranger import Ranger
from catseye.ranger.sun_watch import sun_departure_mjd
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.service.listening import STEP_NAME

BEFORE = 300.0  # s before the start, when the rangers are powered on
STEP = 0.05  # s between two polls of a busy ranger
HOMING_TIMEOUT = 35.0  # s an axis: a ZY gives up after 30
LANE = 18  # rangers made ready one after another: 10 to 15 s each
LEAVING = 20.0  # s: a quarter turn of either axis, and the next check of the Sun
HOMING = (  # amplifiers, then the indices with the laser off, then the laser, to test if it is allowed
    *(
        ("LEASE", "warm-up"),
        ("AXIS", "0", "1"),
        ("AXIS", "1", "1"),
        ("PS", "0"),
        ("FHM", "0"),
        ("FHM", "1"),
        ("PS", "1"),
    ),
)
CLIENT = 0


class WarmingClock:
    """Clock advanced by hand until it joins another clock.

    clock   used after `release`
    """

    def __init__(self, clock: Clock, before: float = BEFORE):
        self._clock = clock
        self._now: int | None = clock.now_ns() - round(before * PER_SECOND)

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._clock.now_ns() if self._now is None else self._now

    @property
    def over(self) -> bool:
        """True once it has reached the other clock: nothing can be waited for."""
        return self._now is None or self._now >= self._clock.now_ns()

    def advance(self, seconds: float) -> None:
        """Advance the time, but never past the other clock."""
        if self._now is not None:
            self._now = min(self._now + round(seconds * PER_SECOND), self._clock.now_ns())

    def release(self) -> None:
        """Follow the other clock from now on."""
        self._now = None


async def warm(
    site: SiteFolder,
    rangers: Mapping[str, Ranger],
    clock: WarmingClock,
    *,
    posture: Callable[[int], LivePosture],
    progress: Progress = lambda what, done, total: None,
) -> list[str]:
    """Make unconnected rangers ready, as a coordinator would have left them.

    clock     of their heads; released at the end
    posture   telescope position at ticks: with it each ranger gets the Sun's direction
    progress  called with the number of rangers done, before the first and after each

    A ranger that cannot be made ready is left dark and reported here in a line: its mirror looks at the Sun and no way
    out is free, or an index is not found. The others serve; a client can make it ready later.

    Raises InputError: a command of the records is refused.
    """
    work = _WarmUp(site, rangers, clock, posture, progress)
    names = list(rangers)
    lanes = [names[k : k + LANE] for k in range(0, len(names), LANE)]
    work.lanes.running = len(lanes)
    tasks = [asyncio.ensure_future(work.lane(lane)) for lane in lanes]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    progress(STEP_NAME, len(rangers), len(rangers))
    clock.release()
    for name, ranger in rangers.items():
        _tell_sun(work.guard, name, ranger, clock, posture)
    return [work.problems[name] for name in names if name in work.problems]


class _Lanes:
    """Lanes that share a clock, which advances when all of them wait for it.

    running   number of lanes that have not ended
    """

    def __init__(self, clock: WarmingClock):
        self._clock = clock
        self.running = 0
        self._waiting: list[asyncio.Future[None]] = []

    async def advance(self) -> None:
        """Wait until the clock has advanced by a step."""
        waiter = asyncio.get_running_loop().create_future()
        self._waiting.append(waiter)
        self._step()
        if not waiter.done():
            await waiter

    def end(self) -> None:
        """End a lane, for which the others no longer wait."""
        self.running -= 1
        self._step()

    def _step(self) -> None:
        if self._waiting and len(self._waiting) == self.running:
            self._clock.advance(STEP)
            waiting, self._waiting = self._waiting, []
            for waiter in waiting:
                if not waiter.done():
                    waiter.set_result(None)


class _WarmUp:
    """Warm-up of a site's rangers, in lanes.

    problems   of rangers that stay dark, by name
    """

    def __init__(
        self,
        site: SiteFolder,
        rangers: Mapping[str, Ranger],
        clock: WarmingClock,
        posture: Callable[[int], LivePosture],
        progress: Progress,
    ):
        self._rangers, self._clock, self._posture, self._progress = rangers, clock, posture, progress
        self._commands, self.guard, self._loader = SiteCommands(site), SafetyGuard(site), _Loader()
        self.lanes = _Lanes(clock)
        self._done = 0
        self.problems: dict[str, str] = {}

    async def lane(self, names: Sequence[str]) -> None:
        """Make rangers ready one after another."""
        try:
            for name in names:
                await self._one(name, self._rangers[name])
        finally:
            self.lanes.end()

    async def _one(self, name: str, ranger: Ranger) -> None:
        self._progress(STEP_NAME, self._done, len(self._rangers))
        self._loader.load(ranger, Preparation.of(self._commands.of_ranger(name)).requests)
        _tell_sun(self.guard, name, ranger, self._clock, self._posture)
        problem = await _homed_and_lit(name, ranger, self._clock, self.lanes)
        if problem is not None or not ranger.laser_at_boot:
            ranger.work_of(CLIENT, Request("PS", ("0",)))  # dark until the holder of the lease switches it on
        if problem is not None:
            self.problems[name] = problem
        ranger.disconnect(CLIENT)
        self._done += 1
        await asyncio.sleep(0.0)


class _Loader:
    """Commands of the records, given to one ranger after another.

    Rangers of a frame have thousands of equal cubes: a cube that one of them made of the same commands is put into the
    next one's table.
    """

    def __init__(self) -> None:
        self._cubes: dict[tuple[tuple[str, ...], ...], Cube] = {}

    def load(self, ranger: Ranger, requests: Sequence[Request]) -> None:
        """Give a ranger its commands. Raises InputError: one is refused, or takes time."""
        for of_one, group in groupby(requests, key=_cube_number):
            commands = list(group)
            key = tuple(request.parameters for request in commands)
            cube = None if of_one is None else self._cubes.get(key)
            if cube is not None:
                ranger.cubes.put(cube)
                continue
            for request in commands:
                answer = ranger.work_of(CLIENT, request)
                if not isinstance(answer, tuple):
                    raise InputError(f"{ranger.name}: {request.command} takes time (expected one that ends at once)")
            if of_one is not None:
                self._cubes[key] = ranger.cubes.by_number[int(of_one)]


def _cube_number(request: Request) -> str | None:
    """Number of the cube that COO or KND sets up; None for another command."""
    return request.parameters[0] if request.command in ("COO", "KND") else None


def _tell_sun(
    guard: SafetyGuard, name: str, ranger: Ranger, clock: WarmingClock, posture: Callable[[int], LivePosture]
) -> None:
    ticks = nanoseconds_to_ticks(clock.now_ns())
    guard.telescope(posture(ticks))
    ranger.work_of(CLIENT, Request("SUN", tuple(f"{v:.7f}" for v in guard.sun_vector(name, ticks))))


async def _homed_and_lit(name: str, ranger: Ranger, clock: WarmingClock, lanes: _Lanes) -> str | None:
    """Home both axes and switch the laser on; the reason if that fails.

    If an index looks at the Sun, the ranger moves away by itself, and is lit afterwards.
    """
    ask = _LocalClient(ranger, clock, lanes)
    for command, *parameters in HOMING:
        reply = await ask.reply(Request(command, tuple(parameters)), HOMING_TIMEOUT)
        if reply.ok is not True and command == "PS" and ranger.in_sun:
            await ask.until(lambda: not ranger.in_sun, LEAVING)
            reply = await ask.reply(Request("PS", ("1",)), HOMING_TIMEOUT)
        if reply.ok is not True:
            line = f"{command} {', '.join(parameters)}"
            return f"{name} stays dark: {line} was refused: {reply.text[:120]}{_lit_from(ranger)}"
    return None


def _lit_from(ranger: Ranger) -> str:
    """Time at which the Sun leaves a ranger's parked beam, in words."""
    if not ranger.in_sun or ranger.sun is None:
        return ""
    mjd = sun_departure_mjd(ranger.cubes.station, ranger.here, ranger.sun, ranger.now_ns() / PER_DAY)
    return "; the Sun does not leave it within a day" if mjd is None else f"; the Sun leaves it at {utc_text(mjd)}"


class _LocalClient:
    """A ranger commanded without a connection."""

    def __init__(self, ranger: Ranger, clock: WarmingClock, lanes: _Lanes):
        self._ranger, self._clock, self._lanes, self._tid = ranger, clock, lanes, FIRST_CLIENT_TID

    async def reply(self, request: Request, timeout: float) -> Reply:
        """Reply to a request; f = 0 without one in time.

        timeout   s of the ranger's time
        """
        self._tid += 1
        until = self._clock.now_ns() + round(timeout * PER_SECOND)
        replies = self._ranger.receive(CLIENT, format_request(replace(request, tid=self._tid)))
        while True:
            for out in replies:
                if out.reply.tid == self._tid or out.reply.command == "LINE":
                    return out.reply
            if self._clock.now_ns() >= until or self._clock.over:
                return Reply(request.command, False, ("no reply",), 0, None)
            replies = self._ranger.turn()
            if not replies:
                await self._lanes.advance()

    async def until(self, condition: Callable[[], bool], timeout: float) -> None:
        """Run the ranger until a condition holds.

        timeout   s of the ranger's time
        """
        for _ in range(round(timeout / STEP)):
            if condition():
                return
            self._ranger.turn()
            await self._lanes.advance()
            await asyncio.sleep(0.0)
