"""Fit of the eight-term pointing series, and its verdict.

Fitted to star offsets or to metrology. IE, HZCZ and HZSZ are nearly the same: 1, sin E and cos E over the
elevations of a night differ little. The fit does not fail there but reports it: their covariance is large, the weak
combination is named with its uncertainty, and the effect of the combination on the sky where stars were seen is
small. Predictions use the covariance and stay good.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, SPEED_OF_LIGHT
from catseye.errors import EstimationError
from catseye.estimation.least_squares.singular import LinearEstimate, best_linear_estimate
from catseye.geometry.antenna.pointing_series import TERMS, PointingSeries, columns, design
from catseye.reduction.pose.star_readings import BetterReading, better_readings
from catseye.verdict import Verdict

LIMIT = 4.0  # |w| of a star's coordinate beyond which `reject` leaves the star out
PART = 0.2  # of the largest part of a combination: smaller parts are not named
UNLIKELY = 1e-4  # chance, on either side, below which a stated uncertainty does not fit the scatter
LOWEST_FREQUENCY = 1.15e9  # Hz, lowest of the Gregorian receivers: their widest beam
APERTURE = 100.0  # m across: [GBTPM01]'s telescope
TENTH = 0.1  # of the beam's width: a pointing error of it costs 3 % of the gain, exp(-4 ln 2 / 100)
SECTOR = 24.0 * DEGREE  # a turn written in hours; in radians it is 6.3. In less azimuth the axis's lean is undetermined
LOWEST = 6.0 * DEGREE  # a right angle written in hours; in radians it is 1.6. No telescope sees stars below it only
FAMILIES = (("IA", "CA", "NPAE"), ("IE", "HZCZ", "HZSZ"))  # 1, sin E, cos E in azimuth, and in elevation


@dataclass(frozen=True, eq=False)
class WeakDirection:
    """Least certain combination of terms of one family.

    parts         term: its part of the combination, squares adding to one
    u             rad, standard uncertainty of the combination
    u_on_the_sky  rad, effect of that uncertainty on the beam, root mean square over the observed directions
    """

    parts: dict[str, float]
    u: float
    u_on_the_sky: float

    @property
    def text(self) -> str:
        largest = max(abs(v) for v in self.parts.values())
        named = [f"{v:+.2f} {t}" for t, v in self.parts.items() if abs(v) > PART * largest]
        return (
            f"{' '.join(named)} has u = {self.u / ARCSECOND:.2g} arcsec; over the observed directions that "
            f"moves the beam by {self.u_on_the_sky / ARCSECOND:.2g} arcsec rms"
        )


@dataclass(frozen=True, eq=False)
class PointingFit:
    """Fit of the eight-term pointing series.

    series              terms, values and covariance, rad
    azimuth, elevation  (n,) rad, on the sky, of all observations
    observed            (n, 2) rad, azimuth times cos E and elevation: encoders less sky
    residual            (n, 2) rad, observed minus fitted, of all
    w                   (n, 2) standardised residuals; nan for a rejected observation
    used                (n,) bool
    variance_factor     of the claimed uncertainties; nan without redundancy
    scaled              the covariance is multiplied by it, because no uncertainty was claimed
    pvv, degrees_of_freedom
    condition           of the design with unit columns
    weak                least certain combination of each family of similar terms
    stars               True for stars, independent of each other; else metrology
    sources             verdicts of the results that were read, by their names
    """

    series: PointingSeries
    azimuth: np.ndarray
    elevation: np.ndarray
    observed: np.ndarray
    residual: np.ndarray
    w: np.ndarray
    used: np.ndarray
    variance_factor: float
    scaled: bool
    pvv: float
    degrees_of_freedom: int
    condition: float
    weak: tuple[WeakDirection, ...]
    stars: bool = False
    sources: Mapping[str, Verdict | None] = field(default_factory=dict)

    @property
    def sky_rms(self) -> float:
        """Root mean square length of the used residuals, rad."""
        return float(np.sqrt(np.mean(np.sum(self.residual[self.used] ** 2, axis=1))))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation (k, k) of the coefficients."""
        u = np.sqrt(np.diag(self.series.covariance))
        return np.asarray(self.series.covariance / np.outer(u, u))

    @property
    def verdict(self) -> Verdict:
        """Verdict on the series, no better than its sources'.

        Separation of terms, scatter against claimed or plausible values, columns that fit better in another reading.
        """
        return _verdict(self).resting_on(self.sources)


