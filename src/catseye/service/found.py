"""Faults on command: which of them the site named, when, and which nobody noticed."""

from collections.abc import Sequence
from dataclasses import dataclass

from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.coordinator.station_events import APART, BIASED, DOUBTED, RETURNED
from catseye.records.night.live import TICKS_PER_DAY, Happening
from catseye.simulator.twin.faults import Fault

SIGNS: dict[str, tuple[str, ...]] = {  # kinds of happenings that name a fault
    "blocked-beam": ("blocked", "dead", "no-return"),
    "dead-ranger": ("lost", "hung", "no-reply"),
    "hung-ranger": ("hung", "lost", "no-reply"),
    "drifting-clock": ("clock-free", "clock-off", "clock-drift", "clock-jump", "stamp-off"),
    "stuck-axis": ("motor-off-0", "motor-off-1", "stuck-axis", "out-of-reach"),
    "lost-index": ("lost-index", "not-initialised"),
    "wrong-target": ("wrong-range",),
    "saturated-adc": ("saturated", "clipped"),
    "network-cut": ("lost", "hung", "no-reply"),
    "network-slow": ("slow", "hung", "no-reply"),
    "lying-station": (DOUBTED, BIASED, APART, RETURNED),
    "silent-station": ("weather-silent",),
    "silent-telescope": ("telescope-silent",),
    "open-interlock": ("made-safe", "refused", "not-initialised"),
    "dew": ("weak-return", "blocked", "dead"),
}
AXES = ("motor-off-0", "motor-off-1")
LATE = 60.0  # s after a fault's end in which it may still be named
LIKE = 3.0  # factor within which a named size is the fault's


@dataclass
class FoundFault:
    """A fault and the first happening that named it, None while there is none."""

    fault: Fault
    text: str
    begins: int  # ticks
    by: Happening | None = None

    @property
    def ends(self) -> float:
        """Ticks at which the fault ends; infinite of one that goes on."""
        return self.begins + (self.fault.end - self.fault.start) * TICKS_PER_SECOND

    @property
    def after(self) -> float | None:
        """s from its beginning until it was named."""
        return None if self.by is None else (self.by.ticks - self.begins) / TICKS_PER_SECOND

    def line(self, now: int) -> str:
        """How it stands, for people, at a time in ticks.

        >>> FoundFault(Fault.parse("dead-ranger ZY104 40"), "dead-ranger ZY104 40", 0).line(0)
        'dead-ranger ZY104 40: not noticed'
        """
        if self.by is not None:
            return f"{self.text}: found after {max(self.after or 0.0, 0.0):.1f} s ({self.by.kind}: {self.by.text})"
        if now < self.begins:
            return f"{self.text}: begins in {(self.begins - now) / TICKS_PER_SECOND:.0f} s"
        return f"{self.text}: not noticed"


class FaultFinder:
    """Fed with happenings; knows which fault on command each names.

    faults      as people typed them
    start_mjd   of the twin, from which their times count
    """

    def __init__(self, faults: Sequence[str] = (), start_mjd: float = 0.0):
        start = round(start_mjd * TICKS_PER_DAY)
        self.found = [
            FoundFault(fault, text, start + round(fault.start * TICKS_PER_SECOND))
            for text in faults
            for fault in (Fault.parse(text),)
        ]

    def heard(self, what: Happening) -> None:
        """Take in one happening, in the journal's order; it names one fault, the one that says whom most exactly."""
        named = [each for each in self.found if _names(what, each)]
        if not named:
            return
        most = max(_exactness(each) for each in named)
        first = next((each for each in named if _exactness(each) == most and each.by is None), None)
        if first is not None:
            first.by = what


def _exactness(each: FoundFault) -> int:
    """2 of a fault on a part of somebody, 1 on somebody, 0 on all."""
    whom, _, part = each.fault.whom.partition(":")
    return 0 if whom == "*" else 1 + bool(part)


def _names(what: Happening, each: FoundFault) -> bool:
    """True for an event that names a fault and its victim, while it lasted or soon after."""
    whom, _, part = each.fault.whom.partition(":")
    late = LATE * TICKS_PER_SECOND
    if what.kind not in SIGNS[each.fault.kind] or not each.begins <= what.ticks <= each.ends + late:
        return False
    if each.fault.kind == "lying-station" and not _says_the_bias(what, each):
        return False
    if part and what.kind in AXES:
        return what.kind == f"motor-off-{part}" and whom == what.who
    named = {what.who, what.details.get("ranger"), what.details.get("target")}
    elsewhere = part not in ("", "0", "1") and what.details.get("target") not in (None, part)
    return (whom == "*" or whom in named) and not elsewhere


def _says_the_bias(what: Happening, each: FoundFault) -> bool:
    """True for a doubt about the fault's own readings, with its sign and size."""
    if what.kind == DOUBTED:
        return what.ticks < each.ends
    offset = float(what.details.get("offset_c", "nan"))
    return each.fault.size * offset > 0.0 and 1.0 / LIKE <= offset / each.fault.size <= LIKE
