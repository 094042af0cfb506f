"""Vibration from ranges at full rate.

Spectra, modes and shapes of points; differences in which common errors cancel.

A range changes by e . dx when its target moves by dx, e the unit vector from the ranger to the target: approximate
coordinates are enough (0.1 m off at 100 m is 0.1 % of the movement), and the neglected term is dx^2 / 2 range, 5 nm for
1 mm at 100 m. A movement within the mean of a buffer is attenuated; within an interval of samples it is aliased.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import CatseyeError, InputError
from catseye.signal.vibration.filter import Mode
from catseye.signal.vibration.modes import find_modes
from catseye.signal.vibration.spectrum import (
    ModeShape,
    Peak,
    Spectrum,
    aliases,
    likely_alias,
    peaks,
    shape_at,
    spectrum,
)
from catseye.verdict import Verdict

LEAST = 64  # samples of a series: 8 s at full rate
STRETCHES = 8  # segments of the shortest series by default, half overlapping
HIGHEST_HZ = 12.0  # highest frequency of a structure's modes when aliases are named
CLEAR = 0.02  # of the share of real shapes: nearer alternatives stay open
MOST_SAMPLES = 4000  # most samples for the modes' damping: some seconds of work
MOST_MODES = 3


@dataclass(frozen=True, eq=False)
class RangeSeries:
    """Ranges of one ranger to one target, or their difference.

    ranger, target   names
    seconds          (n,) s, middles of the buffers, rising; one clock for all series
    ranges           (n,) m
    u                (n,) m, standard uncertainty of each range's independent error
    window           s, of a buffer
    """

    ranger: str
    target: str
    seconds: Array
    ranges: Array
    u: Array
    window: float = 0.0

    @property
    def name(self) -> str:
        """Names of ranger and target."""
        return f"{self.ranger}:{self.target}"

    @property
    def rate_hz(self) -> float:
        """Mean number of ranges a second."""
        return float((len(self.seconds) - 1) / (self.seconds[-1] - self.seconds[0]))


@dataclass(frozen=True, eq=False)
class FoundPeak:
    """Peak with its possible frequencies.

    peak         of the summed density
    may_be_hz    all indistinguishable frequencies, lowest first
    likely_hz    of them, by the sampling rates of several series; that of the peak if undecided
    share        (candidates,) of the density explained by one real shape at each
    decided      True if the best is clearly ahead of the next
    shape        of the series about the peak; None for a single one
    """

    peak: Peak
    may_be_hz: tuple[float, ...]
    likely_hz: float
    share: Array
    decided: bool
    shape: ModeShape | None


@dataclass(frozen=True, eq=False)
class Vibration:
    """Spectra, peaks and modes of vibration of some series of ranges.

    series     of the input
    spectrum   of all, each by its own times; attenuation by the mean over a buffer is not corrected
    peaks      the highest first
    modes      by maximum likelihood, frequency with u; none without convergence, see the notes
    floor      (A,) m^2/Hz, of the lowest fifth of each density
    notes      for the user
    """

    series: tuple[RangeSeries, ...]
    spectrum: Spectrum
    peaks: tuple[FoundPeak, ...]
    modes: tuple[Mode, ...]
    floor: Array
    notes: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict by the peaks: one at least, none an alias perhaps, and modes that converged."""
        if not self.peaks:
            return Verdict("good", "no vibration stands out from the background")
        undecided = sum(not peak.decided for peak in self.peaks)
        if undecided:
            return Verdict(
                "doubtful", f"peaks that may be aliases of higher frequencies: {undecided} of {len(self.peaks)}"
            )
        if not self.modes:
            return Verdict("doubtful", "peaks stand out from the background, but no mode converged")
        return Verdict("good", f"peaks above the background: {len(self.peaks)}, none of which may be an alias")


