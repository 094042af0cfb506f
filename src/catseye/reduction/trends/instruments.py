"""Drifts and steps of rangers' zeros, of thermometers, and of the scale of the ground's points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.estimation.series.correlated import SeriesFit, SeriesGroup, SeriesNoise, fit_series, measured
from catseye.estimation.series.noise import outliers
from catseye.estimation.series.steps import SteppedFit, fit_with_steps
from catseye.reduction.trends.bodies import OUTLIER, BodyTrend, TrendSettings
from catseye.reduction.trends.functions import YEAR, TrendFunctions, separated_functions
from catseye.reduction.trends.tables import ArchivedNights, SingleSeries

CELSIUS_ZERO = 273.15  # K at 0 degrees C
FEWEST_SCALE = 4  # points of a night for its scale


@dataclass(frozen=True, eq=False)
class InstrumentTrend:
    """Series of one quantity of several instruments, with their model.

    parameter      "zero", "ranges", ...
    subjects       S instruments
    mjd            (T,) rising
    values, u      (T, S); NaN where there is none
    functions      of the model
    found          fit, steps, noise
    outlier        (T, S) True for readings that were left out
    prior, u_prior (S,) of the newest calibration; NaN without
    """

    parameter: str
    subjects: tuple[str, ...]
    mjd: Array
    values: Array
    u: Array
    functions: TrendFunctions
    found: SteppedFit
    outlier: np.ndarray
    prior: Array
    u_prior: Array

    @property
    def rows(self) -> Array:
        """Functions (T, k) at the nights, at the mean temperature."""
        return self.at(self.mjd)

    def at(self, mjd: Array) -> Array:
        """Functions (..., k) at times and the mean temperature."""
        warm = np.full(np.shape(mjd), self.functions.reference_c)
        return self.functions.rows(np.zeros(np.shape(mjd)), warm, mjd)

    @property
    def model(self) -> Array:
        """Model (T, S) at the mean temperature, steps included."""
        fit = self.rows @ np.moveaxis(self.found.fit.coefficients[..., 0], 0, 1)
        return fit + self.found.level(len(self.mjd))[..., 0]

    @property
    def night_u(self) -> Array:
        """Standard uncertainty (S,) of one night's value, scatter included."""
        finite = np.isfinite(self.u)
        square = np.where(finite, self.u, 0.0) ** 2
        mean = square.sum(axis=0) / np.maximum(finite.sum(axis=0), 1)
        return np.sqrt(mean + self.found.noise.white[0] ** 2 + self.found.noise.wander[0] ** 2)

    def latest(self, series: int) -> tuple[float, float]:
        """Model of a series at the last night, at the mean temperature, and its u; steps are taken as certain."""
        row = self.at(self.mjd[-1])
        value = float(row @ self.found.fit.coefficients[series, :, 0])
        value += sum(float(step.size[0]) for step in self.found.steps if step.series == series)
        variance = float(row @ self.found.fit.covariance[series] @ row)
        variance += sum(float(step.covariance[0, 0]) for step in self.found.steps if step.series == series)
        return value, float(np.sqrt(max(variance, 0.0)))


def fit_instruments(series: Sequence[SingleSeries], settings: TrendSettings) -> InstrumentTrend | None:
    """Trends of one parameter of several instruments; None where no series has two readings.

    series     of one parameter
    settings   of the models
    """
    series = [one for one in series if len(one.mjd) >= 2]
    if not series:
        return None
    mjd = np.unique(np.concatenate([one.mjd for one in series]))
    t, s = len(mjd), len(series)
    values, u, warm = (np.full((t, s), np.nan) for _ in range(3))
    for k, one in enumerate(series):
        at = np.searchsorted(mjd, one.mjd)
        values[at, k], u[at, k], warm[at, k] = one.value, one.u, one.temperature_c
    finite = np.isfinite(warm)
    temperature = np.where(finite.any(axis=1), np.where(finite, warm, 0.0).sum(axis=1), np.nan) / np.maximum(
        finite.sum(axis=1), 1
    )
    functions = separated_functions(np.full(t, np.nan), temperature, mjd, posture=False, annual=False)
    rows = functions.rows(np.zeros(t), np.nan_to_num(temperature), mjd)
    unit = float(np.nanmedian(u))
    group = SeriesGroup(mjd, (values / unit)[..., None], (u / unit)[..., None, None] ** 2)
    noise, bad = SeriesNoise.of(1), np.zeros((t, s), bool)
    for _ in range(3):
        clean = SeriesGroup(mjd, np.where(bad[..., None], np.nan, group.values), group.covariance)
        fit = fit_series(clean, rows, noise)
        residual = group.values - np.einsum("tk,skd->tsd", rows, np.nan_to_num(fit.coefficients))
        bad = outliers(residual, np.sqrt(group.covariance[..., 0]), probability=OUTLIER)
    clean = SeriesGroup(mjd, np.where(bad[..., None], np.nan, group.values), group.covariance)
    found = fit_with_steps(clean, rows, probability=settings.probability)
    return InstrumentTrend(
        parameter=series[0].parameter,
        subjects=tuple(one.subject for one in series),
        mjd=mjd,
        values=values,
        u=u,
        functions=functions,
        found=_scaled(found, unit),
        outlier=bad,
        prior=np.array([one.prior[-1] for one in series]),
        u_prior=np.array([one.u_prior[-1] for one in series]),
    )


