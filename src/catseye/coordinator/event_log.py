"""Telling what happened: once when something begins and once when it ends, and not the same thing again and again."""

from dataclasses import dataclass

from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, Tell, ticks_now
from catseye.records.night.live import Happening, Severity

QUIET = 10.0  # s between two of one kind
MOST_KINDS = 4096  # kept; the oldest are forgotten


@dataclass
class _Said:
    ticks: int
    unsaid: int = 0


class EventLog:
    """What one of the coordinator's parts has to say.

    who     a ranger, "telescope", "feed" ...
    clock   UTC
    tell    where it goes
    quiet   s in which something of the same kind and about the same is counted, not told
    """

    def __init__(self, who: str, clock: Clock, tell: Tell, *, quiet: float = QUIET):
        self.who, self._clock, self._tell = who, clock, tell
        self._quiet = round(quiet * TICKS_PER_SECOND)
        self._said: dict[tuple[str, str], _Said] = {}
        self._standing: dict[str, str] = {}

    def tell(
        self,
        kind: str,
        text: str,
        severity: Severity = "note",
        *,
        about: str = "",
        always: bool = False,
        **details: float | str,
    ) -> None:
        """Something happened.

        kind      one word with hyphens
        about     whom else it touches, such as a target: told apart within the quiet time
        always    told also within the quiet time
        details   for programs; `unsaid` counts those of the same kind that were kept back before
        """
        now = ticks_now(self._clock)
        before = self._said.get((kind, about))
        if before is not None and not always and 0 <= now - before.ticks < self._quiet:
            before.unsaid += 1
            return
        if before is not None and before.unsaid:
            details["unsaid"] = float(before.unsaid)
        self._said.pop((kind, about), None)
        self._said[kind, about] = _Said(now)
        self._forget(now)
        self._tell(Happening(now, self.who, kind, text, severity, details))

    def _forget(self, now: int) -> None:
        """Forget what keeps nothing back any more: two of the oldest, since each time one comes.

        One that was kept back stands behind the others until its kind is told again.
        """
        for _ in range(2):
            key, oldest = next(iter(self._said.items()))
            full = len(self._said) > MOST_KINDS
            if 0 <= now - oldest.ticks < self._quiet and not full:
                return
            del self._said[key]
            if oldest.unsaid and not full:
                self._said[key] = oldest

    def standing(
        self, kind: str, text: str | None, severity: Severity = "warning", *, over: str = "", **details: float | str
    ) -> None:
        """A state that lasts: told when it begins (a text where there was none) and when it is over (None).

        over   what is said at its end; nothing where empty
        """
        began = self._standing.get(kind)
        if text is not None:
            self._standing[kind] = text
            if began is None:
                self._tell(Happening(ticks_now(self._clock), self.who, kind, text, severity, details))
        elif began is not None:
            del self._standing[kind]
            if over:
                self._tell(Happening(ticks_now(self._clock), self.who, f"{kind}-over", over, "note", details))

    @property
    def standings(self) -> tuple[str, ...]:
        """Happenings that last at this instant."""
        return tuple(self._standing)
