"""Local net of feed arm and triplets: ranges among themselves only, each ball computed with its covariance.

The memo's step 2. Scan points, both prisms and the ball of each unit, the tilts of its plate, the ball's offsets in the
plate and the rangers' zeros are parameters; the unit's sheet gives height, spacing and offsets as observations. No
range fixes where the net stands: typed places hold it, and the covariance is then freed of the six motions of the whole
(an S-transformation), so that it states the net's shape alone.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.aliases import Array
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution, adjust
from catseye.estimation.observations.kinds import Distances, Linear, ObservationGroup, ObservedCoordinates
from catseye.estimation.quality.reliability import checked, single_level, w_critical
from catseye.estimation.shapes.motions import motions
from catseye.records.site.prism_ranges import PrismRanges
from catseye.reduction.triplet.mounted import SiteTriplets, SortedRanges, sorted_ranges
from catseye.reduction.triplet.reduced_ranges import U_ZERO
from catseye.reduction.triplet.ties import (
    BALL,
    COUNT,
    TripletParameters,
    prism_ranges,
    triplet_observations,
    triplet_start,
)
from catseye.verdict import Verdict

U_PLACE = 10e-3  # m, each coordinate of a typed place
LEVEL = 0.05  # of the tests of all ranges together
TO_PRISMS, AMONG = "feed arm to prisms", "feed arm"
RIGID = 6  # motions of a body


@dataclass(frozen=True, eq=False)
class LocalNet:
    """Adjusted net of k rangers and n units: p = k + 3 n points; metres.

    site          triplets and rangers
    sorted        ranges by pair
    table         ranges
    solution      of the adjustment: rangers' coordinates, units' parameters, zeros
    points        (p,) names: rangers, then left prism, right prism, ball of each unit
    x             (p, 3) in the reflector's frame, held by typed places
    covariance    (3p, 3p) m^2 of the net's shape: free of shifts and turns of the whole
    zeros, u_zeros    (k,) of the rangers: ranges too long above 0
    d_bc          (n, k) from scan points to balls
    covariance_d_bc   (n k, n k) m^2, unit by unit; of these any datum gives the same
    """

    site: SiteTriplets
    sorted: SortedRanges
    table: PrismRanges
    solution: LeastSquaresSolution
    points: tuple[str, ...]
    x: Array
    covariance: Array
    zeros: Array
    u_zeros: Array
    d_bc: Array
    covariance_d_bc: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties (p, 3), m, in the net's shape."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).reshape(-1, 3)

    @property
    def u_d_bc(self) -> Array:
        """Standard uncertainties (n, k) of the distances, m."""
        return np.sqrt(np.diag(self.covariance_d_bc)).reshape(self.d_bc.shape)

    @cached_property
    def moved(self) -> Array:
        """Distances (p,), m, from the typed places."""
        start = [self.site.scan, *(np.vstack([unit.prisms, unit.ball]) for unit in self.site.units)]
        return np.linalg.norm(self.x - np.vstack(start), axis=1)

    @cached_property
    def observations(self) -> tuple["NetRange", ...]:
        """Ranges with residual and test, prisms first."""
        rows: list[NetRange] = []
        fits = {fit.name: fit for fit in self.solution.fits}
        names: list[tuple[str, str]] = []
        for i, j, side in np.argwhere(np.isfinite(self.sorted.to_prisms)):
            names.append((self.site.rangers[j], self.site.targets[i][side]))
        values = self.sorted.to_prisms[np.isfinite(self.sorted.to_prisms)]
        for name, pairs, distances in (
            (TO_PRISMS, names, values),
            (AMONG, [tuple(self.site.rangers[e] for e in pair) for pair in self.sorted.pairs], self.sorted.between),
        ):
            if name not in fits:
                continue
            fit, tested = fits[name], checked(fits[name])
            for row, (source, target) in enumerate(pairs):
                rows.append(
                    NetRange(
                        ranger=source,
                        target=target,
                        distance=float(distances[row]),
                        u=float(fit.sigma[row]),
                        residual=float(fit.residual[row]),
                        w=float(fit.standardised[row]) if tested[row] else float("nan"),
                        redundancy=float(fit.redundancy[row]),
                    )
                )
        return tuple(rows)

    @property
    def critical(self) -> float:
        """Largest |w| of a right range."""
        return w_critical(single_level(LEVEL, len(self.observations)))

    @property
    def suspects(self) -> tuple[int, ...]:
        """Observations whose test fails, the largest |w| first; a wrong one drags others along."""
        w = np.array([row.w for row in self.observations])
        order = np.argsort(-np.nan_to_num(np.abs(w)))
        return tuple(int(row) for row in order if abs(w[row]) > self.critical)

    @property
    def verdict(self) -> Verdict:
        """Verdict by the tests of the ranges and by units that lack one."""
        factor, degrees = self.solution.variance_factor()
        if self.suspects:
            first = self.observations[self.suspects[0]]
            more = f" and {len(self.suspects) - 1} more" if len(self.suspects) > 1 else ""
            return Verdict(
                "doubtful",
                f"{first.ranger} to {first.target} contradicts the net by {1e3 * first.residual:+.3f} mm, "
                f"w {first.w:+.1f}{more}",
            )
        ranged = np.isfinite(self.sorted.to_prisms).sum(axis=1).min(axis=1)
        if ranged.min() < 3:
            unit = self.site.units[int(np.argmin(ranged))].name
            return Verdict("doubtful", f"a prism of {unit} has {ranged.min()} ranges (expected 3 or more)")
        spread = 4.0 * np.sqrt(2.0 / degrees)
        if abs(factor - 1.0) > spread:
            return Verdict("doubtful", f"the variance factor is {factor:.2f} (expected 1 within {spread:.2f})")
        return Verdict("good", f"variance factor {factor:.2f} of {degrees:.0f} degrees of freedom, no range stands out")


@dataclass(frozen=True)
class NetRange:
    """Range of a net after its adjustment; metres.

    ranger, target   names
    distance, u      as measured, with Pc and without dPc
    residual         observed less adjusted
    w                standardised residual; nan where no other range checks it
    redundancy       0 to 1
    """

    ranger: str
    target: str
    distance: float
    u: float
    residual: float
    w: float
    redundancy: float


def adjusted_net(site: SiteTriplets, table: PrismRanges, *, u_zero: float = U_ZERO) -> LocalNet:
    """Net of the feed arm's rangers and the triplets, adjusted by itself.

    site     triplets and rangers
    table    ranges to prisms, and perhaps between the rangers
    u_zero   m, of each ranger's zero

    Raises InputError for ranges that are none of the site's, EstimationError where they do not determine the net.

    Source: [GOLDMAN00] section 1.1, step 2; least squares with priors, [FOERSTNER16] chapter 4.
    """
    measured = sorted_ranges(site, table)
    n, k = len(site.units), len(site.rangers)
    first = 3 * k + COUNT * np.arange(n)
    zeros = 3 * k + COUNT * n + np.arange(k)
    at = TripletParameters(first)
    balls = np.stack([unit.ball for unit in site.units])
    groups: list[ObservationGroup] = [
        *triplet_observations(site.units, at),
        prism_ranges(
            TO_PRISMS,
            site.units,
            at,
            scan_points=site.scan,
            scan_columns=3 * np.arange(k),
            ranges=measured.to_prisms,
            covariance=np.nan_to_num(measured.u_to_prisms**2, nan=1.0).ravel(),
            zeros=zeros,
        ),
        Linear("zeros", np.zeros(k), np.full(k, u_zero**2), zeros, np.eye(k)),
        ObservedCoordinates.of_points(
            "typed places",
            np.vstack([site.scan, balls]),
            np.full(3 * (k + n), U_PLACE**2),
            np.concatenate([3 * np.arange(k), first + BALL]),
        ),
    ]
    if len(measured.pairs):
        source, target = measured.pairs.T
        groups.append(
            Distances(
                AMONG, measured.between, measured.u_between**2, 3 * source, 3 * target, nuisance=zeros[source][:, None]
            )
        )
    start = np.concatenate([site.scan.ravel(), triplet_start(site.units), np.zeros(k)])
    solution = adjust(start, groups).require_converged()
    return _net(site, measured, table, solution)


def _net(site: SiteTriplets, measured: SortedRanges, table: PrismRanges, solution: LeastSquaresSolution) -> LocalNet:
    """Points, freed covariance and distances to balls of a solution."""
    n, k = len(site.units), len(site.rangers)
    first = 3 * k + COUNT * np.arange(n)
    columns = np.concatenate([np.arange(3 * k), *(start + np.arange(9) for start in first)])
    x = solution.x[columns].reshape(-1, 3)
    tied = solution.covariance[np.ix_(columns, columns)]
    base = np.linalg.qr(motions(x)[:, :RIGID])[0]
    free = np.eye(len(columns)) - base @ base.T
    balls = k + 3 * np.arange(n) + 2
    sight = x[:k][None] - x[balls][:, None]
    d_bc = np.linalg.norm(sight, axis=-1)
    slope = np.zeros((n, k, len(x), 3))
    i, j = np.indices((n, k))
    slope[i, j, j] = sight / d_bc[..., None]
    slope[i, j, balls[i]] = -sight / d_bc[..., None]
    by_places = slope.reshape(n * k, -1)
    last = 3 * k + COUNT * n
    return LocalNet(
        site=site,
        sorted=measured,
        table=table,
        solution=solution,
        points=(*site.rangers, *(name for names in site.targets for name in names)),
        x=x,
        covariance=free @ tied @ free.T,
        zeros=solution.x[last:],
        u_zeros=np.sqrt(np.diag(solution.covariance)[last:]),
        d_bc=d_bc,
        covariance_d_bc=by_places @ tied @ by_places.T,
    )
