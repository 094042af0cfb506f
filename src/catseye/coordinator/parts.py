"""Interfaces between the coordinator's parts, and of planner and guard."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.clock import Clock
from catseye.constants import SECONDS_PER_DAY
from catseye.geometry.frames.frame import Transforms
from catseye.ranger.line import Reply, Request
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY, Happening, LivePosture

TICKS_PER_SECOND = TICKS_PER_DAY / SECONDS_PER_DAY


@dataclass(frozen=True, eq=False)
class PlannedShot:
    """One shot of a round.

    ranger, target   names; ZRG is the ranger's own cube
    begin_ticks      time of its buffer's start
    duration         s, of the buffer
    at_begin, at_end (3,) m, predicted position of the target at `begin_ticks` and `duration` later: ground frame, or
    the
                     reflector frame for rangers of the feed arm
    fixed            True if it does not move against its ranger: CIL instead of TRK
    reason           one line: purpose of the shot
    via              counts (azimuth, elevation) of intermediate stops, in order, around the Sun or a box
    """

    ranger: str
    target: str
    begin_ticks: int
    duration: float
    at_begin: NDArray[np.float64]
    at_end: NDArray[np.float64]
    fixed: bool
    reason: str
    via: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Round:
    """Shots of each ranger between two times, in order.

    unseen   reasons why pairs were left out
    """

    begin_ticks: int
    end_ticks: int
    shots: dict[str, tuple[PlannedShot, ...]]
    unseen: dict[tuple[str, str], str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SiteState:
    """Input of a planner.

    posture          the latest
    ready            rangers that can shoot
    counts           positions of their mirrors, azimuth and elevation
    suspended        lines (ranger, target) suspended after failures
    since_reference  s since each ranger's last good shot on ZRG; a ranger without one is absent
    place            a point's name and times (MJD) to (n, 3) m, ground frame: `Live.place`
    u                covariances (3, 3), m^2, of points as last estimated; may lack names
    bent_frame       "arm" or "dish" and angles (n,), rad, to the transforms of its reflector frame to ground as a
                     structural model bends it: `Live.bent_frame`; None of a rigid telescope
    """

    now_ticks: int
    posture: LivePosture
    ready: tuple[str, ...]
    counts: dict[str, tuple[float, float]]
    suspended: frozenset[tuple[str, str]]
    since_reference: dict[str, float]
    place: Callable[[str, ArrayLike], NDArray[np.float64]]
    u: dict[str, NDArray[np.float64]]
    bent_frame: Callable[[str, ArrayLike, ArrayLike], Transforms] | None = None


class Planner(Protocol):
    """Chooses the shots of the next round."""

    def round(self, state: SiteState) -> Round: ...


@dataclass(frozen=True)
class SunZone:
    """Sun and the cone that no beam enters, rad.

    azimuth, elevation   from the site, azimuth from north clockwise
    cone                 half angle
    avoided              False if the Sun is set
    """

    azimuth: float
    elevation: float
    cone: float
    avoided: bool


class SafetyAlarm(Protocol):
    """A hazard that comes to a parked beam.

    within   s from now
    remedy   "move" or "dark"
    """

    @property
    def ranger(self) -> str: ...
    @property
    def within(self) -> float: ...
    @property
    def cause(self) -> str: ...
    @property
    def remedy(self) -> str: ...
    @property
    def text(self) -> str: ...


class RequestGuard(Protocol):
    """Safety check before each request.

    It needs the rangers' replies, and the telescope's posture.
    """

    def refusal(self, ranger: str, request: Request, now_ticks: int) -> str | None:
        """Reason why a request must not be sent; None if it may."""
        ...

    def heard(self, ranger: str, reply: Reply) -> None: ...
    def telescope(self, posture: LivePosture) -> None: ...
    def sun_vector(self, ranger: str, now_ticks: int) -> tuple[float, float, float]:
        """Unit vector to the Sun in the ranger's frame.

        Raises InputError if the telescope's posture is missing.
        """
        ...

    def sun_zone(self, now_ticks: int) -> SunZone:
        """The Sun over the site now, and its cone."""
        ...

    def watch(self, now_ticks: int, counts: Mapping[str, tuple[float, float]]) -> Sequence[SafetyAlarm]:
        """Hazards of parked beams."""
        ...


Tell = Callable[[Happening], None]


@dataclass(frozen=True, eq=False)
class Environment:
    """Time, network and random seed of a coordinator.

    clock     UTC
    network   connections; None: TCP
    seed      of the jitter of back-off times
    key       of the site, sent to ports that require one; None: none
    """

    clock: Clock
    network: ConnectionMaker | None = None
    seed: int = 0
    key: str | None = None


def ticks_now(clock: Clock) -> int:
    """Present time of a clock in ticks."""
    return (2 * clock.now_ns() + 864_000) // 1_728_000
