"""Structural model of each body over the nights of an archive: gravity, temperature, time, steps.

A body is the points of one kind in one frame. In the axes of its rigid frame each point is at

    place + R_p (B f_t + wander of the body) + O_p f_t + steps,       f = 1, sinE, cosE, t, year, sin(year), cos(year)

B are six components of the body's shift and turn about its middle, O_p the point's own; both with covariance. Wind, air
and datum move all points of a night together: the body's noise, new each night or lasting, is estimated and enters.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.estimation.harmonic.body import rigid_design
from catseye.estimation.series.correlated import SeriesGroup, SeriesNoise, fit_series, measured
from catseye.estimation.series.noise import outliers
from catseye.estimation.series.steps import SteppedFit, fit_with_steps
from catseye.reduction.structure.group import Nominal, carrier_of
from catseye.reduction.trends.functions import TrendFunctions, separated_functions
from catseye.reduction.trends.rigid import NightlyMotion, determines_motion, nightly_motion

FRAMES = ("ground", "alidade", "reflector")
CALMER = 0.7  # of the scatter in a frame nearer the ground: less is needed to belong to a farther frame
FEW_POINTS = 500  # of a body: among fewer, a step of one is seen in the others too
LARGEST_SHARE = 0.5  # of the largest step of such a body: smaller ones wait for the next pass
PASSES = 6
OUTLIER = 0.01  # probability that any reading of a body is called one without cause


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Points of one kind through T epochs, ground frame.

    name            kind, such as "dish prism"
    names           n points
    mjd             (T,) rising
    azimuth, elevation   (T,) rad; NaN where unknown
    temperature_c   (T,) degrees C; NaN where unknown
    x               (T, n, 3) m; NaN where not measured
    covariance      (T, n, 3, 3) m^2
    """

    name: str
    names: tuple[str, ...]
    mjd: Array
    azimuth: Array
    elevation: Array
    temperature_c: Array
    x: Array
    covariance: Array

    def part(self, epochs: np.ndarray, points: np.ndarray, name: str = "") -> "BodyPoints":
        """Some of the epochs and points."""
        return BodyPoints(
            name=name or self.name,
            names=tuple(self.names[i] for i in np.flatnonzero(points)),
            mjd=self.mjd[epochs],
            azimuth=self.azimuth[epochs],
            elevation=self.elevation[epochs],
            temperature_c=self.temperature_c[epochs],
            x=self.x[epochs][:, points],
            covariance=self.covariance[epochs][:, points],
        )


@dataclass(frozen=True, eq=False)
class TrendSettings:
    """Settings of the models.

    harmonics     of elevation, 1 or 2
    annual        True for an annual wave beside temperature
    probability   of a step or drift without cause, in one series
    """

    harmonics: int = 1
    annual: bool = True
    probability: float = 1e-4


@dataclass(frozen=True, eq=False)
class MotionTrend:
    """Model of the shift and turn of a body.

    values       (T, 6) m and rad of each night, from the mean place
    covariance   (T, 6, 6)
    found        its fit, in units of `scale`
    scale        (6,) m and rad
    """

    values: Array
    covariance: Array
    found: SteppedFit
    scale: Array

    @property
    def coefficients(self) -> Array:
        """Shift and turn (k, 6) by each function, m and rad."""
        return self.found.fit.coefficients[0] * self.scale

    @property
    def coefficient_covariance(self) -> Array:
        """Covariance (6 k, 6 k), function by function."""
        size = np.tile(self.scale, len(self.found.fit.coefficients[0]))
        return self.found.fit.covariance[0] * np.outer(size, size)

    @property
    def night_u(self) -> Array:
        """Standard uncertainty (6,) of one night's motion, scatter included, m and rad."""
        with np.errstate(invalid="ignore"):
            claimed = _mean(np.einsum("tii->ti", self.covariance))
        noise = self.found.noise.white**2 + self.found.noise.wander**2
        return np.sqrt(claimed + noise * self.scale**2)


