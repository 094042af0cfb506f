"""Scan over a retroreflector to its spot: centre, radius, peak and background.

An azimuth scan has one elevation, an elevation scan one azimuth, a raster several of both. The model is that of
`steering.spot_fit`: a round spot, Gaussian or flatter. Along a line beside the centre a Gaussian spot has the same
radius and a lower peak.

A scan that does not determine the spot is refused: at full scale the peak is not measured, and of a spot at the edge
only one side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np

from catseye.aliases import Array
from catseye.errors import EstimationError
from catseye.geometry.mirror.search_pattern import count_size, counts_of_offsets, offsets_of_counts
from catseye.optics.spot import gaussian_spot
from catseye.records.laboratory.scan_table import ScanReadings
from catseye.reduction.steering.spot_fit import FEWEST, FEWEST_LIT, TIMES_NOISE, SearchHead, SpotModel, shape_slopes
from catseye.verdict import Verdict, worst

Axes = Literal["azimuth", "elevation", "both"]
NAMES = ("azimuth_counts", "elevation_counts", "radius", "peak_volt", "background_volt", "flatness")
FREE = {"azimuth": (True, False), "elevation": (False, True), "both": (True, True)}
HALF_RADIUS = float(np.sqrt(0.5 * np.log(2.0)))  # of a Gaussian at half its peak, over its radius at 1/e^2
LEAST_SIDE = 0.6  # radii between the centre and the end of a scan: beyond half of the peak
EXCESS = 8.0  # variance factor: a few readings at steep sides decide it, 99 % of true spots stay below
MOST_APART = 3.3  # u: one in a thousand
MOST_NAMED = 3  # rows that a message names


@dataclass(frozen=True, eq=False)
class ScanFit:
    """Spot of one scan.

    readings          the scan
    axes              "azimuth", "elevation" or "both": what it varied
    values            (6,) of NAMES: counts, rad on the sky, V; an axis that was not scanned has its counts
    covariance        (6, 6); zero for an axis that was not scanned
    predicted         (n,) V of the fit
    sigma             (n,) V, standard uncertainty of each reading
    variance_factor   of the readings that determine the centre, expectation 1; above 1 it multiplies the covariance
    head              the ranger's parameters
    """

    readings: ScanReadings
    axes: Axes
    values: Array
    covariance: Array
    predicted: Array
    sigma: Array
    variance_factor: float
    head: SearchHead

    @property
    def u(self) -> Array:
        """Standard uncertainties (6,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def residual(self) -> Array:
        """Observed minus predicted (n,), V."""
        return self.readings.amplitude - self.predicted

    @property
    def width(self) -> float:
        """Full width at half of the peak, rad on the sky."""
        return float(2.0 * self.values[2] * HALF_RADIUS ** (1.0 / self.values[5]))

    def at(self, counts: Array) -> Array:
        """Amplitudes (m,), V, of the spot at real counts (m, 2), the shafts' looseness left out."""
        off = offsets_of_counts(self.values[:2], self.head.zeros, counts)
        x, y = np.where(np.array(FREE[self.axes]), off, 0.0).T
        radius, peak, background, flatness = self.values[2:]
        return gaussian_spot(x, y, peak=peak, radius=radius, background=background, flatness=flatness)

    @cached_property
    def verdict(self) -> Verdict:
        """Good where the readings scatter about the spot as claimed."""
        factor = self.variance_factor
        if factor > EXCESS:
            return Verdict(
                "doubtful",
                f"readings of {self.readings.name} scatter more than claimed (variance factor {factor:.2f}): u is "
                "enlarged, or the spot is no single round one",
            )
        return Verdict("good", f"readings scatter about the spot as claimed (variance factor {factor:.2f})")


@dataclass(frozen=True, eq=False)
class ScanPointing:
    """Counts of a retroreflector from several scans.

    counts       (2,) weighted means; NaN for an axis that no scan varied
    covariance   (2, 2)
    apart        largest difference of two scans of an axis, over its u; 0 for one scan an axis
    """

    counts: Array
    covariance: Array
    apart: float

    @property
    def u(self) -> Array:
        """Standard uncertainties (2,) of the counts."""
        return np.sqrt(np.diag(self.covariance))


def scanned_axes(counts: Array) -> Axes:
    """Axes that a scan varies. Raises EstimationError for none.

    counts   (n, 2)
    """
    varied = np.ptp(counts, axis=0) > 0.0
    if not varied.any():
        raise EstimationError("the mirror stood still: no axis was scanned (expected several counts)")
    return "both" if varied.all() else "azimuth" if varied[0] else "elevation"


def fit_scan_readings(readings: ScanReadings, head: SearchHead) -> ScanFit:
    """Spot of a scan with its covariance.

    readings   of one scan
    head       ranger's zeros, noise and full scale; its radius is not used

    Raises EstimationError for readings at full scale, too few, none lit, a spot at the edge.

    Source: `steering.spot_fit`, least squares with the weights of [HUBER09]; [PARKER04] sections 7.2.3 and 8.
    """
    name, a, n = readings.name, readings.amplitude, readings.counts
    full = np.flatnonzero(a >= head.full_scale_volt)
    if len(full):
        more = f" and {len(full) - MOST_NAMED} more" if len(full) > MOST_NAMED else ""
        places = ", ".join(readings.where[k] for k in full[:MOST_NAMED])
        raise EstimationError(
            f"{name}: {places}{more}: amplitude at full scale, {head.full_scale_volt:g} V, so that the peak was not "
            "measured (expected less gain, or another full scale)"
        )
    if len(a) < FEWEST:
        raise EstimationError(f"{name}: {len(a)} readings are too few for a spot (expected {FEWEST})")
    dark = float(np.median(np.sort(a)[: max(1, len(a) // 4)]))
    lit = int(np.sum(a > dark + TIMES_NOISE * head.noise_volt))
    if lit < FEWEST_LIT:
        raise EstimationError(
            f"{name}: {lit} of {len(a)} readings are more than {TIMES_NOISE:g} x {head.noise_volt:g} V above the "
            f"background (expected {FEWEST_LIT} of a spot)"
        )
    axes = _axes_of(readings)
    middle = n[int(np.argmax(a))]
    off = offsets_of_counts(middle, head.zeros, n)
    head = replace(head, radius=_start_radius(off, a, count_size(middle, head.zeros)))
    varied = np.array(FREE[axes])
    size = np.where(varied, count_size(middle, head.zeros) / head.radius * head.u_counts, 0.0)
    xy = np.where(varied, off / head.radius, 0.0)
    free = np.append(varied, np.ones(4, dtype=bool))
    model = SpotModel(xy, a, clipped=np.zeros(len(a), dtype=bool), head=head, size=size, free=free)
    p, q, factor = model.fitted()
    if not np.isfinite(p).all() or not np.isfinite(q).all() or p[3] <= 0.0:
        raise EstimationError(f"{name}: the readings do not determine a spot (expected a wider or a finer scan)")
    _refuse_edge(readings, axes, xy, p)
    centre, slopes = _in_counts(middle, head, p)
    slopes = np.where(np.outer(varied, varied), slopes, 0.0)
    by_fit = shape_slopes(p, head.radius)
    by_fit[:2, :2] = slopes
    return ScanFit(
        readings=readings,
        axes=axes,
        values=np.array([*np.where(varied, centre, n[0]), np.exp(p[2]) * head.radius, p[3], p[4], 1.0 + p[5] ** 2]),
        covariance=by_fit @ q @ by_fit.T,
        predicted=model.model(p),
        sigma=model.sigma(p),
        variance_factor=factor,
        head=head,
    )


def pointing_of(fits: Sequence[ScanFit]) -> ScanPointing:
    """Weighted mean of the centres of several scans.

    fits   scans over one retroreflector

    Source: [JCGM100] 5.1 for independent scans; scans of both axes enter with their covariance.
    """
    normal, right = np.zeros((2, 2)), np.zeros(2)
    for fit in fits:
        varied = np.array(FREE[fit.axes])
        weight = np.zeros((2, 2))
        weight[np.ix_(varied, varied)] = np.linalg.inv(fit.covariance[:2, :2][np.ix_(varied, varied)])
        normal, right = normal + weight, right + weight @ fit.values[:2]
    scanned = np.diag(normal) > 0.0
    counts, covariance = np.full(2, np.nan), np.full((2, 2), np.nan)
    covariance[np.ix_(scanned, scanned)] = np.linalg.inv(normal[np.ix_(scanned, scanned)])
    counts[scanned] = covariance[np.ix_(scanned, scanned)] @ right[scanned]
    return ScanPointing(counts, covariance, _apart(fits))


def pointing_verdict(fits: Sequence[ScanFit], pointing: ScanPointing) -> Verdict:
    """Verdict of all scans, and of their agreement."""
    verdict = worst([fit.verdict for fit in fits])
    if pointing.apart > MOST_APART:
        doubt = f"centres of two scans differ by {pointing.apart:.1f} u: the retroreflector or the ranger moved"
        return verdict.hearing([doubt])
    return verdict


def _apart(fits: Sequence[ScanFit]) -> float:
    """Largest difference of two scans of an axis over its standard uncertainty."""
    largest = 0.0
    for k in range(2):
        of_axis = [(fit.values[k], fit.covariance[k, k]) for fit in fits if FREE[fit.axes][k]]
        for (first, v), (second, w) in combinations(of_axis, 2):
            largest = max(largest, float(abs(first - second) / np.sqrt(v + w)))
    return largest


def _axes_of(readings: ScanReadings) -> Axes:
    try:
        return scanned_axes(readings.counts)
    except EstimationError as problem:
        raise EstimationError(f"{readings.name}: {problem}") from problem


def _start_radius(off: Array, a: Array, size: Array) -> float:
    """Radius at 1/e^2, rad, from the readings above the lower half: their farthest pair is 2 x 0.59 radii apart."""
    bright = off[a > 0.5 * (a.min() + a.max())]
    across = float(np.max(np.ptp(bright, axis=0)))
    return max(across, float(size.max())) / (2.0 * HALF_RADIUS)


def _refuse_edge(readings: ScanReadings, axes: Axes, xy: Array, p: Array) -> None:
    """Raise EstimationError where an axis's readings end on the spot."""
    side = LEAST_SIDE * float(np.exp(p[2]))
    for k, (axis, varied) in enumerate(zip(("azimuth", "elevation"), FREE[axes], strict=True)):
        low, high = p[k] - xy[:, k].min(), xy[:, k].max() - p[k]
        if varied and min(low, high) < side:
            n = readings.counts[:, k]
            raise EstimationError(
                f"{readings.name}: the spot lies at the {'lower' if low < high else 'upper'} edge of the scan, "
                f"{axis} {n.min():g} to {n.max():g} counts (expected readings on both sides of it)"
            )


def _in_counts(middle: Array, head: SearchHead, p: Array) -> tuple[Array, Array]:
    """Centre as counts, and derivatives (2, 2) by the place in radii."""
    step = 1e-4
    probes = p[:2] + step * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    n = counts_of_offsets(middle, head.zeros, probes * head.radius)
    return n[0], np.column_stack([n[1] - n[2], n[3] - n[4]]) / (2.0 * step)
