"""A twin that has been running: its rangers are initialised and homed before anybody connects, in no time at all.

A power-up takes a ranger half a minute: thousands of lines, and the search for two indices. A simulation that starts
with it shows little else in its first minute, so the head's clock runs through it as fast as the work is done.
"""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import replace

from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.link.preparation import Preparation
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.initialisation import cubes_commands, head_commands, monument_commands
from catseye.ranger.line import FIRST_CLIENT_TID, Reply, Request, format_request, nanoseconds_to_ticks
from catseye.ranger.ranger import Ranger
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.places import places_of
from catseye.simulator.clock.world_clock import Clock

BEFORE = 300.0  # s before the start, when the rangers are powered on
STEP = 0.05  # s between two looks at a ranger that is busy
HOMING_TIMEOUT = 35.0  # s an axis: a ZY gives up after 30
HOMING = (  # amplifiers, then the indices with the laser off, then the laser
    *(("AXIS", "0", "1"), ("AXIS", "1", "1"), ("PS", "0"), ("FHM", "0"), ("FHM", "1"), ("PS", "1")),
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
) -> None:
    """Make rangers that nobody is connected to ready, as a coordinator would that left a moment ago.

    clock     of their heads; released at the end
    posture   what the telescope tells at ticks: with it each ranger is told where the Sun is

    Raises InputError: a command, or the search for an index, is refused.
    """
    commands = initialising_commands(site)
    for name, ranger in rangers.items():
        for request in Preparation.of(commands(name)).requests:
            answer = ranger.work_of(CLIENT, request)
            if not isinstance(answer, tuple):
                raise InputError(f"{name}: {request.command} takes time (expected what is done at once)")
        ask = _Asked(ranger, clock).reply
        for command, *parameters in HOMING:
            reply = await ask(Request(command, tuple(parameters)), HOMING_TIMEOUT)
            if reply.ok is not True:
                raise InputError(f"{name}: {command} {', '.join(parameters)} was refused: {reply.text[:120]}")
        ranger.disconnect(CLIENT)
        await asyncio.sleep(0.0)
    clock.release()
    now, guard = nanoseconds_to_ticks(clock.now_ns()), SafetyGuard(site)
    guard.telescope(posture(now))
    for name, ranger in rangers.items():
        sun = tuple(f"{v:.7f}" for v in guard.sun_vector(name, now))
        ranger.work_of(CLIENT, Request("SUN", sun))


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
