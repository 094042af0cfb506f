"""Sample buffers to phases free of leakage, and electronics drift.

The drift is from the reference shots.
"""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from catseye.aliases import Progress
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import EstimationError
from catseye.names import megahertz
from catseye.records.night.campaign import REFERENCE, Campaign, ObservedSite
from catseye.records.night.shot import release_buffers
from catseye.records.site.mirror import Mirror
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.signal.cycles.whole import fraction
from catseye.signal.detection.buffers import BufferStatus, inspect_buffers
from catseye.signal.detection.cycle_scatter import FEWEST_FOR_BATCHES, CycleScatter
from catseye.signal.detection.harmonics import distorted, relative_harmonics
from catseye.signal.drift.reference import drift_along, drift_at, reference_prediction_error
from catseye.signal.drift.states import DriftStates, drift_states
from catseye.signal.drift.walk import estimate_walk, walk_test
from catseye.signal.systematics.leakage import subtract_leakage

MRAD_PER_ROOT_HOUR = 1e-3 / 60.0  # rad per root second
LARGEST_ERROR = 5.0  # largest error of a reference's prediction by its neighbours, in standard uncertainties
WARM_UP = 0.03  # rad, additional tolerance at the ends of a ranger's block, where a transient is extrapolated
BEND = 0.005  # rad, additional tolerance inside, where only its curvature counts
REFERENCE_AMPLITUDE = 0.03  # relative change of the internal return beyond which it is not the cube's alone

WRONG = {BufferStatus.DROPOUT: ShotStatus.DROPOUT, BufferStatus.STUCK: ShotStatus.STUCK}


@dataclass(frozen=True, eq=False)
class ShotPhase:
    """Result from one shot's samples: a row of `Phases`."""

    phasor: complex
    u_phasor: float
    u_across: float
    offset: float
    harmonics: tuple[float, float]
    largest: float
    reason: Reason | None


@dataclass(frozen=True, eq=False)
class Phases:
    """Results from all shots' samples, in the campaign's order.

    phasor      V, complex, free of leakage
    u_phasor    V, standard uncertainty of each quadrature, from the samples' own scatter, the two taken as alike
    u_across    V, of the quadrature that turns the phasor, noise alike in neighbouring cycles allowed for; below 16
                cycles u_phasor itself
    offset      V
    harmonics   V, (n, 2), amplitudes of harmonics 2 and 3
    largest     V, largest magnitude of a sample
    reason      reason that a shot cannot be used, None where it can
    cycles      whole half wavelengths that several modulation frequencies of a line give, -1 for none; None where all
                shots have the site's
    """

    phasor: np.ndarray
    u_phasor: np.ndarray
    u_across: np.ndarray
    offset: np.ndarray
    harmonics: np.ndarray
    largest: np.ndarray
    reason: tuple[Reason | None, ...]
    cycles: np.ndarray | None = None

    @staticmethod
    def of(shots: Sequence["ShotPhase"]) -> "Phases":
        """Phases from single shots, as columns."""
        return Phases(
            phasor=np.array([s.phasor for s in shots], dtype=complex),
            u_phasor=np.array([s.u_phasor for s in shots]),
            u_across=np.array([s.u_across for s in shots]),
            offset=np.array([s.offset for s in shots]),
            harmonics=np.array([s.harmonics for s in shots]).reshape(-1, 2),
            largest=np.array([s.largest for s in shots]),
            reason=tuple(s.reason for s in shots),
        )

    @property
    def amplitude(self) -> np.ndarray:
        """Amplitude of each shot's return, V."""
        return np.abs(self.phasor)

    @property
    def phase(self) -> np.ndarray:
        """Phase of each shot's return, rad in [0, 2 pi)."""
        return fraction(np.angle(self.phasor), 0.0)

    @property
    def u_phase(self) -> np.ndarray:
        """Standard uncertainty of the phase from the samples' noise, rad.

        Infinite without a return.
        """
        amplitude = self.amplitude
        return np.divide(self.u_across, amplitude, out=np.full_like(self.u_across, np.inf), where=amplitude > 0.0)

    @property
    def relative_harmonics(self) -> np.ndarray:
        """Harmonics 2 and 3 over the return, (n, 2); NaN without one."""
        return relative_harmonics(self.harmonics, self.amplitude, self.u_phasor)[0]

    @property
    def distorted(self) -> np.ndarray:
        """True (n,) for usable shots with a harmonic beyond the limit, see `signal.detection.harmonics`."""
        usable = np.array([reason is None for reason in self.reason], dtype=bool)
        return usable & distorted(*relative_harmonics(self.harmonics, self.amplitude, self.u_phasor))