def fit_pointing(
    azimuth: np.ndarray,
    elevation: np.ndarray,
    observed: np.ndarray,
    *,
    covariance: np.ndarray | None = None,
    u: float | None = None,
    terms: Sequence[str] = TERMS,
    reject: bool = False,
    where: Sequence[str] | None = None,
) -> PointingFit:
    """Fit the eight-term pointing series by least squares.

    azimuth, elevation   (n,) rad, on the sky
    observed             (n, 2) rad, azimuth times cos E and elevation: encoders less sky
    covariance           (2n, 2n) rad^2, of the observed, row by row; or
    u                    rad, of each coordinate; neither: equal weights, scaled by the scatter
    terms                to fit, a selection of TERMS
    reject               leave out observations, the worst first, while a coordinate's |w| is beyond 4
    where                n places for errors, such as "line 12"

    Raises EstimationError where terms float, naming them: stars at one elevation alone hold only one of IE, HZCZ, HZSZ.
    """
    n = len(azimuth)
    named = list(where) if where is not None else [f"observation {k + 1}" for k in range(n)]
    chosen = columns(terms)
    full = design(azimuth, elevation)[:, :, chosen]
    q = np.eye(2 * n) * (ARCSECOND if u is None else u) ** 2 if covariance is None else np.asarray(covariance)
    if q.shape != (2 * n, 2 * n) or np.shape(observed) != (n, 2):
        raise EstimationError(f"{n} directions with {np.shape(observed)} offsets and covariance {q.shape}")
    scaled = covariance is None and u is None
    used = np.ones(n, dtype=bool)
    while True:
        solution = _solved(full, observed, q, used, terms, named)
        factor = solution.pvv / solution.degrees_of_freedom if solution.degrees_of_freedom else float("nan")
        w = _standardised(solution, used, factor if scaled else 1.0)
        worst = int(np.argmax(np.nan_to_num(np.abs(w)).max(axis=1)))
        if not reject or np.nan_to_num(np.abs(w[worst])).max() <= LIMIT or solution.degrees_of_freedom <= 2:
            break
        used[worst] = False
    if scaled and not solution.degrees_of_freedom:
        raise EstimationError(
            f"{int(used.sum())} observations only just determine {len(terms)} terms and no uncertainty is claimed: "
            "their uncertainty is unknown (expected more observations, or u)"
        )
    spread = solution.covariance * (factor if scaled else 1.0)
    unit = full[used].reshape(-1, len(chosen))
    return PointingFit(
        series=PointingSeries(tuple(terms), solution.estimate, spread),
        azimuth=np.asarray(azimuth),
        elevation=np.asarray(elevation),
        observed=np.asarray(observed),
        residual=np.asarray(observed) - full @ solution.estimate,
        w=w,
        used=used,
        variance_factor=factor,
        scaled=scaled,
        pvv=solution.pvv,
        degrees_of_freedom=solution.degrees_of_freedom,
        condition=float(np.linalg.cond(unit / np.linalg.norm(unit, axis=0))),
        weak=_weak(tuple(terms), spread, unit),
        stars=covariance is None,
    )


def _solved(
    full: np.ndarray, observed: np.ndarray, q: np.ndarray, used: np.ndarray, terms: Sequence[str], named: Sequence[str]
) -> LinearEstimate:
    rows = np.flatnonzero(np.repeat(used, 2)).tolist()
    called = [f"{named[r // 2]} {'azimuth' if r % 2 == 0 else 'elevation'}" for r in rows]
    values = np.asarray(observed, dtype=float).ravel()[rows]
    flat = full.reshape(-1, full.shape[-1])[rows]
    if len(rows) < full.shape[-1]:
        raise EstimationError(
            f"{int(used.sum())} observations cannot determine {len(terms)} terms (expected {len(terms)} or more)"
        )
    return best_linear_estimate(flat, values, q[np.ix_(rows, rows)], parameters=list(terms), rows=called)


def _standardised(solution: LinearEstimate, used: np.ndarray, factor: float) -> np.ndarray:
    """Standardised residuals (n, 2), w = (P v)_i / sqrt(P_ii).

    Over the root of the variance factor; nan where left out or unchecked.
    """
    weight = solution.weight_diagonal
    good = weight > 1e-12 * max(float(weight.max(initial=0.0)), 1e-300)
    w = np.full((len(used), 2), np.nan)
    scale = np.sqrt(factor) if np.isfinite(factor) and factor > 0.0 else np.nan
    statistic = solution.weighted_residual / np.sqrt(np.where(good, weight, 1.0)) / scale
    w[used] = np.where(good, statistic, np.nan).reshape(-1, 2)
    return w


