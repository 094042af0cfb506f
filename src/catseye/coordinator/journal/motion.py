"""Motion of the telescope in a journal, for a campaign: postures and jitter."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.ranger.line import stamp_text
from catseye.records.night.jitter import JITTER, LARGEST_MM, JitterRow
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture
from catseye.records.night.postures import NEAREST, POSTURES, PostureRow
from catseye.reduction.live.live import LiveSettings
from catseye.reduction.site.motion import PostureTrack

FASTEST = 1.0 * DEGREE  # rad/s: the GBT slews at 0.67 in azimuth
STEADY = 0.01 * DEGREE  # rad, largest motion not reported
MARGIN = round(NEAREST * TICKS_PER_DAY)  # ticks from a shot to a posture
EPOCH_MARGIN = round(60.0 / SECONDS_PER_DAY * TICKS_PER_DAY)  # ticks, of an epoch after its last shot


@dataclass(frozen=True)
class MotionRows:
    """Posture, postures and jitter of an exported campaign.

    posture    azimuth and elevation, rad, median over the campaign; None if unknown
    wrong      reason why the postures are invalid; "" if valid
    postures   rows, if the telescope moved
    jitter     rows
    """

    posture: tuple[float, float] | None
    postures: tuple[PostureRow, ...]
    jitter: tuple[JitterRow, ...]
    wrong: str = ""


@dataclass(frozen=True, eq=False)
class JournalMotion:
    """Postures of a run in time order, without duplicate times, and the reader of its epochs."""

    reader: JournalReader
    run: int
    postures: list[LivePosture]

    @classmethod
    def of(cls, reader: JournalReader, run: int, span: tuple[int, int] | None) -> "JournalMotion":
        """Motion of a run, within a span of ticks ± two seconds."""
        by_ticks = {
            entry.ticks: entry
            for _, entry in reader.events(run, kinds=["postures"])
            if isinstance(entry, LivePosture) and (span is None or span[0] - MARGIN <= entry.ticks < span[1] + MARGIN)
        }
        return cls(reader, run, [by_ticks[ticks] for ticks in sorted(by_ticks)])

    @cached_property
    def moved(self) -> float:
        """Largest change of an angle, rad."""
        return self._moved(self.postures)

    def lacks(self, ticks: int) -> bool:
        """True where the telescope moved and no posture is near a time."""
        if self.moved <= STEADY:
            return False
        times = self._ticks
        at = int(np.searchsorted(times, ticks))
        return bool(np.min(np.abs(times[max(at - 1, 0) : at + 1] - ticks)) > MARGIN)

    def during(self, span: tuple[int, int], notes: list[str]) -> MotionRows:
        """Motion from the first shot to the last, ticks; notes describe what moved."""
        within = [read for read in self.postures if span[0] <= read.ticks <= span[1]]
        if not within:
            return MotionRows(None, (), self._jitter(span, 0.0, notes))
        moved = self._moved(within)
        if moved <= STEADY:
            azimuth, elevation = np.unwrap([r.azimuth for r in within]), [r.elevation for r in within]
            median = float(np.median(azimuth)), float(np.median(elevation))
            return MotionRows(median, (), self._jitter(span, 0.0, notes))
        notes.append(f"the telescope moved by {moved / DEGREE:.3f} deg: {POSTURES} says how")
        near = [read for read in self.postures if span[0] - MARGIN <= read.ticks <= span[1] + MARGIN]
        middle = PostureTrack.of(near).angles(0.5 * (span[0] + span[1]) / TICKS_PER_DAY)
        climbed = float(np.ptp([read.elevation for read in within])) / DEGREE
        wrong = _jump(near)
        notes += [wrong] * bool(wrong)
        return MotionRows(middle, tuple(_row(read) for read in near), self._jitter(span, climbed, notes), wrong)

    @cached_property
    def _ticks(self) -> NDArray[np.int64]:
        return np.array([read.ticks for read in self.postures], dtype=np.int64)

    @staticmethod
    def _moved(reads: list[LivePosture]) -> float:
        if not reads:
            return 0.0
        return max(float(np.ptp(np.unwrap([r.azimuth for r in reads]))), float(np.ptp([r.elevation for r in reads])))

    def _jitter(self, span: tuple[int, int], climbed: float, notes: list[str]) -> tuple[JitterRow, ...]:
        """Jitter of the bodies by epoch, and their bending while the telescope climbed, deg.

        Journals of older versions lack the first: the run's setting is used.
        """
        jitter: dict[tuple[int, str], float] = {}
        for _, solution in self.reader.solutions(self.run):
            ticks = solution.answer.get("ticks", solution.ticks)
            if span[0] <= ticks <= span[1] + EPOCH_MARGIN:
                jitter |= {(ticks, body): mm for body, mm in (solution.answer.get("jitter_mm") or {}).items()}
        live = self.reader.run(self.run).settings.get("live")
        settings = live if isinstance(live, Mapping) else {}
        if not jitter:
            usual = settings.get("jitter_mm")
            jitter = {(span[0], str(body)): mm for body, mm in (usual if isinstance(usual, Mapping) else {}).items()}
            if jitter:
                notes.append(f"the journal's epochs have no jitter: {JITTER} has the run's setting")
        bending = settings.get("bending_mm_per_degree", LiveSettings().bending_mm_per_degree)
        bent = {body: mm * climbed / math.sqrt(12.0) for body, mm in bending.items()}  # uniform over the climb
        try:
            return tuple(
                JitterRow.model_validate(
                    {"mjd_utc": float(stamp_text(ticks)), "body": body, "u_mm": math.hypot(mm, bent.get(body, 0.0))}
                )
                for (ticks, body), mm in sorted(jitter.items())
            )
        except (ValidationError, TypeError) as problem:
            raise InputError(
                f"journal {self.reader.place}: run {self.run}: jitter_mm of an epoch is invalid (expected 0 to "
                f"{LARGEST_MM:g} mm of arm, dish and alidade)"
            ) from problem


def _jump(reads: list[LivePosture]) -> str:
    """Text on two readings further apart than the telescope can move meanwhile; "" if none."""
    for before, after in pairwise(reads):
        seconds = (after.ticks - before.ticks) * TICK_SECONDS
        turned = abs((after.azimuth - before.azimuth + math.pi) % (2.0 * math.pi) - math.pi)
        apart = max(turned, abs(after.elevation - before.elevation))
        if apart > STEADY + FASTEST * seconds:
            jumped = f"the telescope moved by {apart / DEGREE:.3f} deg in {seconds:.3f} s"
            return f"{jumped}, by the posture at {stamp_text(after.ticks)}: postures are invalid"
    return ""


def _row(read: LivePosture) -> PostureRow:
    azimuth, elevation, *rates = (
        value / DEGREE for value in (read.azimuth, read.elevation, read.azimuth_rate, read.elevation_rate)
    )
    return PostureRow(
        mjd_utc=float(stamp_text(read.ticks)),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        azimuth_rate_deg_s=rates[0],
        elevation_rate_deg_s=rates[1],
    )
