"""A run of a journal reduced again: the same to the last bit, or how far other calibrations move its points."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.coordinator.journal.check import ChainReport, check_whole
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.coordinator.journal.replay import Replayed, replay
from catseye.errors import InputError
from catseye.gateways.journal.chain import chain_object, chain_words
from catseye.gateways.writers.verdict import Verdict
from catseye.records.site.folder import SiteFolder, read_site
from catseye.reduction.live.live import Live
from catseye.service.settings import live_settings

TOLD = 20  # points that people are told of: those that move most
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Moved:
    """A point's difference, new less stored: mean (x, y, z), largest length, mm, and in how many epochs."""

    mean_mm: tuple[float, float, float]
    largest_mm: float
    epochs: int


@dataclass
class ReplayOutcome:
    """What came of a run that was replayed: counts of what is the same, and how far points moved.

    run            that was replayed
    calibrations   folder of other records, None for the run's own
    epochs, shots  fed
    same_epochs    that are the same to the last bit
    same_shots     the same
    late_shots     of all shots, those behind the last epoch
    unasked        shots with which no answer is stored: not compared
    chain          what the journal's chain says of the run
    first          number of the first epoch that differs, and of what
    moved          by point
    lost           points of stored epochs that the new ones do not have
    """

    run: StoredRun
    calibrations: Path | None
    chain: ChainReport
    epochs: int = 0
    shots: int = 0
    same_epochs: int = 0
    same_shots: int = 0
    late_shots: int = 0
    unasked: int = 0
    first: str = ""
    moved: dict[str, Moved] = field(default_factory=dict)
    lost: int = 0

    @property
    def same(self) -> bool:
        """Whether all answers are the same to the last bit."""
        return self.epochs == self.same_epochs and self.shots == self.same_shots + self.unasked

    @property
    def not_compared(self) -> tuple[str, ...]:
        """What a replay says nothing about."""
        told = [f"{self.unasked} shots whose answer was not stored"] * bool(self.unasked)
        return (*told, "commands, happenings and documents, which the reduction does not see")


def replayed(journal: str, which: int | str | None, calibrations: Path | None, *, progress: Progress) -> ReplayOutcome:
    """A run again, with its own records or others.

    Raises InputError: no such journal, run or folder; a run that does not say how it was reduced; nothing solved in it.
    """
    other = None if calibrations is None else read_site(calibrations)
    with JournalReader(journal) as reader:
        run = reader.run(which)
        settings = live_settings(run.settings, f"journal {reader.place}: run {run.run}")

        def made(site: SiteFolder, _: StoredRun) -> Live:
            return Live(site if other is None else other, settings)

        chain = check_whole(reader, run.run, progress=progress)
        if chain.bad:  # what does not check is not fed: the rest says how much hangs on it
            reader.left_out = {run.run: chain.bad}
        total = sum(1 for _ in reader.solutions(run.run))
        if not total:
            raise InputError(f"journal {reader.place}: run {run.run} holds no epoch (expected one at least)")
        outcome = ReplayOutcome(run, calibrations, chain)
        off: dict[str, list[np.ndarray]] = defaultdict(list)
        for each in replay(reader, run.run, made):
            progress("epochs", outcome.epochs, total)
            _count(outcome, each)
            _compare(outcome, each, off)
    outcome.moved = {name: _moved(np.array(rows) / MILLIMETRE) for name, rows in sorted(off.items())}
    return outcome


def _count(outcome: ReplayOutcome, each: Replayed) -> None:
    outcome.shots += each.shots
    outcome.same_shots += each.shots - len(each.differing) - len(each.unasked)
    outcome.unasked += len(each.unasked)
    if each.stored is None:
        outcome.late_shots += each.shots
        where = f"shots behind the last epoch (event {each.differing[0]})" if each.differing else ""
    else:
        outcome.epochs += 1
        outcome.same_epochs += each.same_solution
        what = "a shot" if each.differing else "its solution"
        where = f"epoch {each.stored.answer.get('number')} (event {each.seq}) by {what}"
    if not each.same and not outcome.first:
        outcome.first = where


