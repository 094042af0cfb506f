"""Health of a ranger: laser, supplies, enclosure temperature, servo errors, clock."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from catseye.coordinator.link.decode import reals_of
from catseye.errors import InputError
from catseye.ranger.line import Reply, Request
from catseye.ranger.status import StatusWord

QUESTIONS = (("PS",), ("ENTEMP",), ("ACP", "0"), ("DSP", "0"), ("ACP", "1"), ("DSP", "1"))


@dataclass(frozen=True)
class RangerHealth:
    """Health of a ranger at an instant.

    ticks           of the last answer
    laser           True if it is on; None if unknown
    supplies        name and V of each, with blanks between; "" if unknown
    temperature_c   °C in the enclosure; NaN if unknown
    errors          counts (azimuth, elevation), actual less desired position; NaN if unknown
    status          its status word
    clock_offset    s, of its clock from ours, NaN before the first
    round_trip      s
    """

    ticks: int
    ranger: str
    state: str
    laser: bool | None
    supplies: str
    temperature_c: float
    errors: tuple[float, float]
    status: StatusWord
    clock_offset: float
    round_trip: float


@dataclass(frozen=True)
class HealthAnswers:
    """Answers of a ranger to the questions on its health, as fields of `RangerHealth`."""

    ticks: int | None
    laser: bool | None
    supplies: str
    temperature_c: float
    errors: tuple[float, float]


async def asked_health(ask: Callable[[Request], Awaitable[Reply]]) -> HealthAnswers:
    """Answers to PS, ENTEMP, ACP and DSP, sent together; what a ranger does not know stays unknown."""
    power, enclosure, *axes = await asyncio.gather(*(ask(Request(name, tuple(rest))) for name, *rest in QUESTIONS))
    known = power.ok is True and power.values[:1] in (("0",), ("1",))
    actual_azimuth, desired_azimuth, actual_elevation, desired_elevation = map(_number, axes)
    ticks = [reply.ticks for reply in (power, enclosure, *axes) if reply.ok is True and reply.ticks is not None]
    return HealthAnswers(
        ticks=max(ticks, default=None),
        laser=power.values[0] == "1" if known else None,
        supplies=" ".join(power.values[1:]) if known else "",
        temperature_c=_number(enclosure),
        errors=(actual_azimuth - desired_azimuth, actual_elevation - desired_elevation),
    )


def _number(reply: Reply) -> float:
    try:
        return reals_of(reply, 1)[0] if reply.ok is True else math.nan
    except InputError:
        return math.nan
