"""Pointing series of observations, and its comparison with another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import EstimationError
from catseye.geometry.antenna.pointing_series import TERMS, PointingSeries
from catseye.records.site.pointing_model import NamedSeries
from catseye.reduction.pose.corrections import PointingObservations
from catseye.reduction.pose.pointing_fit import PointingFit, fit_pointing
from catseye.verdict import Verdict


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
    return SeriesComparison(
        terms=terms,
        difference=difference,
        covariance=spread,
        chi2=chi2,
        p=p,
        azimuth=a,
        elevation=e,
        on_the_sky=delta,
        u_on_the_sky=u,
    )


@dataclass(frozen=True, eq=False)
class PointingFindings:
    """Series of observations, and its comparison with another on request.

    hashes   SHA-256 of each input file, by name
    """

    fit: PointingFit
    observations: PointingObservations
    comparison: SeriesComparison | None
    hashes: dict[str, str]

    @property
    def verdict(self) -> Verdict:
        """Verdict on the fitted series."""
        return self.fit.verdict


def find_pointing(
    observations: PointingObservations,
    against: PointingObservations | NamedSeries | None = None,
    *,
    terms: Sequence[str] = TERMS,
    u: float | None = None,
    reject: bool = False,
) -> PointingFindings:
    """Fit the pointing series and compare it.

    observations   of stars or of metrology
    against        series, or observations that are fitted likewise
    terms          to fit
    u              rad, of each coordinate of a star; None: by the scatter
    reject         leave out observations with |w| beyond 4, one by one

    Raises EstimationError where terms float, or none is common.
    """

    def series_of(observed: PointingObservations) -> PointingFit:
        fit = fit_pointing(
            observed.azimuth,
            observed.elevation,
            observed.correction,
            covariance=observed.covariance,
            u=u if observed.covariance is None else None,
            terms=terms,
            reject=reject,
            where=observed.where,
        )
        return replace(fit, sources=observed.sources)

    fit = series_of(observations)
    if against is None:
        return PointingFindings(fit, observations, None, observations.hashes)
    if isinstance(against, PointingObservations):
        reference = series_of(against)
        against = NamedSeries(against.name, reference.series, reference.verdict, against.hashes)
    fit = replace(fit, sources={**fit.sources, against.name: against.verdict})
    hashes = {**observations.hashes, **against.hashes}
    return PointingFindings(fit, observations, compare_series(against.series, fit.series), hashes)
