"""Vibration followed by the phase-locked filter: amplitude, frequency and phase, and the place some time ahead.

Modes come from the first part of a series, or from the structural model; the filter locks on that part, and the rest
checks it: each sample against its prediction made a stated time before it.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.optics.detector import quadrant_position
from catseye.records.night.vibration_series import VibrationSeries
from catseye.records.site.structural_model import StructuralModel
from catseye.signal.vibration.filter import FilterState, Mode, follow, start
from catseye.signal.vibration.modes import find_modes
from catseye.verdict import Verdict

LEARNT = 0.5  # share of a series from which modes are found
MOST_LEARNT = 2000  # samples: some seconds of work
LOCKED = 0.5  # rad: largest u of the phase of a mode's strongest axis
HONEST = (0.7, 1.3)  # ratio of residual to claim that a verdict calls good
FREQUENCIES = (0.05, 100.0)  # Hz: a telescope of 100 m sways at 0.6, a bench of steel at some tens
ABSENT = 1e-3  # share of the variance, of a mode on an axis with which it moves nothing
OFFSETS = 10.0  # times the largest sample: prior of the rest position


@dataclass(frozen=True, eq=False)
class VibrationSamples:
    """Samples for the filter.

    axes      names of the A axes
    seconds   (n,) s
    values    (n, A) m; nan where lost
    noise     (n, A, A) m^2
    window    s, over which each sample is a mean; 0 for an instant
    """

    axes: tuple[str, ...]
    seconds: Array
    values: Array
    noise: Array
    window: float = 0.0

    @property
    def end(self) -> float:
        """End of the last sample, s: half a window after its middle."""
        return float(self.seconds[-1]) + 0.5 * self.window

    @property
    def interval(self) -> float:
        """Usual time between two samples, s."""
        return float(np.median(np.diff(self.seconds)))


@dataclass(frozen=True, eq=False)
class FollowedVibration:
    """Vibration followed to the end of its samples.

    samples      of the input
    names        of the m modes
    state        of the filter after the last sample
    checked      (k,) indices of the samples of the check
    residual     (k, A) m, sample less its prediction made `ahead` before it; nan where lost
    claim        (k, A, A) m^2, covariance of these, noise of the sample included
    before       (A,) m, rms of the checked samples about their mean
    ahead        s, from the last sample known to the one predicted
    leads        (l,) s after the end of the last sample
    predicted    (l, A) m, vibration at these times, without the rest position
    covariance   (l, A, A) m^2
    """

    samples: VibrationSamples
    names: tuple[str, ...]
    state: FilterState
    checked: np.ndarray
    residual: Array
    claim: Array
    before: Array
    ahead: float
    leads: Array
    predicted: Array
    covariance: Array

    @property
    def after(self) -> Array:
        """Rms (A,), m, of the residuals."""
        return np.asarray(np.sqrt(np.nanmean(np.square(self.residual), axis=0)))

    @property
    def expected(self) -> Array:
        """Rms (A,), m, that the filter claims for the residuals."""
        return np.asarray(np.sqrt(np.mean(np.diagonal(self.claim, axis1=-2, axis2=-1), axis=0)))

    @property
    def ratio(self) -> float:
        """Root of the mean squared residual over its claim, all axes together; 1 where the claim is true."""
        complete = np.isfinite(self.residual).all(axis=-1)
        if not complete.any():
            return float("nan")
        weighted = np.linalg.solve(self.claim[complete], self.residual[complete][..., None])[..., 0]
        return float(np.sqrt(np.mean(np.sum(self.residual[complete] * weighted, axis=-1)) / self.residual.shape[1]))

    @property
    def locked(self) -> np.ndarray:
        """True (m,) for each mode whose phase is known on its strongest axis."""
        strongest = np.argmax(self.state.amplitudes()[0], axis=-1)
        u = np.take_along_axis(self.state.phases()[1], strongest[:, None], axis=-1)[:, 0]
        return np.asarray(u < LOCKED)

    @property
    def verdict(self) -> Verdict:
        """Verdict by the phase lock, and by residuals against their claim."""
        unlocked = [name for name, locked in zip(self.names, self.locked, strict=True) if not locked]
        if len(unlocked) == len(self.names):
            return Verdict("failed", "no mode's phase is known: there is no vibration above the noise, or another one")
        low, high = FREQUENCIES
        for name, frequency in zip(self.names, self.state.frequencies_hz()[0], strict=True):
            if not low <= frequency <= high:
                text = f"{name} at {frequency:.3g} Hz is outside {low:g} to {high:g} Hz, where structures vibrate"
                return Verdict("doubtful", f"{text}: time_s may be in another unit")
        if not HONEST[0] <= self.ratio <= HONEST[1]:
            text = f"residuals are {self.ratio:.2f} of what the filter claims"
            return Verdict("doubtful", f"{text}: other modes, a kick, or another noise than stated")
        if np.linalg.norm(self.after) >= np.linalg.norm(self.before):
            return Verdict("doubtful", "following does not make the residuals smaller than the vibration")
        subject = (
            f"every mode but {', '.join(unlocked)}, too small now for a phase, is" if unlocked else "every mode is"
        )
        return Verdict("good", f"{subject} locked, and residuals are {self.ratio:.2f} of what the filter claims")


def samples_of(
    series: VibrationSeries, *, slope: float | None, u_signal: float | None, u: float | None, window: float
) -> VibrationSamples:
    """Samples of a series that the filter follows.

    slope      m, of a quadrant detector: displacement over the difference of halves over the sum
    u_signal   noise of each quadrant, unit of the signals
    u          m, white noise of each displacement or range
    window     s, over which each sample is a mean

    Ranges are about their mean. Raises InputError where what the kind needs is missing.

    Source: `optics.detector.quadrant_position`.
    """
    if series.kind == "quadrant":
        if slope is None or u_signal is None:
            raise InputError(f"{series.file}: signals of quadrants need slope_mm and u_signal")
        values, noise = quadrant_position(series.values, slope=slope, u_signal=u_signal)
        if not np.isfinite(noise).all():  # without light: lost, and its noise is of no matter
            noise = np.where(np.isfinite(noise), noise, np.eye(2))
        return VibrationSamples(("x", "y"), series.seconds, values, noise, window)
    if u is None:
        raise InputError(f"{series.file}: a series of the kind {series.kind} needs u_mm, the noise of each sample")
    names = tuple(name.partition("_")[0] for name in series.columns)
    values = series.values - np.nanmean(series.values, axis=0) if series.kind == "range" else series.values
    count, axes = values.shape
    return VibrationSamples(names, series.seconds, values, np.tile(u**2 * np.eye(axes), (count, 1, 1)), window)


def modes_of_model(record: StructuralModel, samples: VibrationSamples) -> tuple[Mode, ...]:
    """Modes of a structural model's vibrations, as large together as the samples.

    A mode that moves nothing with an axis of the quadrant detector is small on that axis.

    Raises InputError for a model without vibrations.
    """
    if not record.vibration:
        raise InputError(f"the structural model {record.title!r} has no vibration")
    count, axes = len(record.vibration), samples.values.shape[1]
    shares = np.ones((count, axes))
    if axes == 2:
        moves = [
            [np.any([getattr(mode, f"{key}_{axis}") for key in ("shift_per", "turn_arcsec_per_mm")]) for axis in "xy"]
            for mode in record.vibration
        ]
        shares = np.where(moves, 1.0, ABSENT)
    sizes = np.nanvar(samples.values, axis=0) * shares / shares.sum(axis=0)
    return tuple(
        Mode(
            frequency_hz=mode.frequency_hz,
            damping_ratio=mode.damping_ratio,
            covariance=np.diag(np.maximum(size, np.finfo(float).tiny)),
            u_frequency_hz=mode.u_frequency_hz,
        )
        for mode, size in zip(record.vibration, sizes, strict=True)
    )


def follow_vibration(
    samples: VibrationSamples,
    *,
    modes: tuple[Mode, ...] | None = None,
    names: tuple[str, ...] = (),
    count: int = 1,
    near_hz: tuple[float, ...] | None = None,
    ahead: float = 0.0,
    leads: tuple[float, ...] = (),
) -> FollowedVibration:
    """Follow samples to their end, and check the filter on their second half.

    modes     with which the filter starts; None: found in the first half
    names     of the modes; "mode 1", ... without
    count     of modes to find
    near_hz   first guesses of their frequencies
    ahead     s, of the check: the nearest whole number of samples, one at least
    leads     s after the end of the last sample, of the prediction

    Raises EstimationError where modes cannot be found.

    Source: [PARKER04] section 2.6.1, amplitude and phase of the feed arm; `signal.vibration`.
    """
    t, y, r = samples.seconds, samples.values, samples.noise
    learnt = int(LEARNT * len(t))
    if modes is None:
        part = slice(max(0, learnt - MOST_LEARNT), learnt)
        noise = float(np.sqrt(np.nanmean(np.diagonal(r[part], axis1=-2, axis2=-1))))
        near = None if near_hz is None else list(near_hz)
        modes = find_modes(t[part], y[part], count=count, u_sample=noise, window=samples.window, near_hz=near)
    begin = start(float(t[0]) - samples.window, modes, u_offset=OFFSETS * float(np.nanmax(np.abs(y))))
    locked = follow(begin, t[:learnt], y[:learnt], noise=r[:learnt], window=samples.window).state
    steps = max(1, round(ahead / samples.interval))
    states: deque[FilterState] = deque([locked], maxlen=steps)  # the oldest is `steps` samples back
    residual, claim = [], []
    for i in range(learnt, len(t)):
        if len(states) == steps:
            _, innovation, spread = states[0].updated(float(t[i]), y[i], r[i], samples.window)
            residual.append(innovation)
            claim.append(spread)
        states.append(states[-1].updated(float(t[i]), y[i], r[i], samples.window)[0])
    state = states[-1]
    checked = np.arange(len(t) - len(residual), len(t))
    about = y[checked] - np.nanmean(y[checked], axis=0)
    predicted, covariance = state.predicted(samples.end + np.asarray(leads, dtype=float))
    return FollowedVibration(
        samples=samples,
        names=names or tuple(f"mode {k + 1}" for k in range(len(modes))),
        state=state,
        checked=checked,
        residual=np.array(residual),
        claim=np.array(claim),
        before=np.sqrt(np.nanmean(np.square(about), axis=0)),
        ahead=steps * samples.interval,
        leads=np.asarray(leads, dtype=float),
        predicted=predicted,
        covariance=covariance,
    )