@dataclass(frozen=True, eq=False)
class ElectronicsPhase:
    """Electronics phase of one ranger at its usable target shots.

    shots        (m,) indices into the campaign's shots
    phase        (m,) rad
    covariance   (m, m) rad^2, from the noise of the references and the walk between them; with `walk` its diagonal
    reference    (m,) V, complex: reference phasor on which the leakage acts; its magnitude, the cube's return at
                 that instant, is the origin of amplitude-to-phase coupling
    walk         correlation model of a campaign too large for a matrix
    """

    shots: np.ndarray
    phase: np.ndarray
    covariance: np.ndarray
    reference: np.ndarray
    walk: "ReferenceWalk | None" = None

    def joint(self, rows: np.ndarray) -> np.ndarray:
        """Covariance of some of the shots, (k, k) rad^2."""
        if self.walk is None:
            return self.covariance[np.ix_(rows, rows)]
        return drift_at(
            self.walk.reference_seconds,
            np.zeros(len(self.walk.reference_seconds)),
            self.walk.reference_variance,
            time=self.walk.seconds[rows],
            random_walk=self.walk.random_walk,
        )[1]

    @staticmethod
    def joined(parts: "Sequence[ElectronicsPhase]") -> "ElectronicsPhase":
        """Electronics phase of a ranger from its parts, one a modulation frequency, in the order of shots."""
        if len(parts) == 1:
            return parts[0]
        shots = np.concatenate([part.shots for part in parts])
        order = np.argsort(shots, kind="stable")
        return ElectronicsPhase(
            shots[order],
            np.concatenate([part.phase for part in parts])[order],
            block_diag(*(part.covariance for part in parts))[np.ix_(order, order)],
            np.concatenate([part.reference for part in parts])[order],
        )

    def of(self, keep: np.ndarray) -> "ElectronicsPhase":
        """Electronics phase at some of the shots, (m,) bool."""
        is_matrix = self.covariance.ndim == 2
        return ElectronicsPhase(
            self.shots[keep],
            self.phase[keep],
            self.covariance[np.ix_(keep, keep)] if is_matrix else self.covariance[keep],
            self.reference[keep],
            None if self.walk is None else replace(self.walk, seconds=self.walk.seconds[keep]),
        )


@dataclass(frozen=True, eq=False)
class ReferenceWalk:
    """Model of the errors of a ranger's electronics.

    seconds              (m,) s, of the shots
    reference_seconds    (r,) s, and
    reference_variance   (r,) rad^2, of the reference shots
    random_walk          rad per root second
    """

    seconds: np.ndarray
    reference_seconds: np.ndarray
    reference_variance: np.ndarray
    random_walk: float

    def states(self, noise: np.ndarray) -> DriftStates:
        """Errors as hidden parameters.

        noise (m,) rad^2 as in `drift_states`.
        """
        return drift_states(
            self.reference_seconds,
            self.reference_variance,
            time=self.seconds,
            random_walk=self.random_walk,
            noise=noise,
        )


