"""Status of a shot, and the reason that it is not used."""

from enum import StrEnum


class ShotStatus(StrEnum):
    """Status of a shot; the value is for people and programs."""

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
    # its comparison
    BAD_REFERENCE = "bad reference"
    NO_REFERENCE = "no reference"
    NO_RANGER = "no ranger"
    REFUSED = "refused"  # not accepted by the reduction
    NO_PLACE = "no place"
    NO_POSTURE = "no posture"
    # its range among the others
    CYCLES_UNKNOWN = "whole cycles unknown"
    REFLECTED = "reflected"
    UNDECIDED = "undecided"
    DOUBTED = "doubted"  # during the measurement, by doubts.csv


class Reason(str):
    """Reason that a shot is not used.

    A line for people that begins with the status, and the status itself for code.

    >>> reason = Reason(ShotStatus.BLOCKED, "return 0.0010 V, below the limit of 0.0200 V")
    >>> reason, reason.status.name
    ('blocked: return 0.0010 V, below the limit of 0.0200 V', 'BLOCKED')
    """

    status: ShotStatus
    text: str  # after the status
    __slots__ = ("status", "text")

    def __new__(cls, status: ShotStatus, text: str) -> "Reason":
        reason = super().__new__(cls, f"{status}: {text}")
        reason.status, reason.text = status, text
        return reason

    def __reduce__(self) -> tuple[type["Reason"], tuple[ShotStatus, str]]:
        return Reason, (self.status, self.text)


def status_of(line: str) -> ShotStatus | None:
    """Status that a journal's line begins with; None without one.

    >>> status_of("no reference: the ranger has no good shot on its internal cube yet").name
    'NO_REFERENCE'
    """
    return next((status for status in ShotStatus if line.startswith(f"{status}: ")), None)
