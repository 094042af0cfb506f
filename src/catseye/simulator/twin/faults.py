"""Faults on command: kind, place and time. Used by world, heads and servers.

kind             whom                what it does                                            size
blocked-beam     ranger[:target]     nothing returns
dead-ranger      ranger              its ports close, its connections break
hung-ranger      ranger              it takes lines and does not answer
drifting-clock   ranger              its clock runs away, no time signal                     s a second
stuck-axis       ranger:axis         the mirror does not turn (0 azimuth, 1 elevation)
lost-index       ranger:axis         the search for the index finds none
wrong-target     ranger[:target]     a stray reflection from another retroreflector         m, nearer or farther
saturated-adc    ranger              the return is beyond the converter's ends               factor
network-cut      ranger              its connections break, new ones are refused
network-slow     ranger              every line is late                                      s
lying-station    station             its thermometer reads too high                          deg C
silent-station   station             it sends nothing
silent-telescope telescope           no posture is sent
open-interlock   ranger              hardware forbids light and moves
dew              target or *         the return is weak                                      factor of amplitude
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from catseye.errors import InputError

Kind = Literal[
    "blocked-beam",
    "dead-ranger",
    "hung-ranger",
    "drifting-clock",
    "stuck-axis",
    "lost-index",
    "wrong-target",
    "saturated-adc",
    "network-cut",
    "network-slow",
    "lying-station",
    "silent-station",
    "silent-telescope",
    "open-interlock",
    "dew",
]
SIZES: dict[str, float] = {  # where none is given
    "drifting-clock": 1e-3,
    "wrong-target": 0.031,
    "saturated-adc": 4.0,
    "network-slow": 0.5,
    "lying-station": 5.0,
    "dew": 0.02,
}


@dataclass(frozen=True)
class Fault:
    """One fault of the twin.

    kind         see above
    whom         a ranger, ranger:target, ranger:axis, station, target, or * for all
    start, end   s since the twin's start; the end is not in it
    size         as above; 0 where the kind has none

    >>> Fault.parse("lying-station WX2 60 600 3.5")
    Fault(kind='lying-station', whom='WX2', start=60.0, end=600.0, size=3.5)
    """

    kind: Kind
    whom: str
    start: float = 0.0
    end: float = float("inf")
    size: float = 0.0

    @staticmethod
    def parse(text: str) -> "Fault":
        """Fault from text: KIND WHOM [START [END [SIZE]]].

        Raises InputError with the invalid value and the expectation.
        """
        words = text.split()
        if not 2 <= len(words) <= 5 or words[0] not in get_args(Kind):
            raise InputError(
                f"fault {text!r}: expected KIND WHOM [START [END [SIZE]]], KIND one of {', '.join(get_args(Kind))}"
            )
        try:
            start, end, size = (float(w) for w in (words[2:] + ["0", "inf", "nan"][len(words) - 2 :]))
        except ValueError:
            raise InputError(f"fault {text!r}: start, end or size is not a number") from None
        if size != size:
            size = SIZES.get(words[0], 0.0)
        if not 0.0 <= start < end:
            raise InputError(f"fault {text!r}: start {start:g} s, end {end:g} s (expected 0 or above, end after start)")
        return Fault(words[0], words[1], start, end, size)  # type: ignore[arg-type]


class FaultBoard:
    """Faults of a twin; they can be added and removed while it runs."""

    def __init__(self, faults: Iterable[Fault] = ()):
        self.faults: list[Fault] = list(faults)

    def add(self, fault: Fault) -> None:
        """Add one fault to the plan."""
        self.faults.append(fault)

    def clear(self, kind: str = "*", whom: str = "*") -> int:
        """Remove the faults of a kind and object; returns their number."""
        removed = [f for f in self.faults if kind in ("*", f.kind) and whom in ("*", f.whom)]
        self.faults = [f for f in self.faults if f not in removed]
        return len(removed)

    def active(self, kind: Kind, whom: str, part: str | int | None = None, *, at: float) -> Fault | None:
        """First active fault of a kind on an object, or None.

        at   s since the twin's start

        whom   a ranger, station or target
        part   its target or axis: a fault on whom alone, or on *, touches every part
        """
        names = {whom, "*"} | (set() if part is None else {f"{whom}:{part}", f"*:{part}"})
        for fault in self.faults:
            if fault.kind == kind and fault.whom in names and fault.start <= at < fault.end:
                return fault
        return None
