"""Solution of a ranging network: coordinates, covariance in the datum, tests of every range."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit
from catseye.estimation.least_squares.status import CONVERGED, Status
from catseye.estimation.network.multilateration.blocks import UNCHECKED, IterationState, linearise
from catseye.estimation.network.multilateration.network import RangingNetwork, Setup


@dataclass(frozen=True, eq=False)
class Gauge:
    """Datum transformation of a solution: errors of datum targets also move the stations.

    motions   (7, f) free motions
    null      (n, f) their effect on the stations' parameters
    points    (k,) targets in the datum
    drift     (k, 3, f) covariance of such a target's step with minus the amounts of the motions
    """

    motions: np.ndarray
    null: np.ndarray
    points: np.ndarray
    drift: np.ndarray


@dataclass(frozen=True, eq=False)
class RangingSolution:
    """Adjusted ranging network.

    S stations, T targets, m ranges, n = S width station parameters.

    network             the adjusted network
    stations            (S, 3) m
    targets             (T, 3) m
    zero                (S,) m
    scale               (S,) 1
    status              "converged", or one line with problem, place and remedy; "contradictory" solutions
                        converged and have all statistics, but implausibly large residuals
    iterations          linearisations
    pvv                 sum of squares of all whitened residuals, priors included
    degrees_of_freedom  observations and conditions less free parameters
    width               parameters per station: 3 (x y z), or 5 (x y z zero scale)
    covariance          (n, n) of the stations' parameters, a priori; zero if held, nan without solution or tests
    covariance_targets  (T, 3, 3) m^2
    redundancy          (m,) as in `least_squares.adjustment.GroupFit`, here of the ranges; nan without solution or
                        tests
    standardised        (m,)
    detectable          (m,) m
    """

    network: RangingNetwork
    stations: np.ndarray
    targets: np.ndarray
    zero: np.ndarray
    scale: np.ndarray
    status: Status
    iterations: int
    pvv: float
    degrees_of_freedom: int
    width: int
    covariance: np.ndarray
    covariance_targets: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    detectable: np.ndarray
    _setup: Setup
    _at: IterationState
    _answer: IterationState
    _inverse: np.ndarray
    _gauge: Gauge | None

    @property
    def variance_factor(self) -> float:
        """Variance factor [pvv] / degrees of freedom, expectation 1.

        It is nan without redundancy.
        """
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom > 0 else float("nan")

    @property
    def covariance_stations(self) -> np.ndarray:
        """Covariances (S, 3, 3) m^2 of the stations' coordinates."""
        s = np.arange(len(self.stations))
        return self.covariance.reshape(len(s), self.width, len(s), self.width)[s, :3, s, :3]

    @property
    def u_zero(self) -> np.ndarray:
        """Standard uncertainties (S,) m of the zeros, 0 if held."""
        return np.sqrt(np.diag(self.covariance)[3 :: self.width]) if self.width > 3 else np.zeros(len(self.zero))

    @property
    def u_scale(self) -> np.ndarray:
        """Standard uncertainties (S,) of the scales, 0 if held."""
        return np.sqrt(np.diag(self.covariance)[4 :: self.width]) if self.width > 3 else np.zeros(len(self.scale))

    @cached_property
    def residual(self) -> np.ndarray:
        """Residuals (m,) m, observed minus predicted, of left-out ranges too."""
        problem = self._setup.problem
        rows = np.arange(len(problem.distance))
        return linearise(problem, self._answer, rows, root=np.ones(len(rows))).misclosure

    @cached_property
    def estimated_error(self) -> np.ndarray:
        """Estimated gross errors (m,) m of single ranges."""
        active = self._setup.problem.root > 0.0
        return np.where(active, self.residual / np.maximum(self.redundancy, UNCHECKED), self.residual)

    @cached_property
    def fits(self) -> tuple[GroupFit, ...]:
        """Fits of the ranges and of all other groups (between stations, priors)."""
        problem = self._setup.problem
        ranges = GroupFit(
            name="ranges",
            active=problem.root > 0.0,
            residual=self.residual,
            sigma=problem.sigma,
            redundancy=self.redundancy,
            standardised=self.standardised,
            estimated_error=self.estimated_error,
            detectable_error=self.detectable,
            pvv=float(np.sum((problem.root * self.residual) ** 2)),
        )
        return ranges, *self._setup.terms.fits(self._answer, self.covariance, self.covariance_targets, self.width)

    def require_converged(self) -> "RangingSolution":
        """Return this solution, or raise EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    def following(self, targets: np.ndarray) -> np.ndarray:
        """Derivatives (k, 3, n) of targets (k,) by the stations' parameters: minus V^-1 times the coupling."""
        problem = self._setup.problem
        place = np.full(len(self.targets), -1)
        place[targets] = np.arange(len(targets))
        rows = np.flatnonzero(place[problem.target] >= 0)
        linear = linearise(problem, self._at, rows, root=problem.root[rows])
        y = np.zeros((len(targets), len(self.stations), self.width, 3))
        np.add.at(y, (place[linear.target], linear.station), -linear.g[:, :, None] * linear.a[:, None, :])
        return self._inverse[targets] @ y.reshape(len(targets), len(self.covariance), 3).transpose(0, 2, 1)

    def joined(self, first: "Mapped", second: "Mapped") -> np.ndarray:
        """Covariance (k, l) of some parameters with others.

        EstimationError without a solution or tests. M Q M' of the stations' parameters that they follow, plus V^-1 of
        coordinates of the same target, minus the datum's part for datum targets.
        """
        gauge = self._gauge
        if gauge is None:
            raise EstimationError(f"no covariance: {self.status if self.status != CONVERGED else 'tests was False'}")
        out = first.maps @ self.covariance @ second.maps.T
        same_target = (first.target[:, None] == second.target) & (first.target[:, None] >= 0)
        i, j = np.nonzero(same_target)
        out[i, j] += self._inverse[first.target[i], first.axis[i], second.axis[j]]
        if len(gauge.points):
            one, two = (self._drift[m.target, m.axis] for m in (first, second))
            out -= (first.maps @ gauge.null) @ two.T + one @ (second.maps @ gauge.null).T
        return out

    def products(self, chosen: "Mapped", a: np.ndarray) -> np.ndarray:
        """Covariances (m, w) of w parameters with the sum of a (m, w) times them, row by row.

        See `joined`.

        chosen   maps (m, w, n), target and axis (m, w)
        """
        gauge, maps, target, axis = self._gauge, chosen.maps, chosen.target, chosen.axis
        if gauge is None:
            return np.full(a.shape, np.nan)
        moved = np.einsum("mwn,mw->mn", maps, a, optimize=True)
        out = (maps @ (moved @ self.covariance)[:, :, None])[:, :, 0]
        same_target = (target[:, :, None] == target[:, None]) & (target[:, :, None] >= 0)
        blocks = self._inverse[target[:, :, None], axis[:, :, None], axis[:, None]]
        out += (np.where(same_target, blocks, 0.0) @ a[:, :, None])[:, :, 0]
        if len(gauge.points):
            drift = self._drift[target, axis]
            drift_sum = np.einsum("mwf,mw->mf", drift, a)
            out -= ((maps @ gauge.null) @ drift_sum[:, :, None] + drift @ (moved @ gauge.null)[:, :, None])[:, :, 0]
        return out

    @cached_property
    def _drift(self) -> np.ndarray:
        """`Gauge.drift` (T + 1, 3, f) of every target, zero outside the datum.

        The last row for index -1.
        """
        assert self._gauge is not None
        drift = np.zeros((len(self.targets) + 1, 3, self._gauge.null.shape[1]))
        drift[self._gauge.points] = self._gauge.drift
        return drift

    def joint(self, stations: Sequence[int] = (), targets: Sequence[int] = ()) -> np.ndarray:
        """Joint covariance (3k, 3k), m^2, of some stations, then some targets, in the given order.

        Each point once. Raises EstimationError without a solution or tests.
        """
        s, t, xyz = np.asarray(stations, dtype=np.int64), np.asarray(targets, dtype=np.int64), np.arange(3)
        station_maps = np.eye(len(self.covariance))[(s[:, None] * self.width + xyz).ravel()]
        chosen = Mapped(
            np.concatenate([station_maps, self.following(t).reshape(-1, len(self.covariance))]),
            np.concatenate([np.full(len(station_maps), -1), np.repeat(t, 3)]),
            np.concatenate([np.zeros(len(station_maps), dtype=np.int64), np.tile(xyz, len(t))]),
        )
        return self.joined(chosen, chosen)


@dataclass(frozen=True, eq=False)
class Mapped:
    """Parameters of a ranging network, as linear maps of the stations' parameters.

    maps     (k, n) row of the identity for a station parameter, of `RangingSolution.following` for a target coordinate
    target   (k,) index of the target; -1 for station parameters
    axis     (k,) 0, 1 or 2 of such a coordinate
    """

    maps: np.ndarray
    target: np.ndarray
    axis: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> "Mapped":
        return Mapped(self.maps[rows], self.target[rows], self.axis[rows])
