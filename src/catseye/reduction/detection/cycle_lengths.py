"""Whole cycles and lengths from phases at several modulation frequencies."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ArgumentError, ValidityError
from catseye.names import counted
from catseye.records.night.phase_table import PhaseRow
from catseye.signal.cycles.cascade import cascade_length
from catseye.signal.cycles.frequencies import ModulationSet, choose_frequencies, modulation_set
from catseye.signal.cycles.joint_length import HOPELESS, JointStatus, joint_length
from catseye.signal.cycles.sets import cycle_sets
from catseye.signal.cycles.whole import fraction
from catseye.verdict import Verdict

LONGEST = 10_000.0  # m: beyond, every length between the limits no longer fits into memory


@dataclass(frozen=True)
class ShotLength:
    """Length of one shot, with the certainty of its cycles; nan where unknown.

    shot              name
    frequencies_hz    Hz, the lowest first
    cycles            N of each
    length, u_length  m in air; u from the phases alone, if the cycles are right
    misfit            chi-square of the phases
    next_length       m, the length that fits second best
    discrimination    chi-square of that length less that of the best
    slip_probability  probability of wrong cycles, all lengths between the limits alike before
    cascade_length    m, by steps from the longest beat
    cascade_margin    m, least margin of these steps
    cascade_thin      True where a step is not sure
    status            found, ambiguous, misfit or unknown
    """

    shot: str
    frequencies_hz: tuple[float, ...]
    cycles: tuple[int, ...]
    length: float
    u_length: float
    misfit: float
    next_length: float
    discrimination: float
    slip_probability: float
    cascade_length: float
    cascade_margin: float
    cascade_thin: bool
    status: str


@dataclass(frozen=True, eq=False)
class CycleLengths:
    """Lengths of all shots of a table.

    shots         in its order
    sets          each set of frequencies, with the lengths it separates
    advice        frequencies that would separate all lengths between the limits; None where those of the table do
    within        m, smallest and largest possible length
    group_index   of the air
    rows          the table's, by shot
    """

    shots: tuple[ShotLength, ...]
    sets: tuple[ModulationSet, ...]
    advice: ModulationSet | None
    within: tuple[float, float]
    group_index: float
    rows: Mapping[str, Sequence[PhaseRow]]

    @property
    def verdict(self) -> Verdict:
        """Good where every shot's cycles are sure; failed where none are."""
        lost = [s for s in self.shots if s.status != "found"]
        if len(lost) == len(self.shots):
            return Verdict("failed", f"no shot has sure whole cycles: {lost[0].shot} is {lost[0].status}")
        if lost:
            many = f"{len(lost)} of {counted(len(self.shots), 'shot')}"
            return Verdict("doubtful", f"the whole cycles of {many} are not sure: {lost[0].shot} is {lost[0].status}")
        worst = max(s.slip_probability for s in self.shots)
        return Verdict("good", f"the whole cycles of every shot are sure, probability of others {worst:.1g} at most")

    @property
    def least_sure(self) -> ShotLength:
        """Shot with the largest probability of wrong cycles."""
        return max(self.shots, key=lambda s: s.slip_probability if math.isfinite(s.slip_probability) else 2.0)

    def candidates(self, shot: ShotLength) -> tuple[np.ndarray, np.ndarray]:
        """Lengths, m, and chi-squares of all sets of cycles of a shot within the limits."""
        rows = sorted(self.rows[shot.shot], key=lambda row: row.modulation_hz)
        half = SPEED_OF_LIGHT / (2.0 * np.array([row.modulation_hz for row in rows]))
        u = np.array([row.u_phase_rad for row in rows]) * half / TWO_PI
        phase = fraction([row.phase_rad for row in rows], 0.0)[None]
        low, high = (edge * self.group_index for edge in self.within)
        sets = cycle_sets(phase, half, u[None] ** -2.0, limits=(low, high))
        inside = sets.inside[0]
        return sets.length[0, inside] / self.group_index, sets.misfit[0, inside]