@dataclass(frozen=True, eq=False)
class BodyTrend:
    """Structural model of a body.

    name, frame    of the body
    points         in the epochs used
    functions      f of the model
    place          (n, 3) m, in the frame: origin of the displacements
    middle         (3,) m, about which the body turns
    motion         of the body; None where its points determine none
    displacement   (T, n, 3) m of each point, the body's motion taken off
    spread         (T, n, 3, 3) m^2 of it
    own            fit of each point: functions, steps, noise
    outlier        (T, n) True for readings that were left out
    """

    name: str
    frame: str
    points: BodyPoints
    functions: TrendFunctions
    place: Array
    middle: Array
    motion: MotionTrend | None
    displacement: Array
    spread: Array
    own: SteppedFit
    outlier: np.ndarray

    @property
    def night_u(self) -> Array:
        """Standard uncertainty (n, 3) of one night's place of a point, scatter included; NaN without readings."""
        with np.errstate(invalid="ignore"):
            claimed = np.einsum("tnii->tni", np.where(self.outlier[..., None, None], np.nan, self.spread))
        noise = self.own.noise.white**2 + self.own.noise.wander**2
        return np.sqrt(_mean(claimed) + noise)

    def predict(self, elevation: float, temperature_c: float, mjd: float) -> tuple[Array, Array]:
        """Places (n, 3) m in the frame, and their covariance (n, 3, 3) without a night's scatter, steps included."""
        row = self.functions.rows(*(np.array(v, float) for v in (elevation, temperature_c, mjd)))
        k = len(row)
        place = self.place + np.einsum("k,nkd->nd", row, self.own.fit.coefficients)
        blocks = self.own.fit.covariance.reshape(-1, k, 3, k, 3)
        covariance = np.einsum("k,nkilj,l->nij", row, blocks, row, optimize=True)
        for step in self.own.steps:
            if self.points.mjd[step.at] <= mjd:
                place[step.series] += step.size
        if self.motion is not None:
            r = rigid_design(self.place - self.middle)
            six = row @ self.motion.coefficients
            for step in self.motion.found.steps:
                if self.points.mjd[step.at] <= mjd:
                    six = six + step.size * self.motion.scale
            q = self.motion.coefficient_covariance.reshape(k, 6, k, 6)
            place = place + r @ six
            covariance = covariance + r @ np.einsum("k,kilj,l->ij", row, q, row) @ np.swapaxes(r, 1, 2)
        return place, covariance


def bodies_in_frames(points: BodyPoints, nominal: Nominal) -> list[tuple[str, BodyPoints]]:
    """Points of a kind, parted by the frame in which they rest.

    That of the least scatter over the nights: a dish prism rests in the reflector's axes. Without a change of posture
    all belong to the ground. Nights of unknown posture are left out for frames that move.

    Raises nothing; frames without points are absent.
    """
    finite = np.isfinite(points.azimuth) & np.isfinite(points.elevation)
    scatter = []
    for frame in FRAMES:
        used = finite if frame != "ground" else np.ones(len(points.mjd), bool)
        scatter.append(_scatter(_in_frame(points.x[used], points, used, frame, nominal)))
    best = np.zeros(len(points.names), int)
    least = scatter[0]
    for i in (1, 2):
        calmer = scatter[i] < CALMER * least
        best[calmer] = i
        least = np.where(calmer, scatter[i], least)
    found = []
    several = len(np.unique(best)) > 1
    for i, frame in enumerate(FRAMES):
        at = best == i
        if at.any():
            used = finite if frame != "ground" else np.ones(len(points.mjd), bool)
            some = measured(points.x[:, at]).any(axis=1)
            name = f"{points.name} ({frame})" if several else points.name
            found.append((frame, points.part(used & some, at, name)))
    return found