def _scaled(found: SteppedFit, unit: float) -> SteppedFit:
    """Fit of values that were divided by a unit, in the values' own."""
    from dataclasses import replace

    return replace(
        found,
        fit=replace(
            found.fit,
            coefficients=found.fit.coefficients * unit,
            covariance=found.fit.covariance * unit**2,
            residual=found.fit.residual * unit,
        ),
        noise=SeriesNoise(found.noise.white * unit, found.noise.wander * unit, found.noise.days),
        steps=tuple(replace(s, size=s.size * unit, covariance=s.covariance * unit**2) for s in found.steps),
        scan=replace(found.scan, step=found.scan.step * unit, covariance=found.scan.covariance * unit**2),
    )


def ground_scale(body: BodyTrend, nights: ArchivedNights) -> SingleSeries | None:
    """Scale of the ground's points in each night, as an error of all thermometers together, degrees C.

    Ranges through air that is warmer than its thermometers say are too long by their share of the refractivity: a scale
    of the ground's points. None for a body whose points do not rest on the ground, or are too few.

    Source: refractivity is as the density of air, 1 / T at constant pressure: d(n - 1)/dT = -(n - 1) / T.
    """
    if body.frame != "ground" or body.motion is None:
        return None
    arms = body.place - body.middle
    y = np.where(body.outlier[..., None], np.nan, body.displacement)
    present = measured(y) & np.isfinite(body.spread).all(axis=(2, 3))
    spread = np.where(present[..., None, None], body.spread, np.eye(3))
    spread = spread + body.own.noise.white[0] ** 2 * np.eye(3)
    weighted = np.einsum("tnij,nj->tni", np.linalg.inv(spread), arms) * present[..., None]
    weight = np.einsum("tni,ni->t", weighted, arms)
    enough = (present.sum(axis=1) >= FEWEST_SCALE) & (weight > 0.0)
    weight = np.where(enough, weight, np.nan)
    scale = np.einsum("tni,tni->t", weighted, np.where(present[..., None], y, 0.0)) / weight
    at = np.clip(np.searchsorted(nights.mjd, body.points.mjd), 0, len(nights) - 1)
    per_c = nights.refractivity_ppm[at] * 1e-6 / (CELSIUS_ZERO + body.points.temperature_c)
    good = enough & np.isfinite(scale) & np.isfinite(per_c) & (per_c > 0.0)
    if not good.any():
        return None
    blank = np.full(int(good.sum()), np.nan)
    return SingleSeries(
        subject=body.name,
        parameter="scale",
        mjd=body.points.mjd[good],
        value=-(scale / per_c)[good],
        u=(weight**-0.5 / per_c)[good],
        temperature_c=body.points.temperature_c[good],
        prior=blank,
        u_prior=blank,
    )


def drift_probability(fit: SeriesFit, functions: TrendFunctions) -> tuple[Array, Array, Array]:
    """Rate (S, d) per year, its covariance (S, d, d), and the probability (S,) of a larger one without a drift.

    Ones where no rate was fitted. The probability is by F with the variance factor of each series.

    Source: [RAO73] section 4b.
    """
    from scipy.special import betainc

    s, k, d = fit.coefficients.shape
    if YEAR not in functions.names:
        return np.full((s, d), np.nan), np.full((s, d, d), np.nan), np.ones(s)
    at = functions.names.index(YEAR)
    rate = fit.coefficients[:, at]
    covariance = fit.covariance.reshape(s, k, d, k, d)[:, at, :, at]
    finite = np.isfinite(rate).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)) & (fit.degrees_of_freedom > 0)
    spread = np.where(finite[:, None, None], covariance, np.eye(d))
    size = np.where(finite[:, None], rate, 0.0)
    square = np.einsum("si,si->s", size, np.linalg.solve(spread, size[..., None])[..., 0]) / d
    n = np.maximum(fit.degrees_of_freedom, 1)
    factor = np.maximum(np.nan_to_num(fit.variance_factor, nan=1.0), 1e-6)
    return rate, covariance, np.where(finite, betainc(0.5 * n, 0.5 * d, n / (n + d * square / factor)), 1.0)