def cycle_lengths(
    rows: Mapping[str, Sequence[PhaseRow]], *, shortest: float, longest: float, group_index: float
) -> CycleLengths:
    """Lengths and whole cycles of shots, by exact search and by cascade.

    rows                of each shot, two frequencies or more
    shortest, longest   m, limits of the lengths
    group_index         mean of the air along the paths, at the light's wavelength

    Source: [PARKER04] eq. 5.18 for each frequency; [LOEFDAHL01] for the problem. Raises ArgumentError for limits or an
    index without meaning, and where the frequencies confuse lengths between the limits within one standard uncertainty.
    """
    if not 0.0 <= shortest < longest <= LONGEST:
        raise ArgumentError(
            f"shortest = {shortest:g} and longest = {longest:g} m (expected 0 or more, and a longer one of "
            f"{LONGEST:g} m at most)",
            "shortest",
            "longest",
        )
    if not 1.0 <= group_index <= 1.001:
        raise ArgumentError(f"group_index = {group_index} (expected 1 to 1.001)", "group_index")
    shot_lengths: dict[str, ShotLength] = {}
    sets = []
    groups: dict[tuple[float, ...], list[str]] = {}
    for name, mine in rows.items():
        groups.setdefault(tuple(sorted(row.modulation_hz for row in mine)), []).append(name)
    for frequencies, names in groups.items():
        by_shot = [sorted(rows[name], key=lambda row: row.modulation_hz) for name in names]
        u = np.array([[row.u_phase_rad for row in shot] for shot in by_shot])
        sets.append(
            modulation_set(frequencies, u_phase=u.max(axis=0), span=longest - shortest, group_index=group_index)
        )
        phase = fraction([[row.phase_rad for row in shot] for shot in by_shot], 0.0)
        _refuse_confusion(frequencies, u.min(axis=0), (shortest, longest), group_index=group_index, rows=rows)
        joint = joint_length(phase, frequencies, u_phase=u, within=(shortest, longest), group_index=group_index)
        for k, name in enumerate(names):
            steps = cascade_length(
                phase[k], frequencies, u_phase=float(u[k].max()), low=shortest, group_index=group_index
            )
            shot_lengths[name] = ShotLength(
                shot=name,
                frequencies_hz=frequencies,
                cycles=tuple(int(n) for n in joint.cycles[k]),
                length=float(joint.length[k]),
                u_length=float(joint.u_length[k]),
                misfit=float(joint.misfit[k]),
                next_length=float(joint.next_length[k]),
                discrimination=float(joint.discrimination[k]),
                slip_probability=float(joint.slip_probability[k]),
                cascade_length=float(steps.length),
                cascade_margin=float(np.min(steps.margin)),
                cascade_thin=bool(steps.thin),
                status=JointStatus(int(joint.status[k])).name.lower(),
            )
    advice = None
    if not all(item.unambiguous for item in sets):
        advice = _advice(longest - shortest, rows, group_index)
    return CycleLengths(
        shots=tuple(shot_lengths[name] for name in rows),
        sets=tuple(sets),
        advice=advice,
        within=(shortest, longest),
        group_index=group_index,
        rows=rows,
    )


def _refuse_confusion(
    frequencies: tuple[float, ...],
    u_phase: np.ndarray,
    within: tuple[float, float],
    *,
    group_index: float,
    rows: Mapping[str, Sequence[PhaseRow]],
) -> None:
    """Raise ArgumentError where one standard uncertainty of phase confuses two lengths."""
    span = within[1] - within[0]
    plan = modulation_set(frequencies, u_phase=u_phase, span=span, group_index=group_index)
    if plan.separation >= 2.0 * HOPELESS:
        return
    better = _advice(span, rows, group_index)
    remedy = "bring shortest and longest closer"
    if better is not None:
        remedy += f", or measure at {', '.join(f'{hz / 1e6:.9g}' for hz in better.frequencies_hz)} MHz"
    raise ArgumentError(
        f"frequencies {', '.join(f'{hz / 1e6:.9g}' for hz in frequencies)} MHz confuse lengths {plan.nearest:.3f} m "
        f"apart: {plan.separation / 2.0:.1f} standard uncertainties of phase between them (limit "
        f"{HOPELESS:g}); {remedy}",
        "shortest",
        "longest",
    )


def _advice(span: float, rows: Mapping[str, Sequence[PhaseRow]], group_index: float) -> ModulationSet | None:
    """Frequencies that separate all lengths of a span to SURE standard uncertainties; None if none do."""
    every = [row for mine in rows.values() for row in mine]
    u, lowest = max(row.u_phase_rad for row in every), min(row.modulation_hz for row in every)
    try:
        return choose_frequencies(span, u_phase=u, lowest_hz=lowest, group_index=group_index)
    except ValidityError:
        return None
