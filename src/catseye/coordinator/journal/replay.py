"""A run fed to the reduction again, in the order in which it was fed then, and held against what it said then."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from catseye.coordinator.journal.entries import CLOCK_CORRECTED, EPOCH_BEGUN, AnsweredShot, Document, EpochSolution
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
from catseye.reduction.live.live import EpochJob, Live

NOTHING_TO_COMPARE = SolutionComparison(Sameness.IDENTICAL)
LiveFactory = Callable[[SiteFolder, StoredRun], Live]


@dataclass(frozen=True)
class RangeMove:
    """A shot's range made again, less the stored one, and its stored u: m."""

    ranger: str
    target: str
    change: float
    u: float


@dataclass
class ShotComparisons:
    """Shots fed since the solution before, their answers beside the stored ones.

    count       of all
    differing   seqs of those with another number or status
    reworded    seqs of those with the same numbers and status but another text
    unasked     seqs of those with which no answer is stored: nothing to compare
    moves       of those that have a range both times
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
        found = compare_shots(stored, new)
        if found is Sameness.DIFFERENT:
            self.differing.append(seq)
        elif found is Sameness.TEXTS:
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
    """One solution, stored and made again; or at the end the shots that no solution is stored for.

    seq        in its run
    stored     None at the end
    new        its answer is empty where nothing could be solved this time; None at the end
    shots      fed since the solution before
    solution   stored and new compared
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
        """True where all numbers, reason codes and statuses are unchanged to the last bit; texts apart."""
        return self.sameness is not Sameness.DIFFERENT


def replay(
    reader: JournalReader, run: int, live_factory: LiveFactory, *, until: int | None = None
) -> Iterator[Replayed]:
    """Each stored solution of a run beside the one that the same shots, weather and posture give now; then, where shots
    came behind the last one, those.

    live_factory   makes the reduction of a run, with the settings that the run states
    until          seq of the last event fed

    Without stored samples the reduction sees what the rangers made of them, and answers differ.
    """
    live = live_factory(reader.site(run), reader.run(run))
    shots, last = ShotComparisons(), 0
    job: EpochJob | None = None
    kinds: list[Kind] = ["shots", "weather", "postures", "documents", "solutions"]
    for seq, entry in reader.events(run, until=until, kinds=kinds):
        if isinstance(entry, AnsweredShot):
            last = seq
            shots.add(seq, entry, _asked(live, entry.shot))
        elif isinstance(entry, LiveWeather):
            live.weather(entry)
        elif isinstance(entry, LivePosture):
            live.posture(entry)
        elif isinstance(entry, Document) and entry.name == EPOCH_BEGUN:
            job = live.begin(entry.ticks)
        elif isinstance(entry, Document) and entry.name == CLOCK_CORRECTED:
            live.clock_corrected(entry.ticks)
            job = None  # what was being solved then was not taken in
        elif isinstance(entry, EpochSolution):
            new = EpochSolution.of(entry.ticks, None if job is None else live.take_in(job, job.solve()))
            yield Replayed(seq, entry, new, shots, compare_solutions(entry, new))
            shots, job = ShotComparisons(), None
    if shots.count:
        yield Replayed(last, None, None, shots)


def _asked(live: Live, shot: LiveShot) -> AnsweredShot:
    """As the coordinator asks: a shot that the reduction refuses has the refusal for its answer."""
    try:
        return AnsweredShot.of(shot, live.shot(shot))
    except CatseyeError as problem:
        return AnsweredShot(shot, "refused", str(problem))
