"""What the coordinator's parts hand to each other, and what it needs of those that others write."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.clock import Clock
from catseye.constants import SECONDS_PER_DAY
from catseye.ranger.line import Reply, Request
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY, Happening, LivePosture

TICKS_PER_SECOND = TICKS_PER_DAY / SECONDS_PER_DAY


@dataclass(frozen=True, eq=False)
class PlannedShot:
    """One shot of a round.

    ranger, target   names; ZRG is the ranger's own cube
    begin_ticks      when its buffer shall begin
    duration         s, of the buffer
    at_begin, at_end (3,) m, where the target will be at `begin_ticks` and `duration` later: ground frame, or the
                     reflector frame for rangers of the feed arm
    fixed            it does not move against its ranger: CIL instead of TRK
    reason           one line: why this shot
    via              counts (azimuth, elevation) at which the mirror halts on its way, in order: round the Sun or a box
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
    """What each ranger shall shoot between two times, in order; `unseen` says why pairs were left out."""

    begin_ticks: int
    end_ticks: int
    shots: dict[str, tuple[PlannedShot, ...]]
    unseen: dict[tuple[str, str], str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SiteState:
    """What a planner is told.

    posture          the latest
    ready            rangers that can shoot
    counts           where their mirrors stand, azimuth and elevation
    suspended        lines (ranger, target) that failed, left alone for now
    since_reference  s since each ranger's last good shot on ZRG; a ranger without one is not in it
    place            a point's name and times (MJD) to (n, 3) m, ground frame: `Live.place`
    u                covariances (3, 3), m^2, of points as last known; may lack names
    """

    now_ticks: int
    posture: LivePosture
    ready: tuple[str, ...]
    counts: dict[str, tuple[float, float]]
    suspended: frozenset[tuple[str, str]]
    since_reference: dict[str, float]
    place: Callable[[str, ArrayLike], NDArray[np.float64]]
    u: dict[str, NDArray[np.float64]]


class Planner(Protocol):
    """What chooses the shots of the next round."""

    def round(self, state: SiteState) -> Round: ...


class SafetyAlarm(Protocol):
    """A beam at rest that something comes to: `within` s from now; `remedy` is "move" or "dark"."""

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
    """What has the last word before each request; it must hear what rangers answer, and how the telescope stands."""

    def refusal(self, ranger: str, request: Request, now_ticks: int) -> str | None:
        """Why a request must not be sent, None where it may."""
        ...

    def heard(self, ranger: str, reply: Reply) -> None: ...
    def telescope(self, posture: LivePosture) -> None: ...
    def sun_vector(self, ranger: str, now_ticks: int) -> tuple[float, float, float]:
        """Unit vector to the Sun in the ranger's own frame. Raises InputError where the telescope's posture lacks."""
        ...

    def watch(self, now_ticks: int, counts: Mapping[str, tuple[float, float]]) -> Sequence[SafetyAlarm]:
        """What comes to beams at rest."""
        ...


Tell = Callable[[Happening], None]


@dataclass(frozen=True, eq=False)
class Environment:
    """Time, network and chance of a coordinator: the world's, or a test's.

    clock     UTC
    network   where connections are made; None: TCP
    seed      of the jitter of waits
    key       of the site, said to ports that ask for one; None: there is none
    """

    clock: Clock
    network: ConnectionMaker | None = None
    seed: int = 0
    key: str | None = None


def ticks_now(clock: Clock) -> int:
    """Ticks of a clock at this instant."""
    return (2 * clock.now_ns() + 864_000) // 1_728_000