def _compare(outcome: ReplayOutcome, each: Replayed, off: dict[str, list[np.ndarray]]) -> None:
    if each.stored is None or each.new is None:
        return
    before, after = _places(each.stored), _places(each.new)
    outcome.lost += len(set(before) - set(after))
    for name in set(before) & set(after):
        off[name].append(after[name] - before[name])


def _places(solution: EpochSolution) -> dict[str, np.ndarray]:
    names, x = solution.answer.get("names") or [], solution.answer.get("x") or []
    return {name: np.array(place, dtype=float) for name, place in zip(names, x, strict=False)}


def _moved(rows: np.ndarray) -> Moved:
    mean = rows.mean(axis=0)
    return Moved((float(mean[0]), float(mean[1]), float(mean[2])), float(np.linalg.norm(rows, axis=1).max()), len(rows))


def replay_verdict(outcome: ReplayOutcome) -> Verdict:
    """Whether the run's own records give its answers again to the last bit; of other records how far they move it."""
    chain = outcome.chain
    if chain.count:
        return Verdict("failed", f"the journal is not as it was written: {chain.problems[0]}")
    if outcome.same:
        kept = "" if chain.chained else "; an older catseye wrote it, without a chain that could be checked"
        return Verdict("good", f"every answer is the same bit for bit{kept}")
    if outcome.calibrations is not None:
        furthest = max((m.largest_mm for m in outcome.moved.values()), default=0.0)
        return Verdict("good", f"reduced with other records, which move points by up to {furthest:.3f} mm")
    if not outcome.run.buffers:
        return Verdict("doubtful", "the run kept no samples, so its answers cannot be had again bit for bit")
    return Verdict("failed", f"the run's own samples and records give other answers, first {outcome.first}")


def replay_object(outcome: ReplayOutcome) -> dict[str, Any]:
    """What `catseye replay --json` prints."""
    return {
        "verdict": replay_verdict(outcome).to_object(),
        "run": outcome.run.run,
        "uuid": outcome.run.uuid,
        "site": outcome.run.site,
        "calibrations": None if outcome.calibrations is None else str(outcome.calibrations),
        "epochs": outcome.epochs,
        "epochs_same": outcome.same_epochs,
        "shots": outcome.shots,
        "shots_same": outcome.same_shots,
        "same": outcome.same,
        "first_difference": outcome.first or None,
        "shots_behind_the_last_epoch": outcome.late_shots,
        "not_compared": list(outcome.not_compared),
        "chain": chain_object(outcome.chain),
        "points": {
            name: {"mean_mm": list(m.mean_mm), "largest_mm": m.largest_mm, "epochs": m.epochs}
            for name, m in outcome.moved.items()
        },
        "points_lost": outcome.lost,
    }


def replay_passages(outcome: ReplayOutcome) -> list[tuple[str, str]]:
    """What a replay came to: title and text of each passage."""
    run = outcome.run
    late = f", {outcome.late_shots} of them behind the last epoch" if outcome.late_shots else ""
    passages = [("Run", f"{run.run} of {run.site}, catseye {run.versions['catseye']}, {outcome.shots} shots{late}.")]
    passages += [("Chain", text) for text in chain_words(outcome.chain)]
    passages.append(("Not seen", f"{'; '.join(outcome.not_compared)}."))
    if outcome.same:
        passages.append(("Epochs", f"{outcome.epochs} the same bit for bit, and all {outcome.same_shots} shots."))
        return passages
    passages.append(
        (
            "Epochs",
            f"{outcome.same_epochs} of {outcome.epochs} the same bit for bit, {outcome.same_shots} of {outcome.shots} "
            f"shots; the first that differs is {outcome.first}.",
        )
    )
    if outcome.calibrations is None and not run.buffers:
        passages.append(("Why", "the run kept no samples (catseye ziy --keep-buffers keeps them)."))
    for name, m in sorted(outcome.moved.items(), key=lambda pair: -pair[1].largest_mm)[:TOLD]:
        x, y, z = m.mean_mm
        passages.append(
            (name, f"{x:+.3f}, {y:+.3f}, {z:+.3f} mm on the mean of {m.epochs} epochs, at most {m.largest_mm:.3f} mm")
        )
    if len(outcome.moved) > TOLD:
        passages.append(("And", f"{len(outcome.moved) - TOLD} more points, which moved less (--json has them)."))
    return passages
