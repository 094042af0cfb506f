"""Reduce a journal's run again and compare it with its answers."""

import math
import platform
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE
from catseye.coordinator.journal.check import ChainReport, verify_run
from catseye.coordinator.journal.movement import Movement, Movements, Moving, in_u, places, point_moves
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.coordinator.journal.replay import Replayed, replay
from catseye.coordinator.journal.sameness import Sameness
from catseye.errors import InputError
from catseye.gateways.journal.chain import chain_object, chain_words
from catseye.gateways.journal.movement import movement_object, movement_words, shown
from catseye.records.site.folder import SiteFolder, read_site
from catseye.reduction.live.live import Live
from catseye.service.settings import live_settings
from catseye.verdict import Verdict
from catseye.version import __version__

SHOWN_POINTS = 20  # points shown to people: those that move most
LEAST_SHOWN_MM = 5e-4  # a smaller change is zero in three decimals


class Cause(StrEnum):
    """Cause of a replay's differing numbers; the value is for programs."""

    RECORDS = "records"  # other records were given
    JOURNAL = "journal"  # it fails verification
    SAMPLES = "samples"  # none were stored
    SOFTWARE = "software"  # all else is the run's own: catseye, what it computes with, or the machine's rounding


@dataclass(frozen=True)
class Moved:
    """Difference of a point, new less stored, over epochs.

    mean_mm      (x, y, z)
    largest_mm   length
    largest_u    of a coordinate over its stored u; NaN if none was stored
    epochs       number of epochs
    """

    mean_mm: tuple[float, float, float]
    largest_mm: float
    largest_u: float
    epochs: int


@dataclass
class ReplayOutcome:
    """Result of a replay: counts of equal answers, and differences.

    "Same" applies to numbers, reason codes and statuses, to the last bit; "identical" includes texts.

    run                the run replayed
    calibrations       folder of other records, None for the run's own
    epochs, shots      fed
    same_epochs, identical_epochs   by their solutions
    same_shots, identical_shots     by their answers
    late_shots         of all shots, those after the last epoch
    unasked            shots without a stored answer: not compared
    chain              report on the journal's chain for the run
    first              number of the first epoch that differs, and by what
    parts              of solutions that differ: in how many epochs
    unstored           keys that only the new answers have: not compared
    movements          by kind, in its unit and in u
    moved              by point
    lost               points of stored epochs that the new ones do not have
    """

    run: StoredRun
    calibrations: Path | None
    chain: ChainReport
    epochs: int = 0
    shots: int = 0
    same_epochs: int = 0
    identical_epochs: int = 0
    same_shots: int = 0
    identical_shots: int = 0
    late_shots: int = 0
    unasked: int = 0
    first: str = ""
    parts: Counter[str] = field(default_factory=Counter)
    unstored: set[str] = field(default_factory=set)
    movements: dict[Moving, Movement] = field(default_factory=dict)
    moved: dict[str, Moved] = field(default_factory=dict)
    lost: int = 0

    @property
    def sameness(self) -> Sameness:
        """Sameness of the whole run, solutions and shots."""
        compared = self.shots - self.unasked
        if (self.same_epochs, self.same_shots) != (self.epochs, compared):
            return Sameness.DIFFERENT
        identical = (self.identical_epochs, self.identical_shots) == (self.epochs, compared)
        return Sameness.IDENTICAL if identical else Sameness.TEXTS

    @property
    def same(self) -> bool:
        """True if numbers, codes and statuses agree to the last bit."""
        return self.sameness is not Sameness.DIFFERENT

    @property
    def identical(self) -> bool:
        """True if all answers agree to the last bit, texts included."""
        return self.sameness is Sameness.IDENTICAL

    @property
    def cause(self) -> Cause | None:
        """Cause of differing numbers, None if none differs.

        With the run's own records, journal and samples it is the software. A version's name does not decide it: many
        states of the source may have one name.
        """
        if self.same:
            return None
        if self.calibrations is not None:
            return Cause.RECORDS
        if self.chain.count:
            return Cause.JOURNAL
        return Cause.SOFTWARE if self.run.buffers else Cause.SAMPLES

    @property
    def verdict(self) -> Verdict:
        """Verdict: the same numbers to the last bit, or the cause and size."""
        chain = self.chain
        if chain.count:
            return Verdict("failed", f"the journal fails verification: {chain.problems[0]}")
        if self.same:
            unverified = "" if chain.chained else "; written by an older catseye without a chain to verify"
            if self.identical:
                return Verdict("good", f"every answer is the same bit for bit{unverified}")
            same = "every number, reason code and status is the same bit for bit"
            return Verdict("good", f"{same}, texts are another version's{unverified}")
        if self.cause is Cause.RECORDS:
            furthest = max((m.largest_mm for m in self.moved.values()), default=0.0)
            return Verdict("good", f"reduced with other records, which change points by up to {furthest:.3f} mm")
        if self.cause is Cause.SAMPLES:
            return Verdict("doubtful", "the run stored no samples, so its answers cannot be reproduced bit for bit")
        by = f"this version changes the run's answers: {_how_far(self)}, first {self.first}"
        if self.other_version:
            return Verdict("doubtful", by)
        return Verdict("failed", f"{by}; a version of the same name should not")

    @property
    def other_version(self) -> bool:
        """True if another catseye, Python or numpy wrote the run."""
        return self.run.versions != versions_here()

    @property
    def not_compared(self) -> tuple[str, ...]:
        """Parts of a run that a replay does not compare."""
        parts = [f"{self.unasked} shots whose answer was not stored"] * bool(self.unasked)
        if self.unstored:
            parts.append(f"what the journal's version did not store ({', '.join(sorted(self.unstored))})")
        return (*parts, "commands, happenings and all other documents, which the reduction does not use")


