"""Whole cycles of lines measured at several modulation frequencies.

One optical length carries the phases of all frequencies, so their differences say how many whole half wavelengths
there are, without an approximate coordinate that is good to a quarter wavelength. The i-th shots on a line at each
frequency make a set; its length is searched for exactly, `signal.cycles.joint_length`, up to REACH from the
approximate one. A set whose phases fit no common length stays without: one of its shots is wrong, or a frequency.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.errors import InputError, ValidityError
from catseye.names import counted, megahertz
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.head import head_corrections, head_unknowns, radian_length
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.site.places import RangedPoint, places_of
from catseye.signal.cycles.frequencies import modulation_set
from catseye.signal.cycles.joint_length import JointStatus, joint_length
from catseye.signal.cycles.whole import fraction

REACH = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2)  # m, largest errors of an approximate length that are searched
INDEX = 1.00027  # group index of air, to 1e-4: 10 mm in 100 m, of an approximate length
SYSTEMATIC = 0.1  # share of sets without a common length, from which a record is to blame rather than shots
LISTED = 6  # sets that disagree, in a note
HOPELESS = 0.5  # share of them from which no answer is worth anything
RESTORED = 0.9  # share of them that must fit without the frequency to blame,
ALONE = 0.75  # and the largest share of that which may fit without another


@dataclass(frozen=True)
class FrequencySet:
    """Shots on one line at several frequencies, and the whole cycles that they give.

    ranger, target    names
    shots             indices into the campaign's shots, one a frequency
    frequencies_hz    of each, Hz
    cycles            whole half wavelengths of each; -1 where unknown
    reach             m, error of the approximate length up to which was searched; 0 where the frequencies tell nothing
    off               m, optical length less the approximate one; nan where unknown
    u_off             m, by the phases alone
    misfit            chi-square of the phases
    slip_probability  of wrong cycles, if all phases are good; 1 where unknown
    status            found, ambiguous, misfit, unknown, or contradicted by the other lines
    """

    ranger: str
    target: str
    shots: tuple[int, ...]
    frequencies_hz: tuple[float, ...]
    cycles: tuple[int, ...]
    reach: float
    off: float
    u_off: float
    misfit: float
    slip_probability: float
    status: str


@dataclass(frozen=True)
class FrequencyCycles:
    """Sets of a campaign, and a frequency that disagrees with the others.

    disagreement   reason against a good verdict; "" without
    blamed_hz      frequency without which the others agree; nan for none
    """

    sets: tuple[FrequencySet, ...] = ()
    disagreement: str = ""
    blamed_hz: float = np.nan

    def without(self, shots: set[int]) -> "FrequencyCycles":
        """Sets, those with any of some shots contradicted."""
        sets = tuple(replace(s, status="contradicted") if shots.intersection(s.shots) else s for s in self.sets)
        return replace(self, sets=sets)

    def cycles_of_shots(self, count: int) -> np.ndarray:
        """Whole cycles (count,) of the campaign's shots, -1 where unknown."""
        cycles = np.full(count, -1)
        for s in self.sets:
            if s.status == "found":
                cycles[list(s.shots)] = s.cycles
        return cycles

    def notes(self) -> list[str]:
        """Notes on the way the whole cycles were found, and on sets that disagree, one line each."""
        if not self.sets:
            return []
        count = Counter(s.status for s in self.sets)
        sure = [s for s in self.sets if s.status == "found"]
        modulations = sorted({hz for s in self.sets for hz in s.frequencies_hz})
        text = (
            f"whole cycles of {len(sure)} of {counted(len(self.sets), 'set')} of shots on one line by frequencies "
            f"({', '.join(map(megahertz, modulations))})"
        )
        if sure:
            text += (
                f", up to {min(s.reach for s in sure):g} m from the approximate lengths, each wrong with a "
                f"probability of {max(s.slip_probability for s in sure):.1g} at most"
            )
        notes = [text + ("" if len(sure) == len(self.sets) else "; the others' by coordinates")]
        misfits = [s for s in self.sets if s.status in ("misfit", "contradicted")]
        if misfits:
            listed = ", ".join(f"{s.ranger} {s.target}" for s in misfits[:LISTED])
            listed += " ..." if len(misfits) > LISTED else ""
            notes.append(
                f"frequencies disagree in {counted(len(misfits), 'set')}: {listed}: a stray reflection or a wrong "
                "modulation_hz of one shot"
            )
        if count["ambiguous"]:
            notes.append(
                f"frequencies do not tell the whole cycles of {counted(count['ambiguous'], 'set')} apart: "
                "measure at frequencies farther apart, or longer"
            )
        return notes + ([self.disagreement] if self.disagreement else [])


