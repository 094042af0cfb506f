"""Elimination of targets from a ranging network in plain numpy (Schur complement).

For small problems, and as the test of the compiled form. Each target's 3 x 3 block V of the normal matrix is eliminated
into a dense system of the stations' parameters, x y z and, where any is free, zero and scale. With a = root (1 + scale)
u the whitened derivative of a range by its target, g = (-a, root, root D) by the station's parameters and W = g a', the
reduced matrix is the sum of g g' - W V^-1 W'. Source: [FOERSTNER16] chapter 15, elimination of points from the normal
equations of a bundle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY

UNCHECKED = 1e-12  # redundancy of a range without a check: its test stays finite
CHUNK = 4_000_000  # numbers in the largest array of one chunk of targets


@dataclass(frozen=True, eq=False)
class Problem:
    """Validated ranging network for the elimination.

    station, target   (m,) index of each range's ends
    distance, sigma   (m,) observed value and claimed standard uncertainty, m
    inflation         (m,) factor on each sigma, infinite if left out; None: 1
    width             parameters per station: 3, or 5 with zero and scale
    free_stations     (S, width) bool
    free_targets      (T, 3) bool
    target_weight     (T, 3, 3) inverse covariance of the targets' priors, zero if none; None: no priors
    target_value      (T, 3) m, their values
    """

    station: np.ndarray
    target: np.ndarray
    distance: np.ndarray
    sigma: np.ndarray
    inflation: np.ndarray | None
    width: int
    free_stations: np.ndarray
    free_targets: np.ndarray
    target_weight: np.ndarray | None
    target_value: np.ndarray | None

    @cached_property
    def root(self) -> np.ndarray:
        """Square root (m,) of the weights, 1/m; 0 if left out."""
        return 1.0 / (self.sigma if self.inflation is None else self.sigma * self.inflation)

    @property
    def used(self) -> int:
        """Number of ranges in the solution."""
        return len(self.sigma) if self.inflation is None else int(np.sum(np.isfinite(self.inflation)))


@dataclass(frozen=True, eq=False)
class IterationState:
    """State of the iteration: stations (S, 3), targets (T, 3), zero (S,) in metres, scale (S,)."""

    stations: np.ndarray
    targets: np.ndarray
    zero: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class Reduced:
    """Normal equations of the stations' parameters after the targets' elimination.

    normal        (n, n), n = S width, held parameters included
    before        (n,) its diagonal before the elimination
    right         (n,)
    inverse       (T, 3, 3) V^-1 over free coordinates, zero elsewhere
    target_step   (T, 3) V^-1 b, the targets' step with fixed stations
    condition     (T,) 1 / (trace V trace V^-1), nearly the ratio of V's smallest eigenvalue to their sum; nan without V
    cost          sum of squares of the whitened misclosures of the ranges; nan if the ends of a range coincide
    gain          sum of b' V^-1 b
    moment        sum of (root D)^2: amplification of roundoff in the cost
    """

    normal: np.ndarray
    before: np.ndarray
    right: np.ndarray
    inverse: np.ndarray
    target_step: np.ndarray
    condition: np.ndarray
    cost: float
    gain: float
    moment: float


@dataclass(frozen=True, eq=False)
class Statistics:
    """Covariance (T, 3, 3) of the targets, m^2, and tests (m,) of the ranges as in `GroupFit`."""

    covariance: np.ndarray
    residual: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    detectable: np.ndarray

    @classmethod
    def unknown(cls, t: int, m: int) -> "Statistics":
        """Statistics without a solution: nan.

        The four arrays of ranges are one.
        """
        undefined = np.full(m, np.nan)
        return cls(np.full((t, 3, 3), np.nan), undefined, undefined, undefined, undefined)


@dataclass(frozen=True, eq=False)
class RangeRows:
    """Ranges linearised and whitened: rows, ends, a (k, 3), g (k, width), misclosure (k,)."""

    rows: np.ndarray
    station: np.ndarray
    target: np.ndarray
    a: np.ndarray
    g: np.ndarray
    misclosure: np.ndarray
    length: np.ndarray


def linearise(problem: Problem, state: IterationState, rows: np.ndarray, *, root: np.ndarray) -> RangeRows:
    """Ranges `rows` linearised at a state, whitened with root (k,)."""
    station, target = problem.station[rows], problem.target[rows]
    along = state.targets[target] - state.stations[station]
    length = np.sqrt(np.einsum("ij,ij->i", along, along))
    stretch = 1.0 + state.scale[station]
    a = along * (root * stretch / np.maximum(length, 1e-300))[:, None]
    misclosure = root * (problem.distance[rows] - stretch * length - state.zero[station])
    g = -a if problem.width == 3 else np.concatenate([-a, root[:, None], (root * length)[:, None]], axis=1)
    return RangeRows(rows=rows, station=station, target=target, a=a, g=g, misclosure=misclosure, length=length)


def invert_targets(v: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses of V (T, 3, 3) over free coordinates (T, 3), and 1 / (trace V trace V^-1).

    Zero elsewhere. By the factors L D L', independent of scale; a singular V gives a condition of nan, infinity or
    below roundoff.
    """
    fx, fy, fz = free.T.astype(float)
    out = np.empty_like(v)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a, b, c = v[:, 0, 0] * fx + (1.0 - fx), v[:, 0, 1] * fx * fy, v[:, 0, 2] * fx * fz
        d, e, f = v[:, 1, 1] * fy + (1.0 - fy), v[:, 1, 2] * fy * fz, v[:, 2, 2] * fz + (1.0 - fz)
        l1, l2 = b / a, c / a
        d1 = d - l1 * b
        l3 = (e - l1 * c) / d1
        zz = 1.0 / (f - l2 * c - l3 * (e - l1 * c))
        yz = -l3 * zz
        xz = -l1 * yz - l2 * zz
        yy = 1.0 / d1 - l3 * yz
        xy = -l1 * yy - l2 * yz
        xx = 1.0 / a - l1 * xy - l2 * xz
        out[:, 0, 0], out[:, 1, 1], out[:, 2, 2] = xx * fx, yy * fy, zz * fz
        out[:, 0, 1] = out[:, 1, 0] = xy
        out[:, 0, 2] = out[:, 2, 0] = xz
        out[:, 1, 2] = out[:, 2, 1] = yz
        trace = v[:, 0, 0] * fx + v[:, 1, 1] * fy + v[:, 2, 2] * fz
        return out, 1.0 / (trace * np.trace(out, axis1=1, axis2=2))


