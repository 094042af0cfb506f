"""Where a ranger is, and how long things may take."""

from dataclasses import dataclass
from typing import Literal

Wanted = Literal["listen", "hold", "measure"]


@dataclass(frozen=True)
class Address:
    """Where a ranger listens: a host and its two ports."""

    host: str
    ports: tuple[int, int]


@dataclass(frozen=True)
class LinkSettings:
    """Times in s.

    first_wait, longest_wait  before a connection is tried again
    growth        of that wait: who was away for long is found again within a third of that time more
    probe_every, probe_timeout  VER asks whether it lives
    renew_every   the lease is renewed, whatever else is waited for
    slow          round trip beyond which a link is called slow
    clock_limit   how far its clock may be off before it is set
    move_timeout  for CIL: a full turn, settling, and what stands before it
    buffer_timeout  past a buffer's duration, for its reply
    slack         a track goes on so long behind its shot
    lead          a track must reach the ranger so long before its shot
    latest        a shot later than this is given up: its track was predicted for another time
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