def versions_here() -> dict[str, str]:
    """Versions of this software by name, as in a run's record."""
    return {"catseye": __version__, "python": platform.python_version(), "numpy": np.__version__}


def replayed(journal: str, which: int | str | None, calibrations: Path | None, *, progress: Progress) -> ReplayOutcome:
    """Reduce a run again, with its own records or others.

    Raises InputError: no such journal, run or folder; a run without its settings, or without solutions.
    """
    records = None if calibrations is None else read_site(calibrations)
    with JournalReader(journal) as reader:
        run = reader.run(which)
        settings = live_settings(run.settings, f"journal {reader.place}: run {run.run}")
        movements = Movements()

        def new_live(site: SiteFolder, _: StoredRun) -> Live:
            movements.stations = [station.name for station in site.site.weather_station]
            return Live(site if records is None else records, settings)

        chain = verify_run(reader, run.run, progress=progress)
        if chain.bad:  # altered entries are skipped: the differences show their weight
            reader.left_out = {run.run: chain.bad}
        total = sum(1 for _ in reader.solutions(run.run))
        if not total:
            raise InputError(f"journal {reader.place}: run {run.run} contains no epoch (expected at least one)")
        outcome = ReplayOutcome(run, calibrations, chain)
        off: dict[str, list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
        for epoch in replay(reader, run.run, new_live):
            progress("epochs", outcome.epochs, total)
            _count(outcome, epoch)
            _compare(outcome, epoch, off)
            movements.add(epoch)
    outcome.movements = movements.found
    outcome.moved = {name: _moved(rows) for name, rows in sorted(off.items())}
    return outcome


def _count(outcome: ReplayOutcome, epoch: Replayed) -> None:
    shots, solution = epoch.shots, epoch.solution
    same_shots = shots.count - len(shots.differing) - len(shots.unasked)
    outcome.shots += shots.count
    outcome.same_shots += same_shots
    outcome.identical_shots += same_shots - len(shots.reworded)
    outcome.unasked += len(shots.unasked)
    if epoch.stored is None:
        outcome.late_shots += shots.count
        where = f"shots after the last epoch (event {shots.differing[0]})" if shots.differing else ""
    else:
        outcome.epochs += 1
        outcome.same_epochs += solution.sameness is not Sameness.DIFFERENT
        outcome.identical_epochs += solution.sameness is Sameness.IDENTICAL
        outcome.parts.update(solution.parts)
        outcome.unstored.update(solution.unstored)
        what = "a shot" if shots.differing else f"its solution ({', '.join(solution.parts)})"
        where = f"epoch {epoch.stored.answer.get('number')} (event {epoch.seq}) by {what}"
    if not epoch.same and not outcome.first:
        outcome.first = where


def _compare(outcome: ReplayOutcome, epoch: Replayed, off: dict[str, list[tuple[np.ndarray, np.ndarray]]]) -> None:
    if epoch.stored is None or epoch.new is None:
        return
    outcome.lost += len(set(places(epoch.stored)) - set(places(epoch.new)))
    for name, change, u in point_moves(epoch.stored, epoch.new):
        off[name].append((change, u))


def _moved(rows: list[tuple[np.ndarray, np.ndarray]]) -> Moved:
    changes, u = (np.array(column) for column in zip(*rows, strict=True))
    x, y, z = (changes.mean(axis=0) / MILLIMETRE).tolist()
    over = np.abs(in_u(changes, u))
    largest = float(np.linalg.norm(changes, axis=1).max()) / MILLIMETRE
    return Moved((x, y, z), largest, float(over.max()) if len(over) else math.nan, len(rows))


def _how_far(outcome: ReplayOutcome) -> str:
    """Largest change of a point in words."""
    points = outcome.movements.get(Moving.POINTS)
    if points is None or not points.largest.size:
        return "no point changes"
    largest = f"points by up to {shown(points.largest.size / MILLIMETRE)} mm"
    return largest if points.largest_u is None else f"{largest}, {shown(points.largest_u.size)} of a coordinate's u"


def replay_object(outcome: ReplayOutcome) -> dict[str, Any]:
    """JSON object of `catseye replay --json`."""
    return {
        "verdict": outcome.verdict.to_object(),
        "run": outcome.run.run,
        "uuid": outcome.run.uuid,
        "site": outcome.run.site,
        "calibrations": None if outcome.calibrations is None else str(outcome.calibrations),
        "versions": {"stored": outcome.run.versions, "here": versions_here()},
        "epochs": outcome.epochs,
        "epochs_same": outcome.same_epochs,
        "epochs_identical": outcome.identical_epochs,
        "shots": outcome.shots,
        "shots_same": outcome.same_shots,
        "shots_identical": outcome.identical_shots,
        "same": outcome.same,
        "identical": outcome.identical,
        "cause": outcome.cause,
        "first_difference": outcome.first or None,
        "parts_differing": dict(sorted(outcome.parts.items())),
        "shots_behind_the_last_epoch": outcome.late_shots,
        "not_compared": list(outcome.not_compared),
        "chain": chain_object(outcome.chain),
        "moved": movement_object(outcome.movements),
        "points": {
            name: {
                "mean_mm": list(m.mean_mm),
                "largest_mm": m.largest_mm,
                "largest_u": m.largest_u,
                "epochs": m.epochs,
            }
            for name, m in outcome.moved.items()
        },
        "points_lost": outcome.lost,
    }


def replay_passages(outcome: ReplayOutcome) -> list[tuple[str, str]]:
    """Result of a replay: title and text of each passage."""
    run = outcome.run
    late = f", {outcome.late_shots} of them after the last epoch" if outcome.late_shots else ""
    passages = [("Run", f"{run.run} of {run.site}, catseye {run.versions['catseye']}, {outcome.shots} shots{late}.")]
    passages += [("Chain", text) for text in chain_words(outcome.chain)]
    passages.append(("Not compared", f"{'; '.join(outcome.not_compared)}."))
    if outcome.identical:
        passages.append(("Epochs", f"{outcome.epochs} the same bit for bit, and all {outcome.same_shots} shots."))
        return passages
    if outcome.same:
        return [*passages, ("Epochs", _reworded(outcome))]
    passages.append(
        (
            "Epochs",
            f"{outcome.same_epochs} of {outcome.epochs} the same bit for bit, {outcome.same_shots} of {outcome.shots} "
            f"shots; the first difference is {outcome.first}.",
        )
    )
    if outcome.parts:
        counts = (f"{part} in {n}" for part, n in sorted(outcome.parts.items()))
        passages.append(("Differing", f"{', '.join(counts)} of {outcome.epochs} epochs; texts do not count."))
    passages += [("Why", why) for why in _why(outcome)]
    passages += movement_words(outcome.movements)
    furthest = sorted(outcome.moved.items(), key=lambda pair: -pair[1].largest_mm)
    largest = [pair for pair in furthest[:SHOWN_POINTS] if pair[1].largest_mm >= LEAST_SHOWN_MM]
    passages += [(name, _point_words(m)) for name, m in largest]
    if len(furthest) > len(largest):
        passages.append(("And", f"{len(furthest) - len(largest)} more points with smaller changes (in the JSON)."))
    return passages


def _reworded(outcome: ReplayOutcome) -> str:
    """Counts for a run that differs only in texts."""
    compared = outcome.shots - outcome.unasked
    return (
        f"{outcome.epochs} with the same numbers, reason codes and statuses bit for bit, and all {outcome.same_shots} "
        f"shots; {outcome.epochs - outcome.identical_epochs} epochs and {compared - outcome.identical_shots} shots "
        "have texts of another version."
    )


def _why(outcome: ReplayOutcome) -> list[str]:
    """Causes of differing numbers, in sentences."""
    if outcome.cause is Cause.SAMPLES:
        return ["the run stored no samples: its coordinator was asked to keep no buffers."]
    if outcome.cause is not Cause.SOFTWARE:
        return []
    stored, current = (
        ", ".join(f"{name} {version}" for name, version in versions.items())
        for versions in (outcome.run.versions, versions_here())
    )
    if outcome.other_version:
        causes = [f"samples and records are the run's own, so the software differs: {stored} then, {current} now."]
    else:
        causes = [
            f"samples and records are the run's own, so the software differs: another build of {current}, or another "
            "machine's rounding."
        ]
    if not outcome.chain.chained:
        causes.append("the journal has no chain, so a changed file cannot be distinguished from changed software.")
    return causes


def _point_words(m: Moved) -> str:
    """Change of a point in words."""
    x, y, z = m.mean_mm
    in_u = "" if math.isnan(m.largest_u) else f", {shown(m.largest_u)} of its u"
    epochs = f"on the mean of {m.epochs} epochs"
    return f"{x:+.3f}, {y:+.3f}, {z:+.3f} mm {epochs}, at most {shown(m.largest_mm)} mm{in_u}"
