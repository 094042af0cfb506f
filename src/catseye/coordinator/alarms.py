"""Alarms of a site: since when, acknowledged or shelved, by whom.

Source: [ISA182], states of an alarm: one that returns, or becomes worse, is unacknowledged; shelving ends by itself.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from catseye.coordinator.condition import StandingProblem
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.errors import InputError
from catseye.records.night.live import Severity

LONGEST_SHELVING = 1440.0  # minutes: a day, so that the next crew decides again
MOST_SHELVED = 256
PERSON = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")  # as the holder of a lease is named
RANKS: dict[Severity, int] = {"debug": 0, "note": 1, "warning": 2, "alarm": 3}


@dataclass(frozen=True)
class Shelving:
    """Shelving of one alarm: by whom, and until when, ticks."""

    by: str
    until: int


@dataclass(frozen=True)
class SiteAlarm:
    """One ongoing problem and its treatment.

    problem           the latest
    since             ticks, when it was first noticed
    acknowledged_by   "" if unacknowledged
    acknowledged_at   ticks, 0 likewise
    shelving          None if not shelved
    """

    problem: StandingProblem
    since: int
    acknowledged_by: str = ""
    acknowledged_at: int = 0
    shelving: Shelving | None = None


class AlarmBook:
    """Alarms by their id; `look` every second keeps it current.

    problems    of this instant
    event_log   reports acknowledgements and shelvings
    """

    def __init__(self, clock: Clock, problems: Callable[[], Sequence[StandingProblem]], event_log: EventLog):
        self._clock, self._problems, self._event_log = clock, problems, event_log
        self._alarms: dict[str, SiteAlarm] = {}
        self._shelvings: dict[str, Shelving] = {}

    def look(self) -> tuple[SiteAlarm, ...]:
        """Bring the book up to date; its alarms, the worst and latest first."""
        now_ticks = ticks_now(self._clock)
        for name, shelving in list(self._shelvings.items()):
            if shelving.until <= now_ticks:
                del self._shelvings[name]
                self._tell("shelved-over", f"alarm {name} is no longer shelved: its time is over", name, shelving.by)
        problems = {problem.id: problem for problem in self._problems()}
        self._alarms = {name: self._updated(problem, now_ticks) for name, problem in problems.items()}
        return tuple(sorted(self._alarms.values(), key=lambda a: (-RANKS[a.problem.severity], -a.since)))

    def _updated(self, problem: StandingProblem, now_ticks: int) -> SiteAlarm:
        before = self._alarms.get(problem.id)
        if before is None:
            return SiteAlarm(problem, now_ticks, shelving=self._shelvings.get(problem.id))
        if RANKS[problem.severity] > RANKS[before.problem.severity]:
            self._shelvings.pop(problem.id, None)
            return SiteAlarm(problem, before.since)
        return replace(before, problem=problem, shelving=self._shelvings.get(problem.id))

    def acknowledge(self, name: str, by: str) -> None:
        """Mark an alarm as seen by a person.

        Raises InputError: no such alarm, or no name.
        """
        alarm = self._alarm(name, by)
        self._alarms[name] = replace(alarm, acknowledged_by=by, acknowledged_at=ticks_now(self._clock))
        self._tell("acknowledged", f"{by} acknowledges alarm {name}: {alarm.problem.text}", name, by)

    def shelve(self, name: str, minutes: float, by: str) -> None:
        """Shelve an alarm for some minutes, also across its return.

        Raises InputError: no such alarm, no name, a time outside 0 to 1440 minutes, too many.
        """
        alarm = self._alarm(name, by)
        if not 0.0 < minutes <= LONGEST_SHELVING:
            raise InputError(f"shelving for {minutes:g} minutes (expected above 0, at most {LONGEST_SHELVING:g})")
        if len(self._shelvings) >= MOST_SHELVED:
            raise InputError(f"{MOST_SHELVED} alarms are shelved (expected fewer: unshelve some)")
        until = ticks_now(self._clock) + round(60.0 * minutes * TICKS_PER_SECOND)
        self._shelvings[name] = shelving = Shelving(by, until)
        self._alarms[name] = replace(alarm, shelving=shelving)
        self._tell("shelved", f"{by} shelves alarm {name} for {minutes:g} min: {alarm.problem.text}", name, by)

    def unshelve(self, name: str, by: str) -> None:
        """End an alarm's shelving.

        Raises InputError: it is not shelved, or no name.
        """
        _refuse_unnamed(by)
        if name not in self._shelvings:
            raise InputError(f"alarm {name[:40]!a} is not shelved (expected one of ALARMS that is)")
        del self._shelvings[name]
        if name in self._alarms:
            self._alarms[name] = replace(self._alarms[name], shelving=None)
        self._tell("unshelved", f"{by} ends the shelving of alarm {name}", name, by)

    def _alarm(self, name: str, by: str) -> SiteAlarm:
        _refuse_unnamed(by)
        self.look()
        if name not in self._alarms:
            raise InputError(f"{name[:40]!a} is not an alarm here now (expected one of ALARMS)")
        return self._alarms[name]

    def _tell(self, kind: str, text: str, name: str, by: str) -> None:
        self._event_log.tell(kind, text, always=True, alarm=name, by=by)


def _refuse_unnamed(by: str) -> None:
    if not PERSON.fullmatch(by):
        raise InputError(f"{by[:20]!a} is no name (expected a letter with up to 15 letters and digits)")
