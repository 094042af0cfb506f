"""Modes of the coordinator, and suspensions after failures."""

from dataclasses import dataclass
from typing import Literal, get_args

from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.errors import InputError

Mode = Literal["active", "passive", "hold"]
PATIENCE = 3  # failures in a row
FIRST_PAUSE, LONGEST_PAUSE = 10.0, 600.0  # s


def mode_of(text: str) -> Mode:
    """A mode from text.

    Raises InputError for another word.

    >>> mode_of("Hold")
    'hold'
    """
    for mode in get_args(Mode):
        if text.lower() == mode:
            return mode
    raise InputError(f"mode {text[:20]!a} (expected active, passive or hold)")


@dataclass(slots=True)
class _Record:
    failures: int = 0
    pause: float = FIRST_PAUSE
    until: int = 0


class Suspensions:
    """Suspensions of lines (ranger, target) and rangers (ranger, "").

    Three failures in a row suspend for 10 s, then twice as long each time, up to 600 s; one good shot resets it.
    """

    def __init__(self) -> None:
        self._records: dict[tuple[str, str], _Record] = {}

    def failed(self, ranger: str, target: str, now_ticks: int) -> float | None:
        """Count a failure; duration of a suspension that starts now, s."""
        record = self._records.setdefault((ranger, target), _Record())
        record.failures += 1
        if record.failures < PATIENCE or now_ticks < record.until:
            return None
        pause = record.pause
        record.until = now_ticks + round(pause * TICKS_PER_SECOND)
        record.pause, record.failures = (
            min(2.0 * pause, LONGEST_PAUSE),
            PATIENCE - 1,
        )  # afterwards one more failure suffices
        return pause

    def good(self, ranger: str, target: str) -> None:
        """Reset after a good shot."""
        self._records.pop((ranger, target), None)

    def resting(self, ranger: str, target: str, now_ticks: int) -> bool:
        """True if a ranger or line is suspended at a time."""
        record = self._records.get((ranger, target))
        return record is not None and now_ticks < record.until

    def lines(self, now_ticks: int) -> frozenset[tuple[str, str]]:
        """All lines suspended at a time."""
        return frozenset(key for key, record in self._records.items() if key[1] and now_ticks < record.until)
