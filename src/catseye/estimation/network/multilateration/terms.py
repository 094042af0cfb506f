"""Terms beside the ranges: priors of points, zeros and scales, and ranges between stations.

They depend on the stations' parameters only (or one target's), so they are added to the normal equations after the
elimination.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.estimation.network.multilateration.blocks import UNCHECKED, IterationState


@dataclass(frozen=True, eq=False)
class PointPriors:
    """Points with prior coordinates (stochastic points), independent of each other.

    index        (k,) of the station or target, each once
    observed     (k, 3) m
    covariance   (k, 3, 3) m^2, positive definite
    """

    index: np.ndarray
    observed: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class StationRanges:
    """Distances between stations, free of zero and scale.

    Fields: first, second (k,) stations; distance, sigma (k,) m.
    """

    first: np.ndarray
    second: np.ndarray
    distance: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class Gauges:
    """Priors of one parameter per ranger, its zero or its scale.

    name     of the group, for reports
    column   3 for zero, 4 for scale, among the parameters of a station
    index    (k,) stations
    start    (k,) the prior's value
    sigma    (k,) its standard uncertainty
    """

    name: str
    column: int
    index: np.ndarray
    start: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class PriorTerms:
    """All prior terms; None if there are none."""

    stations: PointPriors | None
    targets: PointPriors | None
    between: StationRanges | None
    gauges: tuple[Gauges, ...]

    @cached_property
    def _station_root(self) -> np.ndarray:
        return _whitening(self.stations)

    @cached_property
    def _target_root(self) -> np.ndarray:
        return _whitening(self.targets)

    def count(self) -> int:
        """Number of observations in all terms."""
        points = sum(3 * len(p.index) for p in (self.stations, self.targets) if p is not None)
        between = len(self.between.distance) if self.between is not None else 0
        return points + between + sum(len(g.index) for g in self.gauges)

    def add(
        self, state: IterationState, normal: np.ndarray, before: np.ndarray, right: np.ndarray, width: int
    ) -> tuple[float, float]:
        """Add to the reduced normal equations, see `Reduced`.

        Returns cost and moment.

        Both include target priors.
        """
        cost = moment = 0.0
        if self.targets is not None:
            off = self.targets.observed - state.targets[self.targets.index]
            cost += float(np.sum(np.einsum("kij,kj->ki", self._target_root, off) ** 2))
        for columns, jacobian, misclosure in self._dense(state, width):
            share = np.einsum("kri,krj->kij", jacobian, jacobian)
            np.add.at(normal, (columns[:, :, None], columns[:, None, :]), share)
            np.add.at(before, columns, np.einsum("kii->ki", share))
            np.add.at(right, columns, np.einsum("kri,kr->ki", jacobian, misclosure))
            cost += float(np.sum(misclosure**2))
        if self.between is not None:
            moment = float(np.sum((self.between.distance / self.between.sigma) ** 2))
        return cost, moment

    def _dense(self, state: IterationState, width: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Columns (k, w), whitened Jacobian (k, r, w) and misclosure (k, r) of each group on stations."""
        if self.stations is not None:
            root = self._station_root
            off = self.stations.observed - state.stations[self.stations.index]
            yield self.stations.index[:, None] * width + np.arange(3), root, np.einsum("kij,kj->ki", root, off)
        if self.between is not None:
            columns, jacobian, off = _between(self.between, state, width)
            root = 1.0 / self.between.sigma[:, None]
            yield columns, (jacobian * root)[:, None, :], off[:, None] * root
        for gauge in self.gauges:
            root = 1.0 / gauge.sigma[:, None]
            yield gauge.index[:, None] * width + gauge.column, root[:, :, None], self._off(gauge, state)[:, None] * root

    @staticmethod
    def _off(gauge: Gauges, state: IterationState) -> np.ndarray:
        return gauge.start - (state.zero if gauge.column == 3 else state.scale)[gauge.index]

    def fits(
        self, state: IterationState, q: np.ndarray, target_covariance: np.ndarray, width: int
    ) -> tuple[GroupFit, ...]:
        """Fits of the groups, from covariances q (n, n) of the stations and (T, 3, 3) of the targets."""
        fits = []
        if self.between is not None:
            columns, jacobian, off = _between(self.between, state, width)
            q_adjusted = np.einsum("ki,kij,kj->k", jacobian, q[columns[:, :, None], columns[:, None, :]], jacobian)
            fits.append(
                _fit(
                    "between stations", off[:, None], self.between.sigma[:, None, None] ** 2, q_adjusted[:, None, None]
                )
            )
        if self.stations is not None:
            columns = self.stations.index[:, None] * width + np.arange(3)
            q_adjusted = q[columns[:, :, None], columns[:, None, :]]
            off = self.stations.observed - state.stations[self.stations.index]
            fits.append(_fit("station priors", off, self.stations.covariance, q_adjusted))
        if self.targets is not None:
            off = self.targets.observed - state.targets[self.targets.index]
            fits.append(_fit("target priors", off, self.targets.covariance, target_covariance[self.targets.index]))
        for gauge in self.gauges:
            at = gauge.index * width + gauge.column
            off = self._off(gauge, state)
            fits.append(_fit(gauge.name, off[:, None], gauge.sigma[:, None, None] ** 2, q[at, at][:, None, None]))
        return tuple(fits)


def _whitening(priors: PointPriors | None) -> np.ndarray:
    """Inverse Cholesky factors (k, 3, 3) of the priors' covariances."""
    return np.zeros((0, 3, 3)) if priors is None else np.linalg.inv(np.linalg.cholesky(priors.covariance))


def _between(between: StationRanges, state: IterationState, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns (k, 6), Jacobian (k, 6) and residual (k,) of ranges between stations."""
    along = state.stations[between.second] - state.stations[between.first]
    length = np.linalg.norm(along, axis=1)
    with np.errstate(invalid="ignore"):  # coinciding stations give nan, which the solver reports
        u = along / length[:, None]
    xyz = np.arange(3)
    columns = np.concatenate([between.first[:, None] * width + xyz, between.second[:, None] * width + xyz], axis=1)
    return columns, np.concatenate([-u, u], axis=1), between.distance - length


def _fit(name: str, off: np.ndarray, covariance: np.ndarray, q: np.ndarray) -> GroupFit:
    """Fit of k direct observations of r values each, with covariance q (k, r, r) of the adjusted values.

    With P = C^-1 and P_v = P - P Q P: w = (P v) / sqrt(diag P_v), redundancy diag(P_v C).
    """
    weight = np.linalg.inv(covariance)
    weight_diagonal = np.einsum("kii->ki", weight)
    pv = np.einsum("kij,kj->ki", weight, off)
    leverage = weight @ q
    visible = np.maximum(
        weight_diagonal - np.einsum("kij,kji->ki", leverage, weight), UNCHECKED * weight_diagonal
    ).ravel()
    redundancy = 1.0 - np.einsum("kii->ki", leverage)
    return GroupFit(
        name=name,
        active=np.ones(off.size, dtype=bool),
        residual=off.ravel(),
        sigma=np.sqrt(np.einsum("kii->ki", covariance)).ravel(),
        redundancy=redundancy.ravel(),
        standardised=pv.ravel() / np.sqrt(visible),
        estimated_error=pv.ravel() / visible,
        detectable_error=NONCENTRALITY / np.sqrt(visible),
        pvv=float(np.sum(off * pv)),
    )
