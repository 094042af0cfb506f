"""What the coordinator does at all, and what it leaves alone for a while."""

from dataclasses import dataclass
from typing import Literal, get_args

from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.errors import InputError

Mode = Literal["active", "passive", "hold"]
PATIENCE = 3  # failures in a row
FIRST_REST, LONGEST_REST = 10.0, 600.0  # s


def mode_of(text: str) -> Mode:
    """A mode as people type it.

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
    rest: float = FIRST_REST
    until: int = 0


class Suspensions:
    """Lines (ranger, target), or whole rangers (ranger, ""), that failed three times in a row rest: 10 s, then twice
    that, up to 600 s; one good shot forgives all.
    """

    def __init__(self) -> None:
        self._records: dict[tuple[str, str], _Record] = {}

    def failed(self, ranger: str, target: str, now_ticks: int) -> float | None:
        """Count a failure; s of rest where it begins now."""
        record = self._records.setdefault((ranger, target), _Record())
        record.failures += 1
        if record.failures < PATIENCE or now_ticks < record.until:
            return None
        rest = record.rest
        record.until = now_ticks + round(rest * TICKS_PER_SECOND)
        record.rest, record.failures = min(2.0 * rest, LONGEST_REST), PATIENCE - 1  # after its rest one more is enough
        return rest

    def good(self, ranger: str, target: str) -> None:
        """A shot that was worth something."""
        self._records.pop((ranger, target), None)

    def resting(self, ranger: str, target: str, now_ticks: int) -> bool:
        """Whether a ranger, or one of its lines, is left alone at a time."""
        record = self._records.get((ranger, target))
        return record is not None and now_ticks < record.until

    def lines(self, now_ticks: int) -> frozenset[tuple[str, str]]:
        """All lines that are left alone at a time."""
        return frozenset(key for key, record in self._records.items() if key[1] and now_ticks < record.until)