def fit_body(points: BodyPoints, frame: str, settings: TrendSettings, nominal: Nominal) -> BodyTrend:
    """Structural model of the points of one body.

    points     of the body, through its epochs
    frame      in which it rests
    settings   of the model
    nominal    rigid telescope

    Raises InputError where no point has enough nights.
    """
    functions = separated_functions(
        points.elevation,
        points.temperature_c,
        points.mjd,
        harmonics=settings.harmonics,
        annual=settings.annual,
    )
    everything = np.ones(len(points.mjd), bool)
    x = _in_frame(points.x, points, everything, frame, nominal)
    turn = _carriers(points, everything, frame, nominal)[0]
    covariance = np.swapaxes(turn, 1, 2)[:, None] @ points.covariance @ turn[:, None]
    place = _mean(x)
    middle = np.nanmean(place, axis=0)
    rows = functions.rows(points.elevation, points.temperature_c, points.mjd)
    if int(measured(x).sum(axis=0).max(initial=0)) <= len(functions.names):
        raise InputError(
            f"{points.name}: no point has more than {len(functions.names)} nights (expected more than the functions of "
            "its model)"
        )
    y = x - place
    arms = place - middle
    moving = determines_motion(arms)
    finite = np.zeros_like(y)
    outlier = np.zeros(y.shape[:2], bool)
    own, motion, found = None, None, None
    noise: SeriesNoise | None = None
    for _ in range(PASSES if moving and len(arms) < FEW_POINTS else 1):
        own, motion, outlier = _points_fit(points.mjd, y - finite, covariance, arms, rows, settings, moving, noise)
        fresh, noise = own.steps, own.noise
        if not fresh or not moving or len(arms) >= FEW_POINTS:
            break
        largest = max(float(np.linalg.norm(step.size)) for step in fresh)
        for step in fresh:
            if np.linalg.norm(step.size) >= LARGEST_SHARE * largest:
                finite[step.at :, step.series] += step.size
    else:
        own, motion, outlier = _points_fit(points.mjd, y - finite, covariance, arms, rows, settings, moving, noise)
    assert own is not None
    group = _group(points.mjd, motion, y - finite, covariance, outlier)
    if finite.any():  # the known steps are fitted again, with all else
        group = SeriesGroup(group.days, group.values + finite, group.covariance)
        own = fit_with_steps(group, rows, probability=settings.probability, noise=own.noise)
    if motion is not None:
        found = _motion_fit(points.mjd, motion, rows, settings)
    return BodyTrend(
        name=points.name,
        frame=frame,
        points=points,
        functions=functions,
        place=place,
        middle=middle,
        motion=found,
        displacement=group.values
        if motion is None
        else np.where(outlier[..., None], motion.residual + finite, group.values),
        spread=group.covariance,
        own=own,
        outlier=outlier,
    )


def _points_fit(
    mjd: Array,
    y: Array,
    covariance: Array,
    arms: Array,
    rows: Array,
    settings: TrendSettings,
    moving: bool,
    noise: SeriesNoise | None,
) -> tuple[SteppedFit, NightlyMotion | None, np.ndarray]:
    """Fit of each point, the motion of the nights, and outliers (T, n)."""
    motion, scatter, shape = None, 0.0, np.zeros_like(y)
    outlier = np.zeros(y.shape[:2], bool)
    group = SeriesGroup(mjd, y, covariance)
    white = SeriesNoise.of(3)
    for _ in range(3 if moving else 2):
        if moving:
            motion = nightly_motion(np.where(outlier[..., None], np.nan, y) - shape, covariance, arms, scatter=scatter)
            motion = _with_all(motion, y - shape, arms, covariance)
            group = SeriesGroup(mjd, motion.residual + shape, motion.spread)
        residual, shape = _robust_residual(group, rows, white, outlier, arms if moving else None)
        u = np.sqrt(np.maximum(np.einsum("tnii->tni", covariance), 0.0))
        total = np.sqrt(np.maximum(np.einsum("tnii->tni", group.covariance), 0.0) + scatter**2)
        outlier = outliers(residual, total, probability=OUTLIER)
        clean = np.where(outlier[..., None], np.nan, residual)
        square = float(np.nanmedian(clean**2)) / 0.455 if np.isfinite(clean).any() else 0.0
        claimed = float(np.nanmedian(np.where(np.isfinite(clean), u**2, np.nan))) if np.isfinite(clean).any() else 0.0
        scatter = float(np.sqrt(max(square - claimed, 0.0)))
    if moving:
        inlying = np.where(outlier[..., None], np.nan, y)
        motion = nightly_motion(inlying - shape, covariance, arms, scatter=scatter)
        motion = _with_all(motion, y - shape, arms, covariance)
        motion = NightlyMotion(motion.six, motion.covariance, motion.residual + shape, motion.spread)
    group = _group(mjd, motion, y, covariance, outlier)
    return fit_with_steps(group, rows, probability=settings.probability, noise=noise), motion, outlier


def _with_all(motion: NightlyMotion, y: Array, arms: Array, covariance: Array) -> NightlyMotion:
    """Motion with residuals of the outliers too."""
    remainder = y - np.einsum("nij,tj->tni", rigid_design(arms), motion.six)
    finite = measured(motion.residual)
    spread = np.where((finite | ~measured(remainder))[..., None, None], motion.spread, covariance)
    return NightlyMotion(
        six=motion.six,
        covariance=motion.covariance,
        residual=np.where(finite[..., None], motion.residual, remainder),
        spread=spread,
    )


