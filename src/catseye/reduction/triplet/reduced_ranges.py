"""From ranges to prisms to ranges to balls for all pairs of a site, and back from places to ranges.

The memo's appendix C with figure 10, exact, beside its own series and its first-order step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.records.site.prism_ranges import PrismRanges
from catseye.reduction.triplet.memo import median_series
from catseye.reduction.triplet.mounted import SiteTriplets, SortedRanges, sorted_ranges
from catseye.reduction.triplet.use import BallRanges, ball_ranges, incidence_on_prisms
from catseye.verdict import Verdict

U_ZERO = 30e-6  # m, of a ranger's zero
MOST_INCIDENCE = np.radians(45.0)  # on a prism: beyond it the return fades


@dataclass(frozen=True, eq=False)
class ReducedTriplets:
    """Ranges of k rangers to n triplets; metres, radians.

    site        triplets and rangers
    sorted      ranges of the table; None where they follow from the places
    to_prisms   (n, k, 2) with Pc and without dPc; nan where there is none
    balls       incidence, dPc, D_MP, D_BC with their covariance
    series      (n, k) D_MP by the series of figure 10
    by_places   (n, k) distance from scan point to ball by their places
    table       measured ranges; None: none
    """

    site: SiteTriplets
    sorted: SortedRanges | None
    to_prisms: Array
    balls: BallRanges
    series: Array
    by_places: Array
    table: PrismRanges | None

    @property
    def u_d_bc(self) -> Array:
        """Standard uncertainty (n, k) of the distances to the balls, m."""
        return np.sqrt(np.diag(self.balls.covariance)).reshape(self.by_places.shape)

    @property
    def count(self) -> int:
        """Number of pairs with a distance to the ball."""
        return int(np.isfinite(self.balls.d_bc).sum())

    @property
    def ranged(self) -> NDArray[np.bool_]:
        """Pairs (n, k) with a range to one or both prisms."""
        return np.asarray(np.isfinite(self.to_prisms).any(axis=-1))

    @property
    def incidence(self) -> Array:
        """Incidence (n, k, 2) of these pairs, rad; nan of the others."""
        return np.where(self.ranged[..., None], self.balls.incidence, np.nan)

    @property
    def verdict(self) -> Verdict:
        """Verdict: pairs without answer, and incidences beyond what a prism returns."""
        pairs = int(self.ranged.sum())
        if not self.count:
            return Verdict("failed", "no pair has ranges to both prisms that make a triangle")
        largest = float(np.nanmax(self.incidence))
        if largest > MOST_INCIDENCE:
            i, j, _ = np.unravel_index(int(np.nanargmax(self.incidence)), self.incidence.shape)
            pair = f"{self.site.rangers[j]} meets {self.site.units[i].name}"
            return Verdict("doubtful", f"{pair} at {np.degrees(largest):.1f} deg (limit 45 deg)")
        if self.count < pairs:
            return Verdict("doubtful", f"{pairs - self.count} of {pairs} pairs lack a range to one of both prisms")
        source = "places" if self.table is None else "ranges to both prisms"
        return Verdict("good", f"{self.count} distances to balls from {source}")


def reduced_triplets(
    site: SiteTriplets, table: PrismRanges | None = None, *, u_zero: float = U_ZERO
) -> ReducedTriplets:
    """Distances to the balls of all pairs, from ranges to the prisms or from the places.

    site     triplets and rangers
    table    measured ranges; None: those that rangers at the records' places would measure, without error
    u_zero   m, of each ranger's zero, common to its ranges

    Raises InputError for ranges that are none of the site's.

    Source: [GOLDMAN00] appendix C and figure 10.
    """
    n, k = len(site.units), len(site.rangers)
    measured = None if table is None else sorted_ranges(site, table)
    if measured is None:
        cosines = np.stack([incidence_on_prisms(unit, site.scan)[0] for unit in site.units])
        glass = [obliquity_correction(u.heights, u.ratio, c) for u, c in zip(site.units, cosines, strict=True)]
        to_prisms, variance = site.predicted() - np.stack(glass), np.zeros((n, k, 2))
    else:
        to_prisms, variance = measured.to_prisms, measured.u_to_prisms**2
    ranger = np.tile(np.repeat(np.arange(k), 2), n)
    zero = 0.0 if measured is None else u_zero
    covariance = np.diag(variance.ravel()) + zero**2 * (ranger[:, None] == ranger)
    balls = ball_ranges(site.units, site.scan, to_prisms, covariance=covariance)
    right = to_prisms + balls.obliquity
    d_12 = np.array([unit.d_12 for unit in site.units])[:, None]
    cycles_length = np.floor(to_prisms[..., 0] / site.half) * site.half
    return ReducedTriplets(
        site=site,
        sorted=measured,
        to_prisms=to_prisms,
        balls=balls,
        series=median_series(right[..., 0], right[..., 1], d_12, delta=cycles_length),
        by_places=np.linalg.norm(site.scan[None] - np.stack([unit.ball for unit in site.units])[:, None], axis=-1),
        table=table,
    )
