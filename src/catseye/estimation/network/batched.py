"""Least squares of one network for many sets of observed values at once.

All sets begin at the same parameters and have the same columns, weights and datum. So their predictions are one call,
the first step has one factor, and normal equations are sums over the same index lists; only the factors after the first
step are taken one by one. The result is that of `adjust_network`: Gauss-Newton to the same limit, covariance at the
solution. What does not go that way by itself (a step that raises the cost, a doubtful rank, many steps) is refused, for
`adjust_network` to solve.

The datum's conditions G (x - reference) = 0 are observations of weight c beside N. They contradict nothing, so they
are met exactly, and with B = (N + c G'G)^-1 G' the covariance in the datum is (N + c G'G)^-1 - c B B': the inverse of
the bordered matrix, since N H = 0 for the floating motions H.

Source: [FOERSTNER16] chapter 4; [BAARDA73] for the datum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from catseye.estimation.least_squares.adjustment import ROUNDING, STEP_IN_SIGMAS
from catseye.estimation.least_squares.normal import DOUBTFUL, LARGEST_DENSE
from catseye.estimation.network.adjustment import FixedParts
from catseye.estimation.network.copies import Predict, prediction
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.network.ranging_covariance import RangingCovariance
from catseye.estimation.observations.kinds import ObservationGroup

STEPS = 10  # cap of Gauss-Newton steps from the planned parameters; most sets take two or three
COMMON = 4  # of them with the factor at the planned parameters: noise moves a network so little that they converge
BATCH_NUMBERS = 2_000_000  # of all matrices of one batch: 16 MB, which stay in the cache of a core
MOST_PRODUCTS = 4_000_000  # of derivatives in one normal matrix, above which the dense solution is the faster


@dataclass(frozen=True, eq=False)
class BatchSolution:
    """Solutions of r sets of observed values.

    x          (r, n) parameters
    variance   (r, k) of the parameters that move; nan where refused
    accepted   (r,) bool: False where the set has to be solved by itself
    """

    x: np.ndarray
    variance: np.ndarray
    accepted: np.ndarray


@dataclass(frozen=True, eq=False)
class _Sums:
    """Index lists of sums over products of derivatives, in the order of their targets.

    first, second   (p,) entries of the derivatives, all rows of all groups one after the other
    weight          (p,) factor of each product
    start           (t,) first product of each target
    target          (t,) places in the result
    """

    first: np.ndarray
    second: np.ndarray
    weight: np.ndarray
    start: np.ndarray
    target: np.ndarray

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray, weight: np.ndarray, target: np.ndarray) -> "_Sums":
        order = np.argsort(target, kind="stable")
        places, start = np.unique(target[order], return_index=True)
        return cls(first[order], second[order], weight[order], start, places)


class BatchedNetwork:
    """Network that is solved for many sets of observed values.

    parts   of the network near its solution, at which all sets begin
    """

    def __init__(self, parts: FixedParts) -> None:
        self.x0, self.groups = parts.x, parts.groups
        self.moving = np.flatnonzero(parts.free)
        self._predict: list[Predict] = [prediction(group, self.x0) for group in self.groups]
        place = np.full(len(self.x0) + 1, -1)
        place[self.moving] = np.arange(len(self.moving))
        self._columns = [place[np.broadcast_to(g.columns, _shape(g))] for g in self.groups]
        self._weights = [_weight(g.covariance) for g in self.groups]
        self._conditions = parts.conditions[:, self.moving]
        self._reference = np.where(np.isfinite(parts.reference), parts.reference, 0.0)[self.moving]

    @staticmethod
    def suits(solution: NetworkSolution) -> bool:
        """True for a network of which batches are faster than one solution after the other."""
        groups, size = solution.network.groups, 3 * len(solution.network.points.names)
        if isinstance(solution.q, RangingCovariance) or size + len(solution.network.parameters) > LARGEST_DENSE:
            return False
        pairs = [len(g.observed) * (1 if g.covariance.ndim == 1 else g.covariance.shape[-1]) for g in groups]
        return sum(p * _shape(g)[1] ** 2 for p, g in zip(pairs, groups, strict=True)) <= MOST_PRODUCTS

    def solve(self, observed: Sequence[np.ndarray]) -> BatchSolution:
        """Solutions for observed values, (r, m) for each group of the network."""
        count, k = len(observed[0]), len(self.moving)
        numbers = k * k + 3 * len(self._normal.first) + 1
        most = int(np.clip(BATCH_NUMBERS // numbers, 1, max(count, 1)))
        x, variance = np.repeat(self.x0[None], count, axis=0), np.full((count, k), np.nan)
        accepted = np.zeros(count, dtype=bool)
        for low in range(0, count, most):
            part = slice(low, low + most)
            priors = [np.repeat(g.observed[None], len(x[part]), axis=0) for g in self.groups[len(observed) :]]
            sets = [*(o[part] for o in observed), *priors]
            self._iterate(sets, x[part], variance[part], accepted[part])
        return BatchSolution(x, variance, accepted)

    def _iterate(self, observed: list[np.ndarray], x: np.ndarray, variance: np.ndarray, accepted: np.ndarray) -> None:
        """Solve one batch in place."""
        going, cost = np.arange(len(x)), np.full(len(x), np.inf)
        for step in range(STEPS):
            slopes, misfit, cost_now = self._linear([o[going] for o in observed], x[going])
            fine = np.isfinite(cost_now) & (cost_now <= cost[going] * ROUNDING) & np.isfinite(slopes).all(axis=1)
            going, slopes, misfit, cost_now = going[fine], slopes[fine], misfit[fine], cost_now[fine]
            if not len(going):
                return
            cost[going] = cost_now
            right = self._right(slopes, misfit, x[going])
            common = self._first_root if step < COMMON else None
            if common is not None:
                whitened, regular = right @ common.T, np.ones(len(going), dtype=bool)
                moved = whitened @ common
            else:
                roots, regular = self._roots(slopes)
                whitened = np.matmul(roots, right[:, :, None])[:, :, 0]
                moved = np.matmul(roots.transpose(0, 2, 1), whitened[:, :, None])[:, :, 0]
            x[going[:, None], self.moving] += np.where(regular[:, None], moved, 0.0)
            done = regular & (step > 0) & (np.linalg.norm(whitened, axis=1) < STEP_IN_SIGMAS)
            if done.any():
                roots, sound = self._roots(slopes[done])
                variance[going[done]] = np.where(sound[:, None], self._variances(roots), np.nan)
                accepted[going[done]] = sound
            going = going[regular & ~done]
            if not len(going):
                return

    def _linear(self, observed: list[np.ndarray], x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives (r, s) of all rows, weighted residuals (r, s) beside them, and costs (r,)."""
        slopes, misfits, cost = [], [], np.zeros(len(x))
        for predict, weight, o in zip(self._predict, self._weights, observed, strict=True):
            values, jacobian = predict(x, o)
            residual = o - values
            weighted = _weighted(weight, residual)
            cost += np.einsum("rm,rm->r", residual, weighted)
            slopes.append(jacobian.reshape(len(x), -1))
            misfits.append(np.repeat(weighted, jacobian.shape[2], axis=1))
        return np.concatenate(slopes, axis=1), np.concatenate(misfits, axis=1), cost

    @cached_property
    def _normal(self) -> _Sums:
        """Products that make the lower triangle of N."""
        k, first, second, weights, targets, offset = len(self.moving), [], [], [], [], 0
        for columns, weight in zip(self._columns, self._weights, strict=True):
            m, w = columns.shape
            i, j, p = _pairs(weight)
            row, column = columns[i][:, :, None], columns[j][:, None, :]
            used = (row >= column) & (column >= 0)
            entry = offset + np.arange(m * w).reshape(m, w)
            shape = used.shape
            first.append(np.broadcast_to(entry[i][:, :, None], shape)[used])
            second.append(np.broadcast_to(entry[j][:, None, :], shape)[used])
            weights.append(np.broadcast_to(p[:, None, None], shape)[used])
            targets.append((row * k + column)[used])
            offset += m * w
        return _Sums.of(*map(np.concatenate, (first, second, weights, targets)))

    @cached_property
    def _pull(self) -> _Sums:
        """Products with the weighted residuals that make A'Pv."""
        columns = np.concatenate([c.ravel() for c in self._columns])
        entry = np.flatnonzero(columns >= 0)
        return _Sums.of(entry, entry, np.ones(len(entry)), columns[entry])

    @cached_property
    def _first_root(self) -> np.ndarray | None:
        """Inverse Cholesky factor (k, k) at the planned parameters; None where one is not well determined."""
        roots, regular = self._roots(self._linear([g.observed[None] for g in self.groups], self.x0[None])[0])
        return roots[0] if regular[0] else None

    @cached_property
    def _datum_weight(self) -> float:
        """Weight c of the datum's conditions, as strong as the observations of its coordinates."""
        if not len(self._conditions):
            return 0.0
        slopes = self._linear([g.observed[None] for g in self.groups], self.x0[None])[0]
        diagonal = np.diag(self._lower(slopes)[0])
        strength = np.sum(self._conditions**2, axis=0)
        return float(strength @ diagonal / (strength @ strength))

    def _right(self, slopes: np.ndarray, misfit: np.ndarray, x: np.ndarray) -> np.ndarray:
        """A'Pv (r, k), with the datum's conditions."""
        sums = self._pull
        right = np.zeros((len(x), len(self.moving)))
        right[:, sums.target] = np.add.reduceat(slopes[:, sums.first] * misfit[:, sums.second], sums.start, axis=1)
        if len(self._conditions):
            g = self._conditions
            right -= self._datum_weight * ((x[:, self.moving] - self._reference) @ g.T) @ g
        return right

    def _lower(self, slopes: np.ndarray) -> np.ndarray:
        """N (r, k, k), lower triangles, zero above."""
        sums, k = self._normal, len(self.moving)
        products = slopes[:, sums.first]
        products *= slopes[:, sums.second]
        products *= sums.weight
        normal = np.zeros((len(slopes), k * k))
        normal[:, sums.target] = np.add.reduceat(products, sums.start, axis=1)
        return normal.reshape(-1, k, k)

    def _roots(self, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inverse lower Cholesky factors (r, k, k) of N + c G'G, and (r,) bool: every parameter well determined."""
        roots = self._lower(slopes)
        if len(self._conditions):
            roots += self._datum_weight * np.tril(self._conditions.T @ self._conditions)
        regular = np.zeros(len(roots), dtype=bool)
        for k, matrix in enumerate(roots):
            diagonal = np.diag(matrix).copy()
            factor, failed = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
            regular[k] = not failed and bool(np.all(np.diag(factor) ** 2 > DOUBTFUL * diagonal))
            if regular[k]:
                matrix[:] = lapack.dtrtri(factor, lower=0, overwrite_c=1)[0].T
        return roots, regular

    def _variances(self, roots: np.ndarray) -> np.ndarray:
        """Variances (r, k) of the parameters in the datum."""
        variance = np.einsum("rij,rij->rj", roots, roots)
        if len(self._conditions):
            b = np.matmul(roots.transpose(0, 2, 1), np.matmul(roots, self._conditions.T))
            variance -= self._datum_weight * np.sum(b**2, axis=2)
        return variance


def _shape(group: ObservationGroup) -> tuple[int, int]:
    """Numbers of rows and of columns of a row."""
    return len(group.observed), group.columns.shape[-1]


def _weight(covariance: np.ndarray) -> np.ndarray:
    """Weights in the form of a covariance."""
    return 1.0 / covariance if covariance.ndim == 1 else np.linalg.inv(covariance)


def _weighted(weight: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Weighted residuals P v (r, m)."""
    if weight.ndim == 1:
        return residual * weight
    if weight.ndim == 2:
        return residual @ weight
    return np.einsum("bij,rbj->rbi", weight, residual.reshape(len(residual), *weight.shape[:2])).reshape(residual.shape)


def _pairs(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of rows with a weight between them: both rows (p,), and the weight (p,)."""
    if weight.ndim == 1:
        rows = np.arange(len(weight))
        return rows, rows, weight
    blocks = weight if weight.ndim == 3 else weight[None]
    b, i, j = np.nonzero(blocks)
    return b * blocks.shape[1] + i, b * blocks.shape[1] + j, blocks[b, i, j]