def vibration(
    series: Sequence[RangeSeries],
    *,
    stretch: float | None = None,
    most_modes: int = MOST_MODES,
    highest_hz: float = HIGHEST_HZ,
) -> Vibration:
    """Spectra, peaks, modes and shapes of ranges.

    series       at least one, overlapping in time
    stretch      s, segment length: resolution is 1.5 / stretch; None: a quarter of the common time
    most_modes   number of modes fitted by maximum likelihood, among the highest peaks
    highest_hz   limit of the frequencies considered as aliases

    Raises InputError for series that are too short or do not overlap.
    """
    series_list = tuple(series)
    for one in series_list:
        if len(one.seconds) < LEAST:
            raise InputError(f"{one.name}: {len(one.seconds)} ranges (expected {LEAST} at least)")
    if not series_list:
        raise InputError("there is no series of ranges (expected at least one)")
    first, last = max(s.seconds[0] for s in series_list), min(s.seconds[-1] for s in series_list)
    if not last - first > 8.0:
        raise InputError(f"the series overlap by {max(last - first, 0.0):.3g} s (expected more than 8)")
    cut = [(s.seconds >= first) & (s.seconds <= last) for s in series_list]
    times = [s.seconds[at] for s, at in zip(series_list, cut, strict=True)]
    values = [s.ranges[at] for s, at in zip(series_list, cut, strict=True)]
    length = (last - first) * 2.0 / (STRETCHES + 1) if stretch is None else stretch
    spectra = spectrum(times, values, stretch=length)
    rate = float(spectra.rate_hz.min())
    notes = [
        f"Above {0.5 * rate:.3g} Hz, half the rate of {rate:.3g} Hz, frequencies are aliased: a wave there appears "
        "below, at the distance to the nearest multiple of the rate."
    ]
    found_peaks = [_found_peak(spectra, peak, times, values, length, highest_hz) for peak in peaks(spectra)]
    open_ones = [p for p in found_peaks if not p.decided]
    if open_ones:
        some = ", ".join(f"{p.peak.frequency_hz:.3g}" for p in open_ones[:5])
        notes.append(
            f"Whether the peaks at {some} Hz are aliases is open: rangers with other rates on the same target decide."
        )
    floor = np.quantile(spectra.density, 0.2, axis=0)
    modes: tuple[Mode, ...] = ()
    if found_peaks and most_modes:
        try:
            modes = _modes(series_list, spectra, found_peaks[:most_modes], floor, notes)
        except CatseyeError as problem:
            notes.append(f"Modes were not found: {problem}.")
    return Vibration(
        series=series_list, spectrum=spectra, peaks=tuple(found_peaks), modes=modes, floor=floor, notes=tuple(notes)
    )


def _found_peak(
    spectra: Spectrum, peak: Peak, times: Sequence[Array], values: Sequence[Array], length: float, highest_hz: float
) -> FoundPeak:
    """Peak with its possible frequencies.

    By the rate of the series that shows it most.
    """
    top = spectra.density[int(np.argmin(np.abs(spectra.frequency_hz - peak.frequency_hz)))]
    loudest = int(np.argmax(top))
    may_be = aliases(peak.frequency_hz, float(spectra.rate_hz[loudest]), max(highest_hz, peak.frequency_hz))
    likely, share = likely_alias(times, values, may_be, stretch=length)
    decided = len(may_be) == 1 or (len(times) > 1 and float(np.diff(np.sort(share)[-2:])[0]) > CLEAR)
    shape = shape_at(spectra, peak.frequency_hz) if len(times) > 1 else None
    return FoundPeak(
        peak=peak,
        may_be_hz=may_be,
        likely_hz=likely if decided else peak.frequency_hz,
        share=share,
        decided=decided,
        shape=shape,
    )


def _modes(
    series: Sequence[RangeSeries], spectra: Spectrum, found_peaks: Sequence[FoundPeak], floor: Array, notes: list[str]
) -> tuple[Mode, ...]:
    """Modes by maximum likelihood, starting from the peaks.

    Of the series with the best signal of the faintest of them.
    """
    rows = [int(np.argmin(np.abs(spectra.frequency_hz - p.peak.frequency_hz))) for p in found_peaks]
    best = int(np.argmax(np.min(spectra.density[rows] / floor, axis=0)))
    one = series[best]
    near = sorted({round(p.likely_hz, 6) for p in found_peaks})
    count = min(len(one.seconds), MOST_SAMPLES)
    if count < len(one.seconds):
        notes.append(f"Modes are from the first {count} of {len(one.seconds)} ranges of {one.name}.")
    else:
        notes.append(f"Modes are from {one.name}, with the best signal of the faintest of them.")
    when = one.seconds[:count]
    samples = one.ranges[:count] - slow(when, one.ranges[:count], 4.0 / min(p.peak.frequency_hz for p in found_peaks))
    u = max(float(np.median(one.u)), float(np.sqrt(floor[best] * 0.5 * one.rate_hz)))
    return find_modes(when, samples[:, None], count=len(near), u_sample=u, window=one.window, near_hz=near)


