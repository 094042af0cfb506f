"""Fit and comparison of the eight-term pointing series.

Fitted to star offsets or to metrology. IE, HZCZ and HZSZ are nearly the same: 1, sin E and cos E over the
elevations of a night differ little. The fit does not fail there but reports it: their covariance is large, the weak
combination is named with its uncertainty, and the effect of the combination on the sky where stars were seen is
small. Predictions use the covariance and stay good.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import EstimationError
from catseye.estimation.least_squares.singular import LinearEstimate, best_linear_estimate
from catseye.geometry.antenna.pointing_series import TERMS, PointingSeries, columns, design
from catseye.verdict import Verdict

LIMIT = 4.0  # |w| of a star's coordinate beyond which `reject` leaves the star out
PART = 0.2  # of the largest part of a combination: smaller parts are not named
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


@dataclass(frozen=True, eq=False)
class SeriesComparison:
    """Difference of two series of one telescope, second minus first.

    terms             common to both
    difference        (k,) rad
    covariance        (k, k) rad^2, the two independent
    chi2, p           that the terms agree; nan where a covariance is missing
    azimuth, elevation  (m,) rad, a grid over the sky
    on_the_sky        (m, 2) rad, difference of the corrections there, all terms of both
    u_on_the_sky      (m, 2) rad
    """

    terms: tuple[str, ...]
    difference: np.ndarray
    covariance: np.ndarray
    chi2: float
    p: float
    azimuth: np.ndarray
    elevation: np.ndarray
    on_the_sky: np.ndarray
    u_on_the_sky: np.ndarray

    @property
    def rms_on_the_sky(self) -> float:
        """Root mean square over the grid, rad."""
        return float(np.sqrt(np.mean(np.sum(self.on_the_sky**2, axis=1))))


def compare_series(first: PointingSeries, second: PointingSeries) -> SeriesComparison:
    """Compare two series, term by term and on the sky.

    On the sky between 10 and 80 degrees of elevation.

    The terms agree with chi2 = d' (C1 + C2)^-1 d: nearly degenerate terms may differ much and mean the same, which both
    this and the difference on the sky include. Raises EstimationError where no term is common.
    """
    from scipy import special

    terms = tuple(t for t in TERMS if t in first.terms and t in second.terms)
    if not terms:
        raise EstimationError(f"no term is common to {', '.join(first.terms)} and {', '.join(second.terms)}")
    i, j = [first.terms.index(t) for t in terms], [second.terms.index(t) for t in terms]
    difference = second.values[j] - first.values[i]
    spread = first.covariance[np.ix_(i, i)] + second.covariance[np.ix_(j, j)]
    chi2 = p = float("nan")
    scale = np.sqrt(np.diag(spread))
    if np.all(scale > 0.0):
        unit = spread / np.outer(scale, scale)
        chi2 = float(difference / scale @ np.linalg.solve(unit, difference / scale))
        p = float(special.chdtrc(len(terms), chi2))
    a, e = (v.ravel() for v in np.meshgrid(np.arange(0, 360, 15) * DEGREE, np.arange(10, 81, 5) * DEGREE))
    covariances = first.covariance_of_correction(a, e) + second.covariance_of_correction(a, e)
    u = np.sqrt(np.maximum(np.diagonal(covariances, axis1=-2, axis2=-1), 0.0))
    delta = second.correction(a, e) - first.correction(a, e)
    return SeriesComparison(terms, difference, spread, chi2, p, a, e, delta, u)