@dataclass(frozen=True, eq=False)
class _Sets:
    """Sets of equal frequencies.

    shots       (s, k) indices into the campaign's shots
    half        (k,) m, half wavelengths in vacuum
    phase       (s, k) rad, after the electronics', head corrected by its sheet
    u           (s, k) rad
    coarse      (s,) m, approximate optical length
    """

    frequencies: tuple[float, ...]
    ends: list[tuple[str, str]]
    shots: np.ndarray
    half: np.ndarray
    phase: np.ndarray
    u: np.ndarray
    coarse: np.ndarray

    def only(self, columns: Sequence[int]) -> "_Sets":
        """Sets without some of their frequencies."""
        at = list(columns)
        return replace(
            self,
            frequencies=tuple(self.frequencies[i] for i in at),
            shots=self.shots[:, at],
            half=self.half[at],
            phase=self.phase[:, at],
            u=self.u[:, at],
        )

    @property
    def reach(self) -> float:
        """Error of the approximate length up to which the frequencies tell lengths apart, m; 0 for none."""
        u = np.median(self.u, axis=0)
        for reach in REACH:
            if modulation_set(self.frequencies, u_phase=u, span=2.0 * reach).unambiguous:
                return reach
        return 0.0

    def solved(self) -> list[FrequencySet]:
        """Each set with its whole cycles."""
        reach, k = self.reach, len(self.frequencies)
        blank = [
            FrequencySet(
                ranger=ranger,
                target=target,
                shots=tuple(shots),
                frequencies_hz=self.frequencies,
                cycles=(-1,) * k,
                reach=reach,
                off=np.nan,
                u_off=np.nan,
                misfit=np.nan,
                slip_probability=1.0,
                status="ambiguous",
            )
            for (ranger, target), shots in zip(self.ends, self.shots.tolist(), strict=True)
        ]
        within = reach or REACH[0]  # what cannot tell lengths apart may still fit none
        turns = self.coarse[:, None] / self.half
        try:  # the phases of the difference from the approximate length: the same limits for all
            joint = joint_length(
                fraction(self.phase + TWO_PI * turns, 0.0), self.frequencies, u_phase=self.u, within=(-within, within)
            )
        except ValidityError:  # so noisy that nothing tells lengths apart
            return blank
        length = self.coarse + joint.length
        cycles = np.rint(np.nan_to_num(length[:, None] / self.half) + self.phase / TWO_PI).astype(int)
        return [
            replace(
                s,
                cycles=tuple(cycles[i].tolist()),
                off=float(joint.length[i]),
                u_off=float(joint.u_length[i]),
                misfit=float(joint.misfit[i]),
                slip_probability=float(joint.slip_probability[i]),
                status=_status(JointStatus(int(joint.status[i])), reach),
            )
            for i, s in enumerate(blank)
        ]


def _status(status: JointStatus, reach: float) -> str:
    return "ambiguous" if status is JointStatus.FOUND and reach == 0.0 else status.name.lower()


def frequency_cycles(
    campaign: ObservedSite, phases: Phases, electronics: Mapping[str, ElectronicsPhase]
) -> FrequencyCycles:
    """Whole cycles of all lines measured at two frequencies or more.

    Nothing for a campaign whose shots all have the site's frequency.

    Source: [PARKER04] eq. 5.18 for each frequency, section 5.2: changing the modulation frequency resolves the whole
    cycles.
    """
    if not campaign.several_frequencies:
        return FrequencyCycles()
    places = places_of(campaign)
    frequency_sets: list[FrequencySet] = []
    groups = list(_groups(campaign, phases, electronics, places))
    for group in groups:
        frequency_sets += group.solved()
    frequency_sets.sort(key=lambda s: s.shots)
    return FrequencyCycles(tuple(frequency_sets), *_disagreement(groups, frequency_sets))


def _groups(
    campaign: ObservedSite,
    phases: Phases,
    electronics: Mapping[str, ElectronicsPhase],
    places: Mapping[str, RangedPoint],
) -> Iterator[_Sets]:
    """All sets, grouped by their frequencies."""
    rows: dict[int, tuple[float, float, float]] = {}
    for name, part in electronics.items():
        if len(part.shots):
            values = _corrected(campaign, phases, name, part, places)
            rows.update(zip(part.shots.tolist(), zip(*(v.tolist() for v in values), strict=True), strict=True))
    by_frequencies: dict[tuple[float, ...], list[tuple[tuple[str, str], list[int]]]] = {}
    lines: dict[tuple[str, str], dict[float, list[int]]] = {}
    for k in sorted(rows):
        hz = float(campaign.modulation_of(np.array([k]))[0])
        lines.setdefault((campaign.shots.ranger[k], campaign.shots.target[k]), {}).setdefault(hz, []).append(k)
    for ends, by_hz in lines.items():
        for i in range(max(map(len, by_hz.values()))):
            present = tuple(hz for hz in sorted(by_hz) if i < len(by_hz[hz]))
            if len(present) > 1:
                by_frequencies.setdefault(present, []).append((ends, [by_hz[hz][i] for hz in present]))
    for frequencies, sets in sorted(by_frequencies.items()):
        shots = np.array([mine for _, mine in sets])
        table = np.array([[rows[k] for k in mine] for _, mine in sets])
        yield _Sets(
            frequencies=frequencies,
            ends=[ends for ends, _ in sets],
            shots=shots,
            half=campaign.half_wavelengths(shots[0]),
            phase=table[:, :, 0],
            u=table[:, :, 1],
            coarse=table[:, :, 2].mean(axis=1),
        )


