"""Replay of a run: reduced again in order, compared with its answers."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from catseye.coordinator.journal.entries import (
    CLOCK_CORRECTED,
    EPOCH_START,
    LIVE_CHANGED,
    AnsweredShot,
    Document,
    EpochSolution,
)
from catseye.coordinator.journal.reader import JournalReader, Kind, StoredRun
from catseye.coordinator.journal.sameness import (
    Sameness,
    SolutionComparison,
    compare_shots,
    compare_solutions,
    least_same,
)
from catseye.errors import CatseyeError
from catseye.records.night.live import LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import SiteFolder
from catseye.reduction.live.changes import LiveChange
from catseye.reduction.live.live import EpochJob, Live

NOTHING_TO_COMPARE = SolutionComparison(Sameness.IDENTICAL)
LiveFactory = Callable[[SiteFolder, StoredRun], Live]


@dataclass(frozen=True)
class RangeMove:
    """New range of a shot less the stored one, and its stored u: m."""

    ranger: str
    target: str
    change: float
    u: float


@dataclass
class ShotComparisons:
    """Shots since the previous solution, new answers beside the stored ones.

    count       of all
    differing   seqs of those with another number or status
    reworded    seqs of those with the same numbers and status but another text
    unasked     seqs of those without a stored answer: nothing to compare
    moves       of those with a range both times
    """

    count: int = 0
    differing: list[int] = field(default_factory=list)
    reworded: list[int] = field(default_factory=list)
    unasked: list[int] = field(default_factory=list)
    moves: list[RangeMove] = field(default_factory=list)

    def add(self, seq: int, stored: AnsweredShot, new: AnsweredShot) -> None:
        """Compare one more shot with its stored answer."""
        self.count += 1
        if not stored.status:
            self.unasked.append(seq)
            return
        sameness = compare_shots(stored, new)
        if sameness is Sameness.DIFFERENT:
            self.differing.append(seq)
        elif sameness is Sameness.TEXTS:
            self.reworded.append(seq)
        change = new.range_ - stored.range_
        if math.isfinite(change):
            self.moves.append(RangeMove(stored.shot.ranger, stored.shot.target, change, stored.u_range))

    @property
    def sameness(self) -> Sameness:
        """Sameness of the least similar shot."""
        if self.differing:
            return Sameness.DIFFERENT
        return Sameness.TEXTS if self.reworded else Sameness.IDENTICAL


@dataclass(frozen=True, eq=False)
class Replayed:
    """One solution, stored and new; or at the end the remaining shots.

    seq        in its run
    stored     None at the end
    new        its answer is empty if nothing was solved this time; None at the end
    shots      since the previous solution
    solution   comparison of stored and new
    """

    seq: int
    stored: EpochSolution | None
    new: EpochSolution | None
    shots: ShotComparisons
    solution: SolutionComparison = NOTHING_TO_COMPARE

    @property
    def sameness(self) -> Sameness:
        """Sameness of the solution and its shots together."""
        return least_same((self.solution.sameness, self.shots.sameness))

    @property
    def same(self) -> bool:
        """True if numbers, codes and statuses agree to the last bit; texts apart."""
        return self.sameness is not Sameness.DIFFERENT


def replay(
    reader: JournalReader, run: int, live_factory: LiveFactory, *, until: int | None = None
) -> Iterator[Replayed]:
    """Replay a run: each stored solution beside the new one.

    The shots after the last one follow at the end.

    live_factory   makes the reduction of a run, with the run's settings
    until          seq of the last event fed

    Without stored samples the reduction uses the rangers' own amplitudes and phases, and answers differ.
    """
    live = live_factory(reader.site(run), reader.run(run))
    shots, last = ShotComparisons(), 0
    job: EpochJob | None = None
    kinds: list[Kind] = ["shots", "weather", "postures", "documents", "solutions"]
    for seq, entry in reader.events(run, until=until, kinds=kinds):
        if isinstance(entry, AnsweredShot):
            last = seq
            shots.add(seq, entry, _answered(live, entry.shot))
        elif isinstance(entry, LiveWeather):
            live.weather(entry)
        elif isinstance(entry, LivePosture):
            live.posture(entry)
        elif isinstance(entry, Document) and entry.name == EPOCH_START:
            job = live.begin(entry.ticks)
        elif isinstance(entry, Document) and entry.name == LIVE_CHANGED:
            live.change(LiveChange.of(entry.text))
        elif isinstance(entry, Document) and entry.name == CLOCK_CORRECTED:
            live.clock_corrected(entry.ticks)
            job = None  # the solution under way was discarded
        elif isinstance(entry, EpochSolution):
            new = EpochSolution.of(entry.ticks, None if job is None else live.accept(job, job.solve()))
            yield Replayed(seq, entry, new, shots, compare_solutions(entry, new))
            shots, job = ShotComparisons(), None
    if shots.count:
        yield Replayed(last, None, None, shots)


def _answered(live: Live, shot: LiveShot) -> AnsweredShot:
    """Answer as in the coordinator: a refused shot has the refusal."""
    try:
        return AnsweredShot.of(shot, live.shot(shot))
    except CatseyeError as problem:
        return AnsweredShot(shot, "refused", str(problem))
