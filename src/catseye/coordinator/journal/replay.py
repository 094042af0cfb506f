"""A run fed to the reduction again, in the order in which it was fed then, and held against what it said then."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from catseye.coordinator.journal.entries import EPOCH_BEGUN, AnsweredShot, Document, EpochSolution
from catseye.coordinator.journal.reader import JournalReader, Kind, StoredRun
from catseye.errors import CatseyeError
from catseye.records.night.live import LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import SiteFolder
from catseye.reduction.live.live import EpochJob, Live

LiveFactory = Callable[[SiteFolder, StoredRun], Live]


@dataclass(frozen=True, eq=False)
class Replayed:
    """One solution, stored and made again; or at the end the shots that no solution is stored for.

    seq         in its run
    stored      None at the end
    new         its answer is empty where nothing could be solved this time; None at the end
    shots       fed since the solution before
    differing   seqs of those whose answer is not the stored one to the last bit
    unasked     seqs of those with which no answer is stored: nothing to compare
    """

    seq: int
    stored: EpochSolution | None
    new: EpochSolution | None
    shots: int
    differing: tuple[int, ...]
    unasked: tuple[int, ...] = ()

    @property
    def same_solution(self) -> bool:
        """Whether the solution is as it was, to the last bit."""
        return self.stored is None or self.stored.same(self.new)

    @property
    def same(self) -> bool:
        """Whether all that can be compared is as it was, to the last bit."""
        return self.same_solution and not self.differing


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
    shots, last = 0, 0
    differing: list[int] = []
    unasked: list[int] = []
    job: EpochJob | None = None
    kinds: list[Kind] = ["shots", "weather", "postures", "documents", "solutions"]
    for seq, entry in reader.events(run, until=until, kinds=kinds):
        if isinstance(entry, AnsweredShot):
            shots, last = shots + 1, seq
            again = _asked(live, entry.shot)
            if not entry.status:
                unasked.append(seq)
            elif _answer(again) != _answer(entry):
                differing.append(seq)
        elif isinstance(entry, LiveWeather):
            live.weather(entry)
        elif isinstance(entry, LivePosture):
            live.posture(entry)
        elif isinstance(entry, Document) and entry.name == EPOCH_BEGUN:
            job = live.begin(entry.ticks)
        elif isinstance(entry, EpochSolution):
            new = EpochSolution.of(entry.ticks, None if job is None else live.take_in(job, job.solve()))
            yield Replayed(seq, entry, new, shots, tuple(differing), tuple(unasked))
            shots, differing, unasked, job = 0, [], [], None
    if shots:
        yield Replayed(last, None, None, shots, tuple(differing), tuple(unasked))


def _asked(live: Live, shot: LiveShot) -> AnsweredShot:
    """As the coordinator asks: a shot that the reduction refuses has the refusal for its answer."""
    try:
        return AnsweredShot.of(shot, live.shot(shot))
    except CatseyeError as problem:
        return AnsweredShot(shot, "refused", str(problem))


def _answer(shot: AnsweredShot) -> tuple[str, ...]:
    """Status and numbers; as text, in which NaN is NaN and every bit shows."""
    return (shot.status, shot.text, *(repr(float(value)) for value in (shot.range_, shot.u_range, shot.misfit)))
