"""The answer of a ranging network: coordinates, their covariance in the datum, and the tests of every range."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.adjustment import CONVERGED, Fit
from catseye.estimation.multilateration.blocks import UNCHECKED, State, linearise
from catseye.estimation.multilateration.network import RangingNetwork, Setup


@dataclass(frozen=True, eq=False)
class Gauge:
    """How the answer was brought to its datum: errors of datum targets alone move the stations too.

    motions   (7, f) free motions
    null      (n, f) what they do to the stations' parameters
    points    (k,) targets in the datum
    drift     (k, 3, f) covariance of such a target's own step with minus the amounts of the motions
    """

    motions: np.ndarray
    null: np.ndarray
    points: np.ndarray
    drift: np.ndarray


@dataclass(frozen=True, eq=False)
class RangingSolution:
    """An adjusted ranging network; S stations, T targets, m ranges, n = S width parameters of the stations.

    network             what was adjusted
    stations            (S, 3) m
    targets             (T, 3) m
    zero                (S,) m
    scale               (S,) 1
    status              "converged", or one line that says what is wrong, where, and what to do; "contradictory" ones
                        converged too and have all statistics, but to residuals beyond belief
    iterations          linearisations
    pvv                 sum of squares of all whitened residuals, priors included
    degrees_of_freedom  observations and conditions less free parameters
    width               parameters a station: 3 (x y z), or 5 (x y z zero scale)
    covariance          (n, n) of the stations' parameters, a priori; zero where held, nan without answer or tests
    covariance_targets  (T, 3, 3) m^2
    redundancy          (m,) as in `adjustment.Fit`, here of the ranges; nan without answer or tests
    standardised        (m,)
    detectable          (m,) m
    """

    network: RangingNetwork
    stations: np.ndarray
    targets: np.ndarray
    zero: np.ndarray
    scale: np.ndarray
    status: str
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
    _at: State
    _answer: State
    _inverse: np.ndarray
    _gauge: Gauge | None

    @property
    def variance_factor(self) -> float:
        """[pvv] / degrees of freedom, expectation 1; nan without redundancy."""
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom > 0 else float("nan")

    @property
    def covariance_stations(self) -> np.ndarray:
        """(S, 3, 3) m^2 of each station's coordinates."""
        s = np.arange(len(self.stations))
        return self.covariance.reshape(len(s), self.width, len(s), self.width)[s, :3, s, :3]

    @property
    def u_zero(self) -> np.ndarray:
        """(S,) m standard uncertainty of each zero, 0 where held."""
        return np.sqrt(np.diag(self.covariance)[3 :: self.width]) if self.width > 3 else np.zeros(len(self.zero))

    @property
    def u_scale(self) -> np.ndarray:
        """(S,) standard uncertainty of each scale, 0 where held."""
        return np.sqrt(np.diag(self.covariance)[4 :: self.width]) if self.width > 3 else np.zeros(len(self.scale))

    @cached_property
    def residual(self) -> np.ndarray:
        """(m,) m, observed minus predicted, of ranges left out as well."""
        problem = self._setup.problem
        rows = np.arange(len(problem.distance))
        return linearise(problem, self._answer, rows, np.ones(len(rows))).misclosure

    @cached_property
    def estimated_error(self) -> np.ndarray:
        """(m,) m, the error in a range that would explain its residual best."""
        active = self._setup.problem.root > 0.0
        return np.where(active, self.residual / np.maximum(self.redundancy, UNCHECKED), self.residual)

    @cached_property
    def fits(self) -> tuple[Fit, ...]:
        """A fit of the ranges, then of what there is: between stations, station, target, zero and scale priors."""
        problem = self._setup.problem
        ranges = Fit(
            "ranges",
            problem.root > 0.0,
            self.residual,
            problem.sigma,
            self.redundancy,
            self.standardised,
            self.estimated_error,
            self.detectable,
            float(np.sum((problem.root * self.residual) ** 2)),
        )
        return ranges, *self._setup.terms.fits(self._answer, self.covariance, self.covariance_targets, self.width)

    def require_converged(self) -> "RangingSolution":
        """This solution, or EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    def joint(self, stations: Sequence[int] = (), targets: Sequence[int] = ()) -> np.ndarray:
        """Joint covariance (3k, 3k), m^2, of some stations, then some targets, each once, in the order given.

        Raises EstimationError without an answer or without tests.
        """
        if self._gauge is None:
            raise EstimationError(f"no covariance: {self.status if self.status != CONVERGED else 'tests was False'}")
        problem, gauge, p = self._setup.problem, self._gauge, self.width
        s, t = np.asarray(stations, dtype=np.int64), np.asarray(targets, dtype=np.int64)
        place = np.full(len(self.targets), -1)
        place[t] = np.arange(len(t))
        rows = np.flatnonzero(place[problem.target] >= 0)
        seen = linearise(problem, self._at, rows, problem.root[rows])
        y = np.zeros((len(t), len(self.stations), p, 3))
        np.add.at(y, (place[seen.target], seen.station), -seen.g[:, :, None] * seen.a[:, None, :])
        y = (y.reshape(len(t), -1, 3) @ self._inverse[t]).transpose(1, 0, 2).reshape(len(self.covariance), -1)
        at = (s[:, None] * p + np.arange(3)).ravel()
        parts = np.zeros((len(self.covariance), len(at)))
        parts[at, np.arange(len(at))] = 1.0
        maps = np.concatenate([parts, y], axis=1)
        out = maps.T @ self.covariance @ maps
        first = len(at)
        for i, target in enumerate(t):
            out[first + 3 * i : first + 3 * i + 3, first + 3 * i : first + 3 * i + 3] += self._inverse[target]
        if len(gauge.points):
            drift = np.zeros((len(self.targets), 3, gauge.null.shape[1]))
            drift[gauge.points] = gauge.drift
            late = np.concatenate([np.zeros((first, drift.shape[2])), drift[t].reshape(-1, drift.shape[2])])
            moved = maps.T @ gauge.null
            out -= moved @ late.T + late @ moved.T
        return out
