"""What becomes of a shot, and why one is not used."""

from enum import StrEnum


class ShotStatus(StrEnum):
    """What became of a shot; the value is what people and programs read."""

    USED = "used"
    REFERENCE = "reference"
    NOT_ADJUSTED = "not adjusted"
    # its samples
    WRONG_LENGTH = "wrong length"
    NO_SAMPLES = "no samples"
    CLIPPED = "clipped"
    DROPOUT = "dropout"
    STUCK = "stuck"
    NOISE_UNKNOWN = "noise unknown"
    BLOCKED = "blocked"
    DEAD = "dead"
    # what it is compared with
    BAD_REFERENCE = "bad reference"
    NO_REFERENCE = "no reference"
    NO_RANGER = "no ranger"
    REFUSED = "refused"  # by the reduction, which could not take it
    NO_PLACE = "no place"
    NO_POSTURE = "no posture"
    # its range among the others
    CYCLES_UNKNOWN = "whole cycles unknown"
    REFLECTED = "reflected"
    UNDECIDED = "undecided"
    DOUBTED = "doubted"  # while it was measured, by doubts.csv


class Reason(str):
    """Why a shot is not used: a line for people, which begins with the status, and the status itself for code.

    >>> reason = Reason(ShotStatus.BLOCKED, "return 0.0010 V, below the limit of 0.0200 V")
    >>> reason, reason.status.name
    ('blocked: return 0.0010 V, below the limit of 0.0200 V', 'BLOCKED')
    """

    status: ShotStatus
    text: str  # what follows the status
    __slots__ = ("status", "text")

    def __new__(cls, status: ShotStatus, text: str) -> "Reason":
        made = super().__new__(cls, f"{status}: {text}")
        made.status, made.text = status, text
        return made

    def __reduce__(self) -> tuple[type["Reason"], tuple[ShotStatus, str]]:
        return Reason, (self.status, self.text)


def status_of(line: str) -> ShotStatus | None:
    """The status that a line of a journal begins with, None for a line of another kind.

    >>> status_of("no reference: the ranger has no good shot on its internal cube yet").name
    'NO_REFERENCE'
    """
    return next((status for status in ShotStatus if line.startswith(f"{status}: ")), None)
