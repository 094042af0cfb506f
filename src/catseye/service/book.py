"""Summary of a running site: shots, last ranges, epochs, problems."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from catseye.coordinator.firing import GOOD
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, StoredAnswer
from catseye.records.night.live import Happening, LivePosture
from catseye.reduction.epoch.reason import status_of
from catseye.service.comparison import EpochComparison, TwinComparison
from catseye.service.found import FaultFinder
from catseye.service.logs import epoch_of

UNKNOWN = "unknown"  # status of a later version
KEPT_EVENTS, KEPT_EPOCHS = 60, 10_000
MOST_UNJUDGED = 50_000  # shots remembered while nothing is solved


@dataclass(frozen=True)
class LastShot:
    """Last shot of a ranger.

    Range and its u in m, NaN if it gave none.
    """

    target: str
    status: str
    range_: float
    u_range: float


@dataclass
class Troubles:
    """Counts and latest texts of problems, by source and kind."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    texts: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, what: Happening) -> None:
        key = (str(what.details.get("ranger", what.who)), what.kind)
        self.counts[key] += 1 + int(float(what.details.get("unsaid", 0)))
        self.texts[key] = what.text


class RunSummary:
    """Summary built from durable journal entries, in their order.

    comparison   with the twin's truth; None if there is none
    finder       of injected faults
    """

    def __init__(self, comparison: TwinComparison | None = None, finder: FaultFinder | None = None):
        self._comparison = comparison
        self._finder = finder or FaultFinder()
        self.faults = self._finder.found
        self.ticks = 0  # of the latest entry
        self.posture: LivePosture | None = None
        self.last: dict[str, LastShot] = {}
        self.shots: Counter[str] = Counter()  # good shots by ranger
        self.statuses: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()  # statuses of epochs for shots that were good by themselves
        self._overruled: Counter[str] = Counter()  # their original statuses
        self._good: dict[int, str] = {}  # status by number, of good shots not yet in an epoch
        self.events: deque[Happening] = deque(maxlen=KEPT_EVENTS)
        self.troubles = Troubles()
        self.epochs: deque[dict[str, Any]] = deque(maxlen=KEPT_EPOCHS)  # number, ticks, names, used, rejected, doubt
        self.comparisons: dict[int, EpochComparison] = {}
        self.answer: StoredAnswer = {}  # of the last epoch

    def entry(self, entry: Any) -> None:
        """Add one entry of the journal."""
        self.ticks = max(self.ticks, entry.shot.ticks if isinstance(entry, AnsweredShot) else entry.ticks)
        if isinstance(entry, AnsweredShot):
            self._shot(entry)
        elif isinstance(entry, EpochSolution):
            self._solution(entry)
        elif isinstance(entry, LivePosture):
            self.posture = entry
        elif isinstance(entry, Happening):
            if entry.severity != "debug":
                self.events.append(entry)
            self._finder.heard(entry)
            if entry.severity != "note":
                self.troubles.add(entry)

    @property
    def acknowledged(self) -> int:
        """Number of durable shots."""
        return sum(self.statuses.values())

    @property
    def fates(self) -> Counter[str]:
        """Final status of each durable shot: its epoch's, else its own."""
        return +(self.statuses - self._overruled + self.left_out)

    @property
    def latest(self) -> EpochComparison | None:
        """The last epoch that was compared."""
        return next(reversed(self.comparisons.values()), None)

    def _shot(self, answered: AnsweredShot) -> None:
        shot = answered.shot
        self.statuses[answered.status] += 1
        self.shots[shot.ranger] += answered.status in GOOD
        if answered.status in GOOD:
            self._good[shot.number] = answered.status
            if len(self._good) > MOST_UNJUDGED:
                del self._good[next(iter(self._good))]
        self.last[shot.ranger] = LastShot(shot.target, answered.status, answered.range_, answered.u_range)
        if self._comparison is not None:
            self._comparison.shot(answered)

    def _solution(self, solution: EpochSolution) -> None:
        compared = None if self._comparison is None else self._comparison.epoch(solution)
        answer = solution.answer
        if not answer:
            self.events.append(epoch_of(solution))
        if not answer:
            return
        self.answer = answer
        if compared is not None:
            self.comparisons[compared.number] = compared
        lists = {
            "names": answer.get("names", ()),
            "used": answer.get("used", ()),
            "rejected": answer.get("rejected", ()),
        }
        counts = {key: len(values) for key, values in lists.items()}
        doubt = next(iter(answer.get("doubts") or ()), None)
        self.epochs.append({"number": answer.get("number"), "ticks": solution.ticks, **counts, "doubt": doubt})
        rejected = {int(number): reason for number, reason in (answer.get("rejected") or {}).items()}
        for number, reason in rejected.items():
            status = self._good.pop(number, None)  # shots bad by themselves are counted already
            if status is not None:
                self._overruled[status] += 1
                self.left_out[str(status_of(reason) or UNKNOWN)] += 1
        last = max(
            [*rejected, *answer.get("used", ())], default=0
        )  # shots received during the solution belong to the next epoch
        self._good = {number: status for number, status in self._good.items() if number > last}