def measure_phases(campaign: Campaign, settings: ReductionSettings, progress: Progress | None = None) -> Phases:
    """Phase and amplitude of every shot, leakage removed.

    With a reason where a shot shows no light.

    A return is called blocked when the remainder without leakage is not five times its own uncertainty, that of the
    leakage included; dead when the samples do not even hold the leakage, which with its sign changed would otherwise
    look like a return; clipped when a sample stands at the converter's end; dropout and stuck see
    `signal.detection.buffers`; doubted when `doubts.csv` marks it as doubtful during the measurement.
    """
    shots, adc = campaign.shots, campaign.site.adc
    n = len(shots.shot)
    volts_per_code = adc.full_scale_volt / 2 ** (adc.bits - 1)
    detected = Detections.empty(n)
    shapes = sorted(set(zip(shots.cycles.tolist(), shots.samples_per_cycle.tolist(), strict=True)))
    processed = 0
    for cycles, samples_per_cycle in shapes:
        alike = np.flatnonzero((shots.cycles == cycles) & (shots.samples_per_cycle == samples_per_cycle))
        for start in range(0, len(alike), 64):
            rows = alike[start : start + 64]
            samples = campaign.frames[shots.frame[rows], : cycles * samples_per_cycle]
            detected.put(rows, samples, samples_per_cycle, volts_per_code, adc.bits)
            processed += len(rows)
            if progress is not None:
                progress("samples to phases", processed, n)
    release_buffers(campaign.frames)  # a third of a gigabyte for a whole dish
    mirrors = _sheets_of_shots(campaign)
    phases = judged_phases(
        detected,
        shots.cycles,
        shots.samples_per_cycle,
        mirrors=mirrors,
        settings=settings,
        usual_of=lambda a: _usual_amplitude(campaign, a),
    )
    doubts = [campaign.doubted.get(int(shot)) for shot in shots.shot]
    pairs = zip(phases.reason, doubts, strict=True)
    return replace(
        phases, reason=tuple(reason or (why and Reason(ShotStatus.DOUBTED, why)) or None for reason, why in pairs)
    )


def _sheets_of_shots(campaign: ObservedSite) -> list[Mirror]:
    """Sheet of each shot's head, with the leakage at the shot's modulation frequency."""
    rangers = campaign.shots.ranger
    if not campaign.several_frequencies:
        return [campaign.mirror_of(ranger) for ranger in rangers]
    pairs = list(zip(rangers, campaign.modulation_of(np.arange(len(rangers))).tolist(), strict=True))
    sheets = {(ranger, hz): campaign.mirror_of(ranger).at_modulation(hz) for ranger, hz in dict.fromkeys(pairs)}
    return [sheets[pair] for pair in pairs]


@dataclass(frozen=True, eq=False)
class BufferDetection:
    """Synchronous detection of one buffer, V: a row of `Detections`."""

    raw: complex
    u_phasor: float
    offset: float = 0.0
    harmonics: tuple[float, float] = (0.0, 0.0)
    largest: float = 0.0
    clipped: int = 0
    total: Sequence[float] = (0.0, 0.0, 0.0)
    between: Sequence[float] = (0.0, 0.0, 0.0)
    wrong: Reason | None = None


@dataclass(frozen=True, eq=False)
class Detections:
    """Synchronous detection of n buffers, leakage included.

    Fields as in `signal.detection.phase.Detection`.

    wrong   reason that a buffer's samples are invalid, None where they are valid
    """

    raw: np.ndarray
    u_phasor: np.ndarray
    offset: np.ndarray
    harmonics: np.ndarray
    largest: np.ndarray
    clipped: np.ndarray
    total: np.ndarray
    between: np.ndarray
    wrong: list[Reason | None]

    @staticmethod
    def empty(n: int) -> "Detections":
        """Empty detections of n buffers."""
        one, three = np.zeros(n), np.zeros((n, 3))
        return Detections(
            raw=np.zeros(n, dtype=complex),
            u_phasor=one,
            offset=one.copy(),
            harmonics=np.zeros((n, 2)),
            largest=one.copy(),
            clipped=np.zeros(n, dtype=int),
            total=three,
            between=three.copy(),
            wrong=[None] * n,
        )

    def row(self, k: int) -> BufferDetection:
        """Detection of one buffer, as plain numbers."""
        return BufferDetection(
            raw=complex(self.raw[k]),
            u_phasor=float(self.u_phasor[k]),
            offset=float(self.offset[k]),
            harmonics=(float(self.harmonics[k, 0]), float(self.harmonics[k, 1])),
            largest=float(self.largest[k]),
            clipped=int(self.clipped[k]),
            total=self.total[k].tolist(),
            between=self.between[k].tolist(),
            wrong=self.wrong[k],
        )

    def put(
        self, rows: np.ndarray, samples: np.ndarray, samples_per_cycle: int, volts_per_code: float, bits: int
    ) -> None:
        """Detect buffers of one shape into rows (b,).

        Samples (b, cycles samples_per_cycle).
        """
        ends = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        quality = inspect_buffers(samples, samples_per_cycle, volts_per_code, converter_ends=ends)
        detection = quality.detection
        for k, row in enumerate(rows):
            wrong = WRONG.get(BufferStatus(quality.status[k]))
            if wrong is not None:
                self.wrong[row] = Reason(wrong, quality.detail(k))
        self.total[rows], self.between[rows] = detection.scatter.total, detection.scatter.between
        self.raw[rows], self.u_phasor[rows], self.offset[rows] = detection.phasor, detection.u_phasor, detection.offset
        self.harmonics[rows], self.largest[rows], self.clipped[rows] = (
            detection.harmonics,
            detection.largest,
            detection.clipped,
        )


