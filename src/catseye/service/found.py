"""Injected faults: when the site detected each, and which it missed."""

from collections.abc import Sequence
from dataclasses import dataclass

from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.coordinator.station_events import APART, BIASED, DOUBTED, RETURNED
from catseye.records.night.live import TICKS_PER_DAY, Happening
from catseye.simulator.twin.faults import Fault

SIGNS: dict[str, tuple[str, ...]] = {  # kinds of events that indicate a fault
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
LATE = 60.0  # s after a fault's end in which it may still be detected
LIKE = 3.0  # factor within which a reported size matches the fault's


@dataclass
class DetectedFault:
    """An injected fault and the first event that detected it, or None."""

    fault: Fault
    text: str
    begins: int  # ticks
    by: Happening | None = None

    @property
    def ends(self) -> float:
        """Ticks at which the fault ends; infinite if it does not."""
        return self.begins + (self.fault.end - self.fault.start) * TICKS_PER_SECOND

    @property
    def after(self) -> float | None:
        """Delay of the detection from the fault's beginning, s."""
        return None if self.by is None else (self.by.ticks - self.begins) / TICKS_PER_SECOND

    def line(self, ticks: int) -> str:
        """State of the fault at a time in ticks, for people.

        >>> DetectedFault(Fault.parse("dead-ranger ZY104 40"), "dead-ranger ZY104 40", 0).line(0)
        'dead-ranger ZY104 40: not detected'
        """
        if self.by is not None:
            return f"{self.text}: found after {max(self.after or 0.0, 0.0):.1f} s ({self.by.kind}: {self.by.text})"
        if ticks < self.begins:
            return f"{self.text}: begins in {(self.begins - ticks) / TICKS_PER_SECOND:.0f} s"
        return f"{self.text}: not detected"


class FaultFinder:
    """Match events to injected faults.

    faults      as typed
    start_mjd   of the twin, from which their times count
    """

    def __init__(self, faults: Sequence[str] = (), start_mjd: float = 0.0):
        start = round(start_mjd * TICKS_PER_DAY)
        self.found = [
            DetectedFault(fault, text, start + round(fault.start * TICKS_PER_SECOND))
            for text in faults
            for fault in (Fault.parse(text),)
        ]

    def heard(self, what: Happening) -> None:
        """Add one event, in journal order; assign it to the most specific fault."""
        matches = [fault for fault in self.found if _names(what, fault)]
        if not matches:
            return
        most = max(_exactness(fault) for fault in matches)
        first = next((fault for fault in matches if _exactness(fault) == most and fault.by is None), None)
        if first is not None:
            first.by = what


def _exactness(fault: DetectedFault) -> int:
    """Specificity: 2 for a part of a device, 1 for a device, 0 for all."""
    whom, _, part = fault.fault.whom.partition(":")
    return 0 if whom == "*" else 1 + bool(part)


def _names(what: Happening, fault: DetectedFault) -> bool:
    """True for an event that indicates a fault on its device and in time."""
    whom, _, part = fault.fault.whom.partition(":")
    late = LATE * TICKS_PER_SECOND
    if what.kind not in SIGNS[fault.fault.kind] or not fault.begins <= what.ticks <= fault.ends + late:
        return False
    if fault.fault.kind == "lying-station" and not _says_the_bias(what, fault):
        return False
    if part and what.kind in AXES:
        return what.kind == f"motor-off-{part}" and whom == what.who
    named = {what.who, what.details.get("ranger"), what.details.get("target")}
    elsewhere = part not in ("", "0", "1") and what.details.get("target") not in (None, part)
    return (whom == "*" or whom in named) and not elsewhere


def _says_the_bias(what: Happening, fault: DetectedFault) -> bool:
    """True if a suspicion matches the fault in readings, sign and size."""
    if what.kind == DOUBTED:
        return what.ticks < fault.ends
    offset = float(what.details.get("offset_c", "nan"))
    return fault.fault.size * offset > 0.0 and 1.0 / LIKE <= offset / fault.fault.size <= LIKE