def _corrected(
    campaign: ObservedSite,
    phases: Phases,
    name: str,
    part: ElectronicsPhase,
    places: Mapping[str, RangedPoint],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phases (m,) of one ranger's shots with its sheet's corrections, rad, their u, and approximate lengths, m.

    The u is that of what differs between the frequencies: noise, electronics, leakage, the head's effects, and the
    path's fluctuation between shots.
    """
    rows = part.shots
    targets = [campaign.shots.target[k] for k in rows]
    mirror, half = campaign.mirror_of(name), campaign.half_wavelengths(rows)
    modulation = campaign.modulation_of(rows)
    sight = np.array([places[t].start for t in targets]) - places[name].start
    distance = np.linalg.norm(sight, axis=1)
    phase, lit = fraction(phases.phase[rows], part.phase), phases.phasor[rows]
    at: dict[Parameter, int] = {}
    u_unknown: list[float] = []
    for unknown in head_unknowns(campaign, name):
        at[unknown.quantity] = len(u_unknown)
        common = unknown.quantity.kind is ParameterKind.AXES  # a length, the same at all frequencies
        u_unknown += [0.0 if common else unknown.u] * len(unknown.parts)
    head = head_corrections(
        campaign,
        name,
        at,
        sight=sight,
        phase=phase,
        amplitude=np.abs(lit),
        reference_amplitude=np.abs(part.reference),
        per_radian=radian_length(modulation, np.full(len(rows), INDEX)),
    )
    per_metre = TWO_PI * INDEX / half
    variance = part.covariance if part.covariance.ndim == 1 else np.diag(part.covariance)
    u_leakage = np.array([mirror.at_modulation(hz).u_leakage_volt for hz in modulation.tolist()])
    terms = [
        phases.u_phase[rows],
        np.sqrt(variance),
        u_leakage * np.abs(1.0 / lit - 1.0 / part.reference),
        per_metre * np.sqrt(np.sum((head.slopes * np.array(u_unknown)[head.columns]) ** 2, axis=1))
        if u_unknown
        else np.zeros(len(rows)),
        per_metre * campaign.site.ranging.path_index_fluctuation_ppm * PPM * distance,
        np.full(len(rows), mirror.u_feedback_rad or 0.0),
    ]
    glass = np.array([places[t].constant for t in targets])
    coarse = INDEX * (distance - glass - mirror.d0_mm * MILLIMETRE)
    return phase - per_metre * head.value, np.linalg.norm(terms, axis=0), coarse


def _disagreement(groups: Sequence[_Sets], frequency_sets: Sequence[FrequencySet]) -> tuple[str, float]:
    """Sentence where so many sets fit no common length that a frequency must be wrong, "" otherwise; and which.

    Raises InputError where more than HOPELESS of them fit none, and nothing decides which frequency is wrong.
    """
    bad = sum(s.status == "misfit" for s in frequency_sets)
    if bad <= SYSTEMATIC * len(frequency_sets):
        return "", np.nan
    modulations = sorted({hz for group in groups for hz in group.frequencies})
    fits = {hz: _share_without(groups, hz) for hz in modulations} if len(modulations) > 2 else {}
    text = f"modulation frequencies disagree in {bad} of {counted(len(frequency_sets), 'set')} of shots on one line"
    if fits:
        best = max(fits, key=lambda hz: fits[hz])
        second = max(share for hz, share in fits.items() if hz != best)
        if fits[best] >= RESTORED and second <= ALONE * fits[best]:
            return (
                f"{text}; without {megahertz(best)} they agree in {100.0 * fits[best]:.0f} %: its shots are left out; "
                "check that frequency in site.toml, shots.csv and mirrors/",
                best,
            )
    text += ", and nothing decides which is wrong: check modulation_hz in site.toml, shots.csv and mirrors/"
    if bad > HOPELESS * len(frequency_sets):
        raise InputError(f"shots.csv: {text}")
    return text, np.nan


def _share_without(groups: Sequence[_Sets], hz: float) -> float:
    """Share of the sets with three frequencies or more that fit a common length without one of them."""
    fit = count = 0
    for group in groups:
        if hz in group.frequencies and len(group.frequencies) > 2:
            remainder = group.only([i for i, value in enumerate(group.frequencies) if value != hz])
            solved = remainder.solved()
            fit += sum(s.status in ("found", "ambiguous") for s in solved)
            count += len(solved)
    return fit / count if count else 0.0