def judged_phases(
    detected: Detections,
    cycles: np.ndarray,
    samples_per_cycle: np.ndarray,
    *,
    mirrors: Sequence[Mirror],
    settings: ReductionSettings,
    usual_of: Callable[[np.ndarray], np.ndarray],
) -> Phases:
    """Phasors free of leakage, with uncertainties and rejection reasons.

    detected                     n buffers
    cycles, samples_per_cycle    (n,)
    mirrors                      n, the sheets of the heads
    usual_of                     usual amplitude of each for amplitudes (n,), V; for the text of a blocked one
    """
    n = len(detected.raw)
    phasor = subtract_leakage(
        detected.raw,
        np.array([m.leakage_amplitude_volt for m in mirrors]),
        np.array([m.leakage_phase_rad for m in mirrors]),
    )
    scatter = CycleScatter(cycles, detected.total, detected.between, np.zeros(n, dtype=np.int64))
    enough = cycles >= FEWEST_FOR_BATCHES  # with fewer, the scatter of one quadrature is too uncertain
    u_across = np.where(enough, np.sqrt(scatter.variance(phasor)[0][:, 1]), detected.u_phasor)
    usual = usual_of(np.abs(phasor))
    reason = [
        why_not(
            detected.row(k),
            complex(phasor[k]),
            sampling=(int(cycles[k]), int(samples_per_cycle[k])),
            mirror=mirrors[k],
            settings=settings,
            usual=float(usual[k]),
        )
        or detected.wrong[k]
        for k in range(n)
    ]
    return Phases(
        phasor=phasor,
        u_phasor=detected.u_phasor,
        u_across=u_across,
        offset=detected.offset,
        harmonics=detected.harmonics,
        largest=detected.largest,
        reason=tuple(reason),
    )


def why_not(
    buffer: BufferDetection,
    phasor: complex,
    *,
    sampling: tuple[int, int],
    mirror: Mirror,
    settings: ReductionSettings,
    usual: float,
) -> Reason | None:
    """Rejection reason of a buffer's phase; None if valid.

    buffer      leakage in it
    phasor      V, leakage removed
    sampling    cycles and samples a cycle
    usual       V, for the text
    """
    limit = settings.smallest_return * math.hypot(buffer.u_phasor, mirror.u_leakage_volt)
    if buffer.clipped:
        return Reason(ShotStatus.CLIPPED, f"{buffer.clipped} samples at the converter's end ({buffer.largest:.2f} V)")
    if not math.isfinite(limit):
        text = (
            f"{sampling[0]} cycles of {sampling[1]} samples show no scatter (expected at least 2 cycles, or 8 samples)"
        )
        return Reason(ShotStatus.NOISE_UNKNOWN, text)
    if abs(phasor) < limit:
        text = f"return {abs(phasor):.4f} V, below the limit of {limit:.4f} V (usual {usual:.2f} V)"
        return Reason(ShotStatus.BLOCKED, text)
    if abs(buffer.raw) < limit:
        leakage = mirror.leakage_amplitude_volt
        text = f"the samples hold {abs(buffer.raw):.4f} V, not even the leakage of {leakage:.4f} V: converter or cable"
        return Reason(ShotStatus.DEAD, text)
    return None


