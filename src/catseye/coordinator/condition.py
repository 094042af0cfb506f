"""Condition of a site for screen and STATUS: problems, rangers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from catseye.coordinator.firing import GOOD, Firing
from catseye.coordinator.intake import Intake
from catseye.coordinator.journal.disk import A_DAY, AN_HOUR, DiskState, span_text
from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.modes import Mode
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.ranger.status import StatusWord
from catseye.records.night.live import Severity
from catseye.verdict import Verdict

START_UP = 120.0  # s in which rangers are made ready and the first round is planned
NO_SHOT = 45.0  # s: some rounds
IDLE = 120.0  # s without a shot, when a ranger counts as idle
NO_EPOCH = 90.0  # s without a solution
MOST_NAMES = 3
SIGNS = {  # a character each, for narrow screens
    "measures": "+",
    "last shot failed": "b",
    "idle": ".",
    "dark": "D",
    "suspended": "s",
    "another's": "L",
    "not ready": "p",
    "not connected": "x",
    "trouble": "!",
    "left out": "o",
}
WRONG: dict[str, Severity] = {  # states of a ranger, and their severity
    "idle": "warning",
    "dark": "alarm",
    "suspended": "warning",
    "another's": "warning",
    "not ready": "warning",
    "not connected": "alarm",
    "trouble": "warning",
    "left out": "warning",
}


@dataclass(frozen=True)
class StandingProblem:
    """An ongoing problem, in one line.

    id   the same while it lasts, and when it returns: a word, behind a colon the ranger
    """

    id: str
    severity: Severity
    text: str


@dataclass(frozen=True)
class SiteCondition:
    """A site at one instant.

    word       "starting", "well", "impaired", "alarm", or "stopped" if no shots are taken
    problems   alarms first; rangers of one state together
    alarms     the same, a ranger each
    rangers    name: a word of `SIGNS`
    troubles   name: ongoing conditions of a ranger, kinds of events
    epoch      number of the last epoch, 0 before the first
    verdict    on the last epoch; None before the first
    clock      "well" or the problem
    disk       of the journal: free space; "none" without one
    journal    "well" or the problem
    holder     holder of the coordinator's lease, "nobody"
    """

    word: str
    problems: tuple[StandingProblem, ...]
    alarms: tuple[StandingProblem, ...]
    rangers: Mapping[str, str]
    troubles: Mapping[str, tuple[str, ...]]
    epoch: int
    verdict: Verdict | None
    clock: str
    disk: str
    journal: str
    holder: str

    @property
    def measuring(self) -> int:
        """Number of rangers that measure."""
        return sum(word in ("measures", "last shot failed") for word in self.rangers.values())


class ConditionWatch:
    """Assessment of a site's condition from durable entries.

    mode              of the coordinator
    clock_believed    True if the host's clock is trusted
    telescope_known   True if its posture is recent

    `disk` and `holder` are set from outside.
    """

    def __init__(
        self,
        clock: Clock,
        links: Mapping[str, RangerLink],
        *,
        firing: Firing,
        intake: Intake,
        mode: Callable[[], Mode],
        clock_believed: Callable[[], bool],
        telescope_known: Callable[[], bool],
    ):
        self._clock, self._links, self._firing, self._intake = clock, links, firing, intake
        self._mode, self._clock_believed, self._telescope_known = mode, clock_believed, telescope_known
        self._began = ticks_now(clock)
        self._last: dict[str, tuple[int, bool]] = {}  # each ranger's last shot: ticks of arrival, True if good
        self._epoch, self._solved = 0, self._began
        self._verdict: Verdict | None = None
        self.disk: DiskState | None = None
        self.holder = "nobody"

    def entry(self, entry: Entry) -> None:
        """Take in one durable journal entry."""
        if isinstance(entry, AnsweredShot):
            self._last[entry.shot.ranger] = ticks_now(self._clock), entry.status in GOOD
        elif isinstance(entry, EpochSolution):
            self._verdict = verdict_of(entry)
            if entry.answer:
                self._epoch, self._solved = entry.answer.get("number") or 0, ticks_now(self._clock)

    def now(self) -> SiteCondition:
        """The condition at this instant."""
        rangers = {name: self._ranger(name, link) for name, link in self._links.items()}
        of_site, states = [*self._machine(), *self._measuring()], _names_by_state(rangers, starting=self._starting)
        problems = [*of_site, *(_of_rangers(state, names) for state, names in states.items())]
        problems.sort(key=lambda each: each.severity != "alarm")
        return SiteCondition(
            word=self._word(problems),
            problems=tuple(problems),
            alarms=(*of_site, *(_of_ranger(state, name) for state, names in states.items() for name in names)),
            rangers=rangers,
            troubles={name: link.troubles for name, link in self._links.items()},
            epoch=self._epoch,
            verdict=self._verdict,
            clock="well" if self._clock_believed() else "in doubt",
            disk="none" if self.disk is None else f"{self.disk.free / 1e9:.1f} GB free",
            journal=self._intake.trouble or "well",
            holder=self.holder,
        )

    # Inside ----------------------------------------------------------------------------------------------------------

    def _since(self, ticks: int) -> float:
        return (ticks_now(self._clock) - ticks) / TICKS_PER_SECOND

    @property
    def _starting(self) -> bool:
        return not self._last and self._since(self._began) < START_UP

    @property
    def _fired_since(self) -> float:
        """Time since the last shot, or since the start, s."""
        return self._since(max((ticks for ticks, _ in self._last.values()), default=self._began))

    def _ranger(self, name: str, link: RangerLink) -> str:
        dark = bool(link.status & StatusWord.LASER_OFF) or "dark" in link.troubles
        if name in self._firing.dropped:
            return "left out"
        if not link.connected:
            return "not connected"
        if "leased" in link.troubles:
            return "another's"
        if dark and link.state != "preparing" and link.wanted == "measure":
            return "dark"
        if link.wanted == "measure" and link.state != "ready":
            return "not ready"
        if self._firing.suspensions.resting(name, "", ticks_now(self._clock)):
            return "suspended"
        if link.troubles:
            return "trouble"
        ticks, good = self._last.get(name, (self._began, True))
        if self._since(ticks) > IDLE or (name not in self._last and self._mode() != "active"):
            return "idle"
        return "measures" if good else "last shot failed"

    def _machine(self) -> list[StandingProblem]:
        """Problems of journal, clock and disk."""
        problems = []
        if self._intake.trouble is not None:
            problems.append(
                StandingProblem("journal", "alarm", f"journal: {self._intake.trouble}: measuring suspended")
            )
        if not self._clock_believed():
            problems.append(
                StandingProblem("clock", "alarm", "clock: this machine's clock is in doubt: no shots are taken")
            )
        if self.disk is not None and self.disk.seconds < A_DAY:
            severity: Severity = "alarm" if self.disk.seconds < AN_HOUR else "warning"
            problems.append(StandingProblem("disk", severity, f"disk: full in {span_text(self.disk.seconds)}"))
        return problems

    def _measuring(self) -> list[StandingProblem]:
        """Problems of mode, telescope, shots and epochs."""
        problems = []
        mode, quiet, unsolved = self._mode(), self._fired_since, self._since(self._solved)
        if mode != "active":
            problems.append(StandingProblem("mode", "warning", f"mode {mode}: no shots are taken"))
        elif quiet > NO_SHOT and not self._starting:
            problems.append(StandingProblem("no-shot", "alarm", f"no shot for {span_text(quiet)}"))
        if not self._telescope_known() and not self._starting:
            problems.append(
                StandingProblem("telescope", "alarm", "telescope: no posture, targets on it are not measured")
            )
        if self._verdict is not None and self._verdict.word != "good":
            severity: Severity = "alarm" if self._verdict.word == "failed" else "warning"
            problems.append(
                StandingProblem(
                    "epoch", severity, f"epoch {self._epoch or 'none'} {self._verdict.word}: {self._verdict.why}"
                )
            )
        elif mode == "active" and unsolved > NO_EPOCH and not self._starting:
            problems.append(StandingProblem("no-epoch", "alarm", f"no epoch for {span_text(unsolved)}"))
        return problems

    def _word(self, problems: list[StandingProblem]) -> str:
        if self._mode() != "active" or (self._fired_since > NO_SHOT and not self._starting):
            return "stopped"
        worst = {problem.severity for problem in problems}
        for severity, word in (("alarm", "alarm"), ("warning", "impaired")):
            if severity in worst:
                return word
        return "starting" if self._starting else "well"


def _names_by_state(rangers: Mapping[str, str], *, starting: bool) -> dict[str, list[str]]:
    """Names of rangers by the state in which they do not measure."""
    states = {}
    for word in WRONG:
        names = [name for name, state in rangers.items() if state == word]
        if names and not (starting and word in ("not ready", "not connected", "dark", "idle")):
            states[word] = names
    return states


def _of_rangers(state: str, names: Sequence[str]) -> StandingProblem:
    """Problem of all rangers of one state."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    text = f"{len(names)} {state}: {', '.join(names[:MOST_NAMES])}{more}"
    return StandingProblem(_word_of(state), WRONG[state], text)


def _of_ranger(state: str, name: str) -> StandingProblem:
    """Problem of one ranger by itself."""
    return StandingProblem(f"{_word_of(state)}:{name}", WRONG[state], f"{name}: {state}")


def _word_of(state: str) -> str:
    """State of a ranger as one word.

    >>> _word_of("another's"), _word_of("not ready")
    ('anothers', 'not-ready')
    """
    return state.replace(" ", "-").replace("'", "")


def verdict_of(solution: EpochSolution) -> Verdict:
    """Verdict on an epoch: failed without a solution, doubtful by its doubts, else good."""
    if not solution.answer:
        return Verdict("failed", "no solution")
    points, doubts = len(solution.answer.get("names") or ()), solution.answer.get("doubts") or ()
    return Verdict("good", f"{points} points").hearing(doubts)
