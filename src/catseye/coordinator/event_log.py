"""Event log with repetition limit and ongoing conditions."""

from dataclasses import dataclass

from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, Tell, ticks_now
from catseye.records.night.live import Happening, Severity

QUIET = 10.0  # s between two of one kind
MOST_KINDS = 4096  # remembered; the oldest are forgotten


@dataclass
class _LoggedEvent:
    ticks: int
    unsaid: int = 0


class EventLog:
    """Events of one of the coordinator's parts.

    who     a ranger, "telescope", "feed" ...
    clock   UTC
    tell    receiver of the events
    quiet   s in which a repeated event of the same kind and subject is only counted
    """

    def __init__(self, who: str, clock: Clock, tell: Tell, *, quiet: float = QUIET):
        self.who, self._clock, self._tell = who, clock, tell
        self._quiet = round(quiet * TICKS_PER_SECOND)
        self._logged: dict[tuple[str, str], _LoggedEvent] = {}
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
        """Log an event.

        kind      one word with hyphens
        about     further subject, such as a target: events of different subjects are not repetitions
        always    log also within the quiet time
        details   for programs; `unsaid` counts suppressed events of the same kind before
        """
        now_ticks = ticks_now(self._clock)
        before = self._logged.get((kind, about))
        if before is not None and not always and 0 <= now_ticks - before.ticks < self._quiet:
            before.unsaid += 1
            return
        if before is not None and before.unsaid:
            details["unsaid"] = float(before.unsaid)
        self._logged.pop((kind, about), None)
        self._logged[kind, about] = _LoggedEvent(now_ticks)
        self._forget(now_ticks)
        self._tell(Happening(ticks=now_ticks, who=self.who, kind=kind, text=text, severity=severity, details=details))

    def _forget(self, now_ticks: int) -> None:
        """Forget two of the oldest kinds outside the quiet time.

        A kind with suppressed events moves behind the others until it is logged again.
        """
        for _ in range(2):
            key, oldest = next(iter(self._logged.items()))
            full = len(self._logged) > MOST_KINDS
            if 0 <= now_ticks - oldest.ticks < self._quiet and not full:
                return
            del self._logged[key]
            if oldest.unsaid and not full:
                self._logged[key] = oldest

    def standing(
        self, kind: str, text: str | None, severity: Severity = "warning", *, over: str = "", **details: float | str
    ) -> None:
        """Log an ongoing condition at its start (text) and end (None).

        over   text at its end; "" for no event
        """
        previous = self._standing.get(kind)
        if text is not None:
            self._standing[kind] = text
            if previous is None:
                self._tell(
                    Happening(
                        ticks=ticks_now(self._clock),
                        who=self.who,
                        kind=kind,
                        text=text,
                        severity=severity,
                        details=details,
                    )
                )
        elif previous is not None:
            del self._standing[kind]
            if over:
                self._tell(
                    Happening(
                        ticks=ticks_now(self._clock),
                        who=self.who,
                        kind=f"{kind}-over",
                        text=over,
                        severity="note",
                        details=details,
                    )
                )

    @property
    def standings(self) -> tuple[str, ...]:
        """Ongoing conditions at this instant."""
        return tuple(self._standing)