class NumpyBlocks:
    """Elimination, back-substitution and statistics of one problem; compiled form `KernelBlocks`."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self._sorted = np.argsort(problem.target, kind="stable")
        self._first = np.searchsorted(problem.target[self._sorted], np.arange(len(problem.free_targets) + 1))
        self._stations = len(problem.free_stations)
        self._size = self._stations * problem.width
        used = problem.root > 0.0
        pairs = problem.target[used].astype(np.int64) * self._stations + problem.station[used]
        self._repeated = len(np.unique(pairs)) < len(pairs)

    def _chunks(self) -> Iterator[tuple[slice, np.ndarray]]:
        """Slices of targets with the rows of their ranges, to bound memory to CHUNK numbers."""
        step = max(1, CHUNK // max(1, 3 * self._size))
        for low in range(0, len(self._first) - 1, step):
            high = min(low + step, len(self._first) - 1)
            yield slice(low, high), self._sorted[self._first[low] : self._first[high]]

    def _coupling(self, linear: RangeRows, part: slice) -> np.ndarray:
        """Coupling W (t, n, 3) of some targets with the stations."""
        w = np.zeros((part.stop - part.start, self._stations, self.problem.width, 3))
        share = linear.g[:, :, None] * linear.a[:, None, :]
        at = (linear.target - part.start, linear.station)
        if self._repeated:
            np.add.at(w, at, share)
        else:
            used = self.problem.root[linear.rows] > 0.0  # a left-out range may repeat a used one
            w[at[0][used], at[1][used]] = share[used]
        return w.reshape(len(w), self._size, 3)

    def reduce(self, state: IterationState) -> Reduced:
        """Reduced normal equations at a state, targets eliminated."""
        problem, t = self.problem, len(self.problem.free_targets)
        normal, before, right = np.zeros((self._size, self._size)), np.zeros(self._size), np.zeros(self._size)
        inverse, local_step, condition = np.empty((t, 3, 3)), np.empty((t, 3)), np.empty(t)
        cost = gain = moment = 0.0
        for part, rows in self._chunks():
            linear = linearise(problem, state, rows, root=problem.root[rows])
            v, b = self._targets(linear, part, state)
            inverse[part], condition[part] = invert_targets(v, problem.free_targets[part])
            local_step[part] = np.einsum("tij,tj->ti", inverse[part], b)
            w = self._coupling(linear, part)
            with np.errstate(invalid="ignore"):  # a singular V is detected by its condition
                flat = np.ascontiguousarray(w.transpose(1, 0, 2)).reshape(self._size, -1)
                normal -= flat @ (w @ inverse[part]).transpose(0, 2, 1).reshape(-1, self._size)
                right -= flat @ local_step[part].ravel()
                gain += float(np.sum(local_step[part] * b))
            self._stations_alone(linear, normal, before, right)
            cost += float(linear.misclosure @ linear.misclosure)
            moment += float(np.sum((problem.root[rows] * linear.length) ** 2))
            if np.any((linear.length == 0.0) & (problem.root[rows] > 0.0)):
                cost = np.nan
        return Reduced(
            normal=(normal + normal.T) / 2,
            before=before,
            right=right,
            inverse=inverse,
            target_step=local_step,
            condition=condition,
            cost=cost,
            gain=gain,
            moment=moment,
        )

    def follow(self, state: IterationState, old: Reduced) -> Reduced:
        """Right-hand side and cost at a state near `old`, whose matrices are reused."""
        right, local_step, cost, gain, moment = np.zeros(self._size), np.empty_like(old.target_step), 0.0, 0.0, 0.0
        for part, rows in self._chunks():
            linear = linearise(self.problem, state, rows, root=self.problem.root[rows])
            b = self._targets(linear, part, state)[1]
            local_step[part] = np.einsum("tij,tj->ti", old.inverse[part], b)
            short = linear.misclosure - np.einsum("ki,ki->k", linear.a, local_step[linear.target])
            for i in range(self.problem.width):
                right[i :: self.problem.width] += np.bincount(linear.station, linear.g[:, i] * short, self._stations)
            gain += float(np.sum(local_step[part] * b))
            cost += float(linear.misclosure @ linear.misclosure)
            moment += float(np.sum((self.problem.root[rows] * linear.length) ** 2))
        return replace(old, right=right, target_step=local_step, cost=cost, gain=gain, moment=moment)

    def felt(self, at: IterationState, target_steps: np.ndarray) -> np.ndarray:
        """Effect (n, f) on the stations of target steps, own (T, 3, f): minus the sum of g a' own."""
        f = target_steps.shape[2]
        out = np.zeros((self._stations, self.problem.width, f))
        for _, rows in self._chunks():
            linear = linearise(self.problem, at, rows, root=self.problem.root[rows])
            along = np.einsum("ki,kif->kf", linear.a, target_steps[linear.target])
            for i in range(self.problem.width):
                for j in range(f):
                    out[:, i, j] -= np.bincount(linear.station, linear.g[:, i] * along[:, j], self._stations)
        return out.reshape(self._size, f)

    def _targets(self, linear: RangeRows, part: slice, state: IterationState) -> tuple[np.ndarray, np.ndarray]:
        """V and right-hand side of some targets, priors included."""
        n, at = part.stop - part.start, linear.target - part.start
        v, b = np.empty((n, 3, 3)), np.empty((n, 3))
        for i in range(3):
            b[:, i] = np.bincount(at, linear.a[:, i] * linear.misclosure, n)
            for j in range(i, 3):
                v[:, i, j] = v[:, j, i] = np.bincount(at, linear.a[:, i] * linear.a[:, j], n)
        if self.problem.target_weight is not None and self.problem.target_value is not None:
            weight = self.problem.target_weight[part]
            v += weight
            b += np.einsum("tij,tj->ti", weight, self.problem.target_value[part] - state.targets[part])
        return v, b

    def _stations_alone(self, linear: RangeRows, normal: np.ndarray, before: np.ndarray, right: np.ndarray) -> None:
        """Add the sums of g g' and g misclosure of some ranges."""
        s, p = self._stations, self.problem.width
        first = np.arange(s) * p
        for i in range(p):
            right[first + i] += np.bincount(linear.station, linear.g[:, i] * linear.misclosure, s)
            for j in range(p):
                normal[first + i, first + j] += np.bincount(linear.station, linear.g[:, i] * linear.g[:, j], s)
            before[first + i] += np.bincount(linear.station, linear.g[:, i] ** 2, s)

    def back(self, state: IterationState, reduced: Reduced, step: np.ndarray) -> np.ndarray:
        """Targets' step (T, 3) for a step (n,) of the stations' parameters (back-substitution)."""
        moved = np.empty_like(reduced.target_step)
        by_station = step.reshape(self._stations, -1)
        for part, rows in self._chunks():
            linear = linearise(self.problem, state, rows, root=self.problem.root[rows])
            along = np.einsum("ij,ij->i", linear.g, by_station[linear.station])
            at, n = linear.target - part.start, part.stop - part.start
            total = np.stack([np.bincount(at, linear.a[:, i] * along, n) for i in range(3)], axis=1)
            moved[part] = reduced.target_step[part] - np.einsum("tij,tj->ti", reduced.inverse[part], total)
        return moved

    def statistics(self, at: IterationState, answer: IterationState, inverse: np.ndarray, q: np.ndarray) -> Statistics:
        """Covariances and tests, from V^-1 of the targets and covariance q (n, n) of the stations.

        Directions are those at `at`, where both were computed; residuals are those of the answer, one step further.
        """
        problem, m = self.problem, len(self.problem.distance)
        covariance, h, misclosure = np.empty_like(inverse), np.empty(m), np.empty(m)
        blocks = q.reshape(self._stations, problem.width, self._stations, problem.width)
        for part, rows in self._chunks():
            used = linearise(problem, at, rows, root=problem.root[rows])
            linear = linearise(problem, at, rows, root=1.0 / problem.sigma[rows])
            y = -self._coupling(used, part) @ inverse[part]  # dx_target = y' dx_stations + ..., (t, n, 3)
            cross = q @ y
            covariance[part] = inverse[part] + y.transpose(0, 2, 1) @ cross
            t, s = linear.target - part.start, linear.station
            between = cross.reshape(len(y), self._stations, problem.width, 3)[t, s]
            h[rows] = np.einsum("ki,kij,kj->k", linear.g, blocks[s, :, s, :], linear.g)
            h[rows] += 2.0 * np.einsum("ki,kij,kj->k", linear.g, between, linear.a)
            h[rows] += np.einsum("ki,kij,kj->k", linear.a, covariance[linear.target], linear.a)
            misclosure[rows] = linearise(problem, answer, rows, root=1.0 / problem.sigma[rows]).misclosure
        return Statistics(covariance, *judged(problem, h, misclosure))


def judged(problem: Problem, h: np.ndarray, misclosure: np.ndarray) -> tuple[np.ndarray, ...]:
    """Residual, redundancy, standardised residual and detectable error of ranges.

    h             (m,) variance of the predicted range over its claimed variance
    misclosure    (m,) residual over the claimed sigma

    Source: [BAARDA68] w test and minimal detectable error; a range left out is tested against its prediction.
    """
    share = (problem.root * problem.sigma) ** 2
    active = share > 0.0
    redundancy = 1.0 - share * h
    spread = np.sqrt(np.where(active, np.maximum(redundancy, UNCHECKED) / np.where(active, share, 1.0), 1.0 + h))
    detectable = NONCENTRALITY * problem.sigma * np.where(active, 1.0 / (np.where(active, share, 1.0) * spread), spread)
    return problem.sigma * misclosure, redundancy, misclosure / spread, detectable
