"""A twin that has been running: its rangers are initialised and homed before anybody connects, in no time at all.

A power-up takes a ranger half a minute: thousands of lines, and the search for two indices. A simulation that starts
with it shows little else in its first minute, so the head's clock runs through it as fast as the work is done.
"""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import replace

from catseye.clock import Clock
from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.link.preparation import Preparation
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, utc_text
from catseye.ranger.initialisation import cubes_commands, head_commands, monument_commands
from catseye.ranger.line import FIRST_CLIENT_TID, Reply, Request, format_request, nanoseconds_to_ticks
from catseye.ranger.ranger import Ranger
from catseye.ranger.sun_watch import sun_leaves
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.places import places_of

BEFORE = 300.0  # s before the start, when the rangers are powered on
STEP = 0.05  # s between two looks at a ranger that is busy
HOMING_TIMEOUT = 35.0  # s an axis: a ZY gives up after 30
LEAVING = 20.0  # s: a quarter turn of either axis, and the look at the Sun behind it
HOMING = (  # amplifiers, then the indices with the laser off, then the laser, to see whether it may shine
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
    """Time that is moved by hand from a while before a clock's, and then is that clock's.

    clock   that counts once `release` was called
    """

    def __init__(self, clock: Clock, before: float = BEFORE):
        self._clock = clock
        self._now: int | None = clock.now_ns() - round(before * PER_SECOND)

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._clock.now_ns() if self._now is None else self._now

    def advance(self, seconds: float) -> None:
        """Let time pass, but never past the other clock."""
        if self._now is not None:
            self._now = min(self._now + round(seconds * PER_SECOND), self._clock.now_ns())

    def release(self) -> None:
        """From now on it is the other clock's time."""
        self._now = None


def initialising_commands(site: SiteFolder) -> Callable[[str], list[Request]]:
    """`ranger.initialisation.commands_of_ranger` for many rangers of a site, whose places are worked out once."""
    places = places_of(site)

    def commands(ranger: str) -> list[Request]:
        cubes = cubes_commands(site, ranger, places=places)
        return [*monument_commands(site, ranger), *head_commands(site, ranger), *cubes]

    return commands


async def warm(
    site: SiteFolder, rangers: Mapping[str, Ranger], clock: WarmingClock, *, posture: Callable[[int], LivePosture]
) -> list[str]:
    """Make rangers that nobody is connected to ready, as a coordinator would that left a moment ago.

    clock     of their heads; released at the end
    posture   what the telescope tells at ticks: with it each ranger is told where the Sun is

    One that cannot be made ready is left dark, and said here in a line each: its mirror looks at the Sun and no way out
    is free, or an index is not found. The others serve; whoever commands it makes it ready when that can be.

    Raises InputError: a command of the records is refused.
    """
    commands, guard = initialising_commands(site), SafetyGuard(site)
    left: list[str] = []
    for name, ranger in rangers.items():
        for request in Preparation.of(commands(name)).requests:
            answer = ranger.work_of(CLIENT, request)
            if not isinstance(answer, tuple):
                raise InputError(f"{name}: {request.command} takes time (expected what is done at once)")
        _tell_sun(guard, name, ranger, clock, posture)
        problem = await _homed_and_lit(name, ranger, clock)
        if problem is not None or not ranger.laser_at_boot:
            ranger.work_of(CLIENT, Request("PS", ("0",)))  # dark until who has the lease lights it
        if problem is not None:
            left.append(problem)
        ranger.disconnect(CLIENT)
        await asyncio.sleep(0.0)
    clock.release()
    for name, ranger in rangers.items():
        _tell_sun(guard, name, ranger, clock, posture)
    return left


def _tell_sun(
    guard: SafetyGuard, name: str, ranger: Ranger, clock: WarmingClock, posture: Callable[[int], LivePosture]
) -> None:
    now = nanoseconds_to_ticks(clock.now_ns())
    guard.telescope(posture(now))
    ranger.work_of(CLIENT, Request("SUN", tuple(f"{v:.7f}" for v in guard.sun_vector(name, now))))


async def _homed_and_lit(name: str, ranger: Ranger, clock: WarmingClock) -> str | None:
    """Both indices found, and the laser on; why not, in a line.

    An index may look at the Sun: a ranger leaves it by itself, and is lit when it has left.
    """
    ask = _Asked(ranger, clock)
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
    """When a ranger whose beam rests in the Sun can be lit, as far as it knows."""
    if not ranger.in_sun or ranger.sun is None:
        return ""
    mjd = sun_leaves(ranger.cubes.station, ranger.here, ranger.sun, ranger.now_ns() / PER_DAY)
    return "; the Sun does not leave it within a day" if mjd is None else f"; the Sun leaves it at {utc_text(mjd)}"


class _Asked:
    """A ranger that is asked without a connection."""

    def __init__(self, ranger: Ranger, clock: WarmingClock):
        self._ranger, self._clock, self._tid = ranger, clock, FIRST_CLIENT_TID

    async def reply(self, request: Request, timeout: float) -> Reply:
        """What it answers; f = 0 where it does not within s of its own time."""
        self._tid += 1
        until = self._clock.now_ns() + round(timeout * PER_SECOND)
        replies = self._ranger.receive(CLIENT, format_request(replace(request, tid=self._tid)))
        while True:
            for out in replies:
                if out.reply.tid == self._tid or out.reply.command == "LINE":
                    return out.reply
            if self._clock.now_ns() >= until:
                return Reply(request.command, False, ("no reply",), 0, None)
            replies = self._ranger.turn()
            if not replies:
                self._clock.advance(STEP)

    async def until(self, done: Callable[[], bool], timeout: float) -> None:
        """Let it work by itself until something is so, or for s of its own time."""
        for _ in range(round(timeout / STEP)):
            if done():
                return
            self._ranger.turn()
            self._clock.advance(STEP)
            await asyncio.sleep(0.0)