def _group(mjd: Array, motion: NightlyMotion | None, y: Array, covariance: Array, outlier: np.ndarray) -> SeriesGroup:
    """Series of the points without their outliers."""
    values, spread = (y, covariance) if motion is None else (motion.residual, motion.spread)
    return SeriesGroup(mjd, np.where(outlier[..., None], np.nan, values), spread)


def _robust_residual(
    group: SeriesGroup, rows: Array, noise: SeriesNoise, outlier: np.ndarray, arms: Array | None
) -> tuple[Array, Array]:
    """Residuals of all readings from a fit without the outliers, and the points' own displacements.

    arms   of the points; the body's part of the fit, as most points show it, is not their own; None: no body
    """
    clean = SeriesGroup(group.days, np.where(outlier[..., None], np.nan, group.values), group.covariance)
    fit = fit_series(clean, rows, noise)
    theta = np.nan_to_num(fit.coefficients)
    residual = group.values - np.einsum("tk,nkd->tnd", rows, theta)
    if arms is not None:
        by_function = np.moveaxis(fit.coefficients, 1, 0)
        spread = np.moveaxis(fit.u, 1, 0)[..., None] ** 2 * np.eye(3)
        six = np.nan_to_num(nightly_motion(by_function, spread, arms).six)
        theta = theta - np.einsum("nij,kj->nki", rigid_design(arms), six)
    return residual, np.einsum("tk,nkd->tnd", rows, theta)


def _motion_fit(mjd: Array, motion: NightlyMotion, rows: Array, settings: TrendSettings) -> MotionTrend:
    """Model of a body's shift and turn, all six together."""
    return fit_motion(mjd, motion.six, motion.covariance, rows, settings)


def fit_motion(mjd: Array, six: Array, covariance: Array, rows: Array, settings: TrendSettings) -> MotionTrend:
    """Model of shifts and turns of a body.

    mjd          (T,) rising
    six          (T, 6) m and rad; NaN in nights without
    covariance   (T, 6, 6)
    rows         (T, k) functions
    settings     of the model
    """
    u = np.sqrt(np.maximum(np.einsum("tii->ti", covariance), 0.0))
    scale = np.nanmedian(np.where(u > 0.0, u, np.nan), axis=0)
    group = SeriesGroup(mjd, (six / scale)[:, None], (covariance / np.outer(scale, scale))[:, None])
    fit = fit_series(group, rows, SeriesNoise.of(6))
    bad = outliers(fit.residual, np.ones_like(fit.residual), probability=OUTLIER)
    group = SeriesGroup(mjd, np.where(bad[..., None], np.nan, group.values), group.covariance)
    found = fit_with_steps(group, rows, probability=settings.probability, by_component=True)
    return MotionTrend(six, covariance, found, scale)


def _mean(values: Array) -> Array:
    """Mean over the first axis, missing values passed over; NaN where all are."""
    finite = np.isfinite(values)
    count = finite.sum(axis=0)
    total = np.where(finite, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _scatter(x: Array) -> Array:
    """Root mean square (n,) of places about their mean; infinity for fewer than two."""
    away = x - _mean(x)
    finite = measured(away)
    square = np.where(finite, np.sum(np.where(finite[..., None], away, 0.0) ** 2, axis=2), 0.0).sum(axis=0)
    count = finite.sum(axis=0)
    return np.where(count > 1, np.sqrt(square / np.maximum(count, 1)), np.inf)


def _carriers(points: BodyPoints, used: np.ndarray, frame: str, nominal: Nominal) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) and translations (T, 3) from a frame to the ground."""
    pairs = [
        carrier_of(frame, float(a), float(e), nominal=nominal)
        for a, e in zip(points.azimuth[used], points.elevation[used], strict=True)
    ]
    return (
        np.array([pair.rotation for pair in pairs]).reshape(-1, 3, 3),
        np.array([pair.translation for pair in pairs]).reshape(-1, 3),
    )


def _in_frame(x: Array, points: BodyPoints, used: np.ndarray, frame: str, nominal: Nominal) -> Array:
    """Points (T, n, 3) in the axes of a frame."""
    rotation, translation = _carriers(points, used, frame, nominal)
    return (x - translation[:, None]) @ rotation
