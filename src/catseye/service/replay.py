"""A run of a journal reduced again: the same to the last bit, or how far other calibrations move its points."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.coordinator.journal.replay import Replayed, replay
from catseye.errors import InputError
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
    first          number of the first epoch that differs, and of what
    moved          by point
    lost           points of stored epochs that the new ones do not have
    """

    run: StoredRun
    calibrations: Path | None
    epochs: int = 0
    shots: int = 0
    same_epochs: int = 0
    same_shots: int = 0
    first: str = ""
    moved: dict[str, Moved] = field(default_factory=dict)
    lost: int = 0

    @property
    def same(self) -> bool:
        """Whether all answers are the same to the last bit."""
        return self.epochs == self.same_epochs and self.shots == self.same_shots


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

        total = sum(1 for _ in reader.solutions(run.run))
        if not total:
            raise InputError(f"journal {reader.place}: run {run.run} holds no epoch (expected one at least)")
        outcome = ReplayOutcome(run, calibrations)
        off: dict[str, list[np.ndarray]] = defaultdict(list)
        for each in replay(reader, run.run, made):
            progress("epochs", outcome.epochs, total)
            _count(outcome, each)
            _compare(outcome, each, off)
    outcome.moved = {name: _moved(np.array(rows) / MILLIMETRE) for name, rows in sorted(off.items())}
    return outcome


def _count(outcome: ReplayOutcome, each: Replayed) -> None:
    outcome.epochs += 1
    outcome.shots += each.shots
    outcome.same_epochs += each.stored.same(each.new)
    outcome.same_shots += each.shots - len(each.differing)
    if not each.same and not outcome.first:
        what = "a shot" if each.differing else "its solution"
        outcome.first = f"epoch {each.stored.answer.get('number')} (event {each.seq}) by {what}"


def _compare(outcome: ReplayOutcome, each: Replayed, off: dict[str, list[np.ndarray]]) -> None:
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
    if outcome.same:
        return Verdict("good", "every answer is the same bit for bit")
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
        "points": {
            name: {"mean_mm": list(m.mean_mm), "largest_mm": m.largest_mm, "epochs": m.epochs}
            for name, m in outcome.moved.items()
        },
        "points_lost": outcome.lost,
    }


def replay_passages(outcome: ReplayOutcome) -> list[tuple[str, str]]:
    """What a replay came to: title and text of each passage."""
    run = outcome.run
    passages = [("Run", f"{run.run} of {run.site}, catseye {run.versions['catseye']}, {outcome.shots} shots.")]
    if outcome.same:
        passages.append(("Epochs", f"{outcome.epochs} the same bit for bit, and all {outcome.shots} shots."))
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