def _usual_amplitude(campaign: ObservedSite, amplitude: np.ndarray) -> np.ndarray:
    """Median amplitude per ranger, reference and target shots separate."""
    key = np.array([f"{r} {t == REFERENCE}" for r, t in zip(campaign.shots.ranger, campaign.shots.target, strict=True)])
    usual = np.zeros(len(amplitude))
    for group in np.unique(key):
        usual[key == group] = np.median(amplitude[key == group])
    return usual


def follow_electronics(
    campaign: ObservedSite, phases: Phases, dense_shots: int = ReductionSettings.dense_shots
) -> tuple[dict[str, ElectronicsPhase], dict[int, Reason]]:
    """Phase of each ranger's electronics at its target shots.

    Also the rejected references (index: reason).

    dense_shots   most usable target shots of all rangers for which the errors' covariances are matrices

    References that miss the prediction of the others, or whose amplitude is not that of the cube alone, are left out; a
    ranger without any good reference cannot range. The electronics have another phase at each modulation frequency: of
    several, each follows its own references, with errors independent of the others', and covariances are matrices.

    Source: [PARKER04] eqs. 5.12 and 5.13; between references a random walk of the site's strength.
    """
    shots = campaign.shots
    seconds = (shots.mjd_utc - shots.mjd_utc[0]) * SECONDS_PER_DAY
    walk = campaign.site.ranging.electronic_drift_mrad_per_sqrt_hour * MRAD_PER_ROOT_HOUR
    target = np.array(shots.target)
    usable = np.array([not r for r in phases.reason])
    variance = np.where(usable, phases.u_phase, 0.0) ** 2
    rejected: dict[int, Reason] = {}
    large = not campaign.several_frequencies and np.count_nonzero(usable & (target != REFERENCE)) > dense_shots
    parts: dict[str, list[ElectronicsPhase]] = {}
    for name, mine in _series(campaign):
        lit = np.flatnonzero(mine & usable & (target != REFERENCE))
        references = np.flatnonzero(mine & usable & (target == REFERENCE))
        references = references[np.argsort(seconds[references], kind="stable")]
        wrong = _wrong_references(seconds, phases, variance, references, walk)
        rejected.update(wrong)
        references = np.array([k for k in references if k not in wrong], dtype=int)
        if not len(references):
            at = f" at {_megahertz(campaign, mine)}" if campaign.several_frequencies else ""
            text = f"{name} has no usable shot on its internal cube{at}, its drift is unknown"
            rejected.update({int(k): Reason(ShotStatus.NO_REFERENCE, text) for k in lit})
            continue
        unwrapped = np.unwrap(np.angle(phases.phasor[references]))
        references_data = seconds[references], unwrapped, variance[references]
        level = np.interp(seconds[lit], seconds[references], phases.amplitude[references])
        if large:
            phase, u = drift_along(*references_data, time=seconds[lit], random_walk=walk)
            between = ReferenceWalk(seconds[lit], references_data[0], references_data[2], walk)
            part = ElectronicsPhase(lit, phase, u**2, level * np.exp(1j * phase), between)
        else:
            phase, covariance = drift_at(*references_data, time=seconds[lit], random_walk=walk)
            part = ElectronicsPhase(lit, phase, covariance, level * np.exp(1j * phase))
        parts.setdefault(name, []).append(part)
    return {name: ElectronicsPhase.joined(mine) for name, mine in parts.items()}, rejected


def _series(campaign: ObservedSite) -> Iterator[tuple[str, np.ndarray]]:
    """Shots (n,) bool of each ranger, at one modulation frequency after the other."""
    ranger = np.array(campaign.shots.ranger)
    modulation = campaign.modulation_of(np.arange(len(ranger)))
    for name in campaign.rangers:
        mine = ranger == name
        if not campaign.several_frequencies:
            yield name, mine
            continue
        for hz in np.unique(modulation[mine]):
            yield name, mine & (modulation == hz)


def _megahertz(campaign: ObservedSite, shots: np.ndarray) -> str:
    """Modulation frequency of the first of some shots, (n,) bool, in words."""
    return megahertz(float(campaign.modulation_of(np.flatnonzero(shots)[:1])[0]))


