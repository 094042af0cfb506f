"""Address of a ranger, and time limits of its link."""

from dataclasses import dataclass
from typing import Literal

Wanted = Literal["listen", "hold", "measure"]


@dataclass(frozen=True)
class Address:
    """Network address of a ranger: a host and its two ports."""

    host: str
    ports: tuple[int, int]


@dataclass(frozen=True)
class LinkSettings:
    """Times in s.

    first_wait, longest_wait  back-off before a reconnection
    growth        of that back-off: a ranger is found again within a third of the time it was away
    probe_every, probe_timeout  VER tests if it responds
    renew_every   renewal of the lease, whatever else is waited for
    slow          round trip above which a link is called slow
    clock_limit   offset of its clock above which it is set
    move_timeout  for CIL: a full turn, settling, and queued commands before it
    buffer_timeout  after a buffer's duration, for its reply
    slack         duration of a track after its shot
    lead          a track must reach the ranger so long before its shot
    latest        a later shot is given up: its track was predicted for another time
    """

    first_wait: float = 0.2
    longest_wait: float = 30.0
    growth: float = 1.33
    probe_every: float = 2.0
    probe_timeout: float = 2.0
    renew_every: float = 5.0
    slow: float = 0.25
    clock_limit: float = 2e-3
    move_timeout: float = 20.0
    buffer_timeout: float = 3.0
    slack: float = 0.25
    lead: float = 0.03
    latest: float = 5.0