def slow(seconds: Array, values: Array, interval: float) -> Array:
    """Slow part (n,) of a series: a cubic spline by least squares.

    seconds    (n,) s, rising
    values     (n,)
    interval   s between its knots: waves of a quarter of it and shorter are excluded
    """
    from scipy.interpolate import make_lsq_spline

    first, last = float(seconds[0]), float(seconds[-1])
    parts = max(1, int((last - first) / interval))
    inner = np.linspace(first, last, parts + 1)[1:-1]
    before_knot = np.searchsorted(seconds, inner)
    inner = inner[np.concatenate([[True], np.diff(before_knot) >= 4])] if len(inner) else inner  # no knots in gaps
    knots = np.concatenate([[first] * 4, inner, [last] * 4])
    middle = values.mean()
    return middle + make_lsq_spline(seconds, values - middle, knots, k=3)(seconds)


def difference(one: RangeSeries, second: RangeSeries, *, scale: float = 1.0, longest_gap: float = 0.5) -> RangeSeries:
    """Difference of two series, in which common errors cancel.

    one, other    two targets of one ranger (its electronics and the air near it cancel), or two rangers on one target
    scale         of the second: 1 for electronics, the ratio of the lengths for a common refractivity
    longest_gap   s, between two ranges of the second: linear interpolation between them

    At a part w of a gap T of the second, a wave of frequency f passes the interpolation with the power
    1 - 2 w (1 - w)(1 - cos 2 pi f T): no loss where instants agree, and up to a total loss at f = 1/2T, w = 1/2.
    Raises InputError where fewer than 64 instants remain.

    Source: [PARKER04] section 3.2.4 (differences need no absolute coordinates); the interpolation is catseye's.
    """
    after = np.searchsorted(second.seconds, one.seconds, side="right")
    exact = np.isin(one.seconds, second.seconds)
    after = np.where(exact & (after == len(second.seconds)), after - 1, after)
    inside = (after > 0) & (after < len(second.seconds))
    at = np.where(inside, after, 1)
    gap = second.seconds[at] - second.seconds[at - 1]
    part = (one.seconds - second.seconds[at - 1]) / gap
    usable = inside & ((gap <= longest_gap) | exact)
    if usable.sum() < LEAST:
        raise InputError(
            f"{one.name} less {second.name}: {int(usable.sum())} instants lie within gaps of {longest_gap:g} s of the "
            f"other (expected {LEAST} at least): they must be measured at the same time"
        )
    value = (1.0 - part) * second.ranges[at - 1] + part * second.ranges[at]
    spread = ((1.0 - part) * second.u[at - 1]) ** 2 + (part * second.u[at]) ** 2
    return RangeSeries(
        ranger=one.name,
        target=f"less {second.name}" if scale == 1.0 else f"less {scale:.6g} {second.name}",
        seconds=one.seconds[usable],
        ranges=(one.ranges - scale * value)[usable],
        u=np.sqrt(one.u**2 + scale**2 * spread)[usable],
        window=one.window,
    )


def less_series(series: Sequence[RangeSeries], less: str) -> tuple[RangeSeries, ...]:
    """Series of a ranger less one of them, in which common errors cancel.

    series   at least two of one ranger
    less     RANGER:TARGET, name of the one subtracted

    Raises InputError for a name that is none of them.
    """
    base = next((one for one in series if one.name == less), None)
    if base is None:
        names = ", ".join(one.name for one in series)
        raise InputError(f"less = {less}: no such series (the journal has {names})")
    return tuple(difference(one, base) for one in series if one.ranger == base.ranger and one.name != less)