def walk_notes(campaign: ObservedSite, phases: Phases, wrong: Collection[int]) -> list[str]:
    """Note if the good references walk unlike the site's figure.

    Tested for all rangers together, at one in a thousand.

    wrong   references that are left out, indices into the campaign's shots

    Each ranger's first reference is left out too: a warm-up is no walk.
    """
    shots = campaign.shots
    good = np.array([t == REFERENCE for t in shots.target]) & np.array([not r for r in phases.reason])
    good[list(wrong)] = False
    rows = [np.flatnonzero(good & mine)[1:] for _, mine in _series(campaign)]
    rows = [r for r in rows if len(r) > 1 and np.ptp(shots.mjd_utc[r]) > 0.0]
    if not rows:
        return []
    site_walk = campaign.site.ranging.electronic_drift_mrad_per_sqrt_hour
    k = np.concatenate(rows)
    references = (
        (shots.mjd_utc[k] - shots.mjd_utc[0]) * SECONDS_PER_DAY,
        np.concatenate([np.unwrap(np.angle(phases.phasor[r])) for r in rows]),
        phases.u_phase[k] ** 2,
    )
    series = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
    test = walk_test(*references, random_walk=site_walk * MRAD_PER_ROOT_HOUR, series=series, probability=0.999)
    if test.passed:
        return []
    verdict = (
        f"unlike the {site_walk:g} of site.toml: u_range is too {'small' if test.statistic > test.high else 'large'}"
    )
    try:
        walk = estimate_walk(*references, series=series)
    except EstimationError:  # the test needs one difference of references, an estimate two
        return [f"the electronics walk between references, but {verdict}"]
    if walk.random_walk == 0.0:
        return [f"the electronics show no walk between references beyond their noise, {verdict}"]
    low, high = (v / MRAD_PER_ROOT_HOUR for v in walk.interval())
    return [
        f"the electronics walk by {walk.random_walk / MRAD_PER_ROOT_HOUR:.1f} mrad per root hour between references "
        f"(95 %: {low:.1f} to {high:.1f}), {verdict}"
    ]


def _wrong_references(
    seconds: np.ndarray, phases: Phases, variance: np.ndarray, references: np.ndarray, walk: float
) -> dict[int, Reason]:
    wrong: dict[int, Reason] = {}
    usual = float(np.median(phases.amplitude[references])) if len(references) else 0.0
    for k in references:
        if len(references) > 2 and abs(phases.amplitude[k] / usual - 1.0) > REFERENCE_AMPLITUDE:
            text = (
                f"return {phases.amplitude[k]:.3f} V where the cube gives {usual:.3f} V: another object is in the beam"
            )
            wrong[int(k)] = Reason(ShotStatus.BAD_REFERENCE, text)
    while True:
        remaining = np.array([k for k in references if k not in wrong], dtype=int)
        if len(remaining) < 3:
            return wrong
        difference, allowed = _prediction_errors(seconds, phases, variance, remaining, walk)
        suspects = np.flatnonzero(np.abs(difference) > allowed)
        if not len(suspects):
            return wrong
        # A wrong reference makes its neighbours look wrong too: without it the others agree best.
        ratios = []
        for suspect in suspects:
            d, a = _prediction_errors(seconds, phases, variance, np.delete(remaining, suspect), walk)
            ratios.append(float(np.max(np.abs(d) / a)))
        worst = int(suspects[int(np.argmin(ratios))])
        text = (
            f"phase {difference[worst]:+.4f} rad off the prediction by the neighbouring references "
            f"(allowed {allowed[worst]:.4f})"
        )
        wrong[int(remaining[worst])] = Reason(ShotStatus.BAD_REFERENCE, text)


def _prediction_errors(
    seconds: np.ndarray, phases: Phases, variance: np.ndarray, references: np.ndarray, walk: float
) -> tuple[np.ndarray, np.ndarray]:
    """Prediction error of each reference by the others, and its limit.

    Two or more references in order of time; rad.
    """
    phase = np.unwrap(np.angle(phases.phasor[references]))
    difference, u = reference_prediction_error(seconds[references], phase, variance[references], random_walk=walk)
    at_an_end = np.isin(np.arange(len(references)), (0, len(references) - 1))
    return difference, LARGEST_ERROR * u + np.where(at_an_end, WARM_UP, BEND)