def _weak(terms: tuple[str, ...], covariance: np.ndarray, unit: np.ndarray) -> tuple[WeakDirection, ...]:
    """Weakest combination within each family, the other terms being free."""
    directions = []
    for family in FAMILIES:
        at = [terms.index(t) for t in family if t in terms]
        if len(at) > 1:
            values, vectors = np.linalg.eigh(covariance[np.ix_(at, at)])
            v = vectors[:, -1] * (1.0 if vectors[np.argmax(np.abs(vectors[:, -1])), -1] > 0 else -1.0)
            u = float(np.sqrt(max(values[-1], 0.0)))
            sky = float(np.sqrt(np.mean(np.sum((unit[:, at] @ v).reshape(-1, 2) ** 2, axis=1))))
            directions.append(WeakDirection({terms[i]: float(part) for i, part in zip(at, v, strict=True)}, u, u * sky))
    return tuple(directions)


def largest_sky_rms() -> float:
    """Largest residual of a usable series, rad: a tenth of the widest beam.

    The beam of an aperture D at the wavelength l is 1.2 l / D wide at half power. The published series leaves 7.39
    arc seconds.

    Source: [GBTPM01] for the telescope and its fit.

    >>> round(largest_sky_rms() / ARCSECOND, 1)
    64.5
    """
    return TENTH * 1.2 * SPEED_OF_LIGHT / LOWEST_FREQUENCY / APERTURE


def _verdict(fit: PointingFit) -> Verdict:
    if fit.degrees_of_freedom < 1:
        return Verdict("doubtful", "as many observations as terms: nothing checks the series")
    rms = fit.sky_rms / ARCSECOND
    if fit.stars and (alternatives := _readings(fit)):
        named = ", or as well if ".join(reading.text for reading in alternatives)
        return Verdict("doubtful", f"{rms:.2f} arc seconds rms on the sky; it fits better if {named}")
    if fit.stars and (doubt := _implausible_sky(fit)):
        return Verdict("doubtful", doubt)
    if fit.sky_rms > largest_sky_rms():
        limit = largest_sky_rms() / ARCSECOND
        return Verdict(
            "doubtful",
            f"{rms:.2f} arc seconds rms on the sky, beyond {limit:.0f}, a tenth of the beam at the telescope's lowest "
            "frequency: check columns and units",
        )
    if not fit.scaled and (doubt := _contradicted(fit)):
        return Verdict("doubtful", doubt)
    undetermined = [w for w in fit.weak if w.u_on_the_sky > fit.sky_rms]
    if undetermined:
        return Verdict("doubtful", f"the observations do not separate {', '.join(undetermined[0].parts)}")
    return Verdict(
        "good", f"{int(fit.used.sum())} observations determine the terms, {rms:.2f} arc seconds rms on the sky"
    )


def _readings(fit: PointingFit) -> tuple[BetterReading, ...]:
    """Better readings of the used stars' columns."""
    used = fit.used
    return better_readings(fit.azimuth[used], fit.elevation[used], fit.observed[used], terms=fit.series.terms)


def _implausible_sky(fit: PointingFit) -> str:
    """Implausible star positions as a text; "" for a usual sky."""
    a, e = fit.azimuth[fit.used], fit.elevation[fit.used]
    if np.all(e < LOWEST):
        return f"every elevation is below {LOWEST / DEGREE:.0f} degrees: radians or hours for degrees?"
    if np.ptp(a) <= SECTOR and np.ptp(e) > np.ptp(a):
        return f"all azimuths lie within {np.ptp(a) / DEGREE:.1f} degrees, elevations do not: radians or hours?"
    if np.all(a <= 0.0) and np.ptp(a) > np.pi:
        return "all azimuths are below zero, over more than half a turn: are they counted clockwise from north?"
    return ""


def _contradicted(fit: PointingFit) -> str:
    """Contradiction of scatter and stated uncertainty; "" for none."""
    from scipy import special

    degrees, factor = fit.degrees_of_freedom, fit.variance_factor
    if factor > 1.0 + 3.0 * (2.0 / degrees) ** 0.5:
        return f"observations scatter more than claimed (variance factor {factor:.2f})"
    if fit.stars and special.chdtr(degrees, fit.pvv) < UNLIKELY:
        return f"observations scatter less than claimed (variance factor {factor:.2g}): is its unit arc seconds?"
    return ""
