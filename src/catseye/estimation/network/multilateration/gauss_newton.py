"""Gauss-Newton adjustment of ranging networks by block elimination of the targets.

Stations measure distances to targets, all coordinates unknown: observed = (1 + scale) |target - station| + zero +
error, zero and scale of the station held, free or with a prior. Every target is eliminated into a dense system of the
stations' parameters, so thousands of targets cost milliseconds: in plain numpy for small networks, compiled for large
ones. The Gauss-Newton step is halved while the cost rises, and the normal matrix of a large network is kept once a step
is a thousandth of the previous one (covariances accurate to 1e-6). The method is scale-free: rank is determined from
directions and from the share of a diagonal that remains after the elimination, independent of units. Free motions are
fixed by inner constraints: see `datum`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import lapack

from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.adjustment import COMPLETE, ROUNDING, STEP_IN_SIGMAS, SolverSettings
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome, Status, not_converged, undefined
from catseye.estimation.network.multilateration import status as status_of
from catseye.estimation.network.multilateration.blocks import IterationState, NumpyBlocks, Reduced, Statistics
from catseye.estimation.network.multilateration.datum import InnerConstraints, displacements, generators
from catseye.estimation.network.multilateration.network import RangingNetwork, Setup, set_up
from catseye.estimation.network.multilateration.solution import Gauge, RangingSolution

COMPILED_FROM = 200_000  # ranges: below it importing the compiled kernels costs more than they save
WORST_TARGET = 1e-12  # of 1 / (trace V trace V^-1): coplanar directions within 1 microradian are singular
WORST_NETWORK = 1e-13  # of the reduced matrix, scaled by its diagonal before elimination: roundoff limit
KEEP_BELOW = 1e-3  # of the previous step: below it the normal matrix is kept
KEEP_FROM = 20_000  # ranges: below it rebuilding is cheap, and the matrix is not kept
EPS = float(np.finfo(float).eps)


class Blocks(Protocol):
    """Protocol of both engines: `NumpyBlocks`, `KernelBlocks`."""

    def reduce(self, state: IterationState) -> Reduced: ...
    def follow(self, state: IterationState, old: Reduced) -> Reduced: ...
    def back(self, state: IterationState, reduced: Reduced, step: np.ndarray) -> np.ndarray: ...
    def felt(self, at: IterationState, target_steps: np.ndarray) -> np.ndarray: ...
    def statistics(
        self, at: IterationState, answer: IterationState, inverse: np.ndarray, q: np.ndarray
    ) -> Statistics: ...


def adjust_ranges(
    network: RangingNetwork,
    *,
    solver: SolverSettings = COMPLETE,
    inflation: np.ndarray | None = None,
    engine: str | None = None,
) -> RangingSolution:
    """Best-fit coordinates, zeros and scales of a ranging network, with covariances and tests.

    network      see `RangingNetwork`
    solver       cap of steps, tests or not; without tests, covariances and tests are nan
    inflation    (m,) factor on each range's sigma, infinite leaves it out but still tests it against its prediction
    engine       "numpy", "numba", or None: compiled from 200 000 ranges on

    The status of the solution describes any failure; raises InputError for an invalid network.

    Source: [FOERSTNER16] chapters 4 and 15 (Gauss-Markov model, elimination, gauge), [BAARDA68] (tests).

    >>> corners = np.array([[x, y, z] for x in (0.0, 9.0) for y in (0.0, 8.0) for z in (0.0, 3.0)])
    >>> balls = np.array([[2.0, 1.0, 1.0], [5.0, 6.0, 2.0], [8.0, 3.0, 0.5], [1.0, 7.0, 2.5], [4.0, 2.0, 2.9]])
    >>> (i, j), datum = np.divmod(np.arange(40), 5), np.ones((8, 3), dtype=bool)
    >>> seen = np.linalg.norm(balls[j] - corners[i], axis=1)
    >>> room = RangingNetwork(corners + 0.01, balls, i, j, seen, np.full(40, 1e-5), datum_stations=datum)
    >>> answer = adjust_ranges(room)
    >>> answer.status, answer.degrees_of_freedom, bool(np.abs(answer.targets - 0.01 - balls).max() < 1e-9)
    ('converged', 7, True)
    """
    setup = set_up(network, inflation)
    blocks = _engine(setup, engine)
    return _Iteration(setup, blocks).run(network, solver)


def _engine(setup: Setup, engine: str | None) -> Blocks:
    if engine not in (None, "numpy", "numba"):
        raise InputError(f'unknown engine {engine!r} (expected "numpy", "numba" or None)')
    if engine == "numpy" or (engine is None and len(setup.problem.distance) < COMPILED_FROM):
        return NumpyBlocks(setup.problem)
    from catseye.estimation.network.multilateration.kernel import KernelBlocks

    return KernelBlocks(setup.problem)


@dataclass(frozen=True, eq=False)
class _Factor:
    """Cholesky factor of the reduced matrix over the free parameters, regularised along free motions.

    index   (k,) the free parameters
    scale   (k,) their scale factors
    lower   (k, k)
    basis   (k, f) orthonormal, scaled: the free motions
    """

    index: np.ndarray
    scale: np.ndarray
    lower: np.ndarray
    basis: np.ndarray

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Shortest (scaled) solution (n,) for a right-hand side (n,)."""
        step = np.zeros(len(right))
        if len(self.index):
            step[self.index] = self.scale * lapack.dpotrs(self.lower, self.scale * right[self.index], lower=1)[0]
        return step

    def inverse(self, n: int) -> np.ndarray:
        """Pseudoinverse (n, n) in scaled parameters, zero if held."""
        out = np.zeros((n, n))
        if len(self.index):
            half = np.tril(lapack.dpotri(self.lower, lower=1)[0])
            full = half + np.tril(half, -1).T - self.basis @ self.basis.T
            out[np.ix_(self.index, self.index)] = full * self.scale[:, None] * self.scale
        return out


@dataclass(frozen=True, eq=False)
class _Step:
    """Gauss-Newton step of the stations' parameters (n,) and targets (T, 3).

    size     in standard deviations of all parameters together, the motion to the datum included
    gain     reduction of the cost, to first order
    noise    roundoff of `size`
    """

    stations: np.ndarray
    targets: np.ndarray
    size: float
    gain: float
    noise: float
    factor: _Factor
    motions: np.ndarray


class _Iteration:
    """Gauss-Newton iteration on one network."""

    def __init__(self, setup: Setup, blocks: Blocks):
        self.setup, self.blocks, self.problem = setup, blocks, setup.problem
        self.state = self.at = setup.start
        self.factor: _Factor | None = None
        self.reuses_matrix = len(self.problem.distance) >= KEEP_FROM
        self.free = np.flatnonzero(self.problem.free_stations.ravel())
        self.steps, self.cost, self.moment = 0, np.nan, 0.0

    def run(self, network: RangingNetwork, solver: SolverSettings) -> RangingSolution:
        """Iterate to convergence, then compute the statistics."""
        status, answer = not_converged(np.inf, 0), None
        reduced, before = self._reduce(self.state), 0.0
        while self.steps < solver.iterations:
            self.steps += 1
            step = self._solve(reduced)
            if isinstance(step, Status):
                status = step
                break
            if step.size < STEP_IN_SIGMAS + step.noise:
                status, answer = CONVERGED, step
                break
            status = not_converged(step.size, self.steps)
            descent = self._descend(step, reduced, keep=self.reuses_matrix and step.size < KEEP_BELOW * before)
            if descent is None:
                break
            reduced, before = descent, step.size
        return self._solution(network, status, reduced, answer, solver.tests)

    def _reduce(self, state: IterationState) -> Reduced:
        """Normal equations at a state; the factor is reset."""
        reduced = self.blocks.reduce(state)
        cost, moment = self.setup.terms.add(state, reduced.normal, reduced.before, reduced.right, self.problem.width)
        self.cost, self.moment, self.at, self.factor = reduced.cost + cost, reduced.moment + moment, state, None
        return reduced

    def _follow(self, state: IterationState, old: Reduced) -> Reduced:
        """Right-hand side at a nearby state.

        Normal matrix and factor are reused.
        """
        reduced = self.blocks.follow(state, old)
        aside = np.zeros_like(old.normal), np.zeros_like(old.before)
        cost, moment = self.setup.terms.add(state, *aside, reduced.right, self.problem.width)
        self.cost, self.moment = reduced.cost + cost, reduced.moment + moment
        return reduced

    def _moved(self, step: _Step, fraction: float) -> IterationState:
        by_station = fraction * step.stations.reshape(self.problem.free_stations.shape)
        old = self.state
        zero, scale = (
            (old.zero + by_station[:, 3], old.scale + by_station[:, 4])
            if self.problem.width > 3
            else (old.zero, old.scale)
        )
        return IterationState(old.stations + by_station[:, :3], old.targets + fraction * step.targets, zero, scale)

    def _descend(self, step: _Step, old: Reduced, *, keep: bool) -> Reduced | None:
        """Take the step, halved while the cost rises.

        None if it never falls.

        keep   reuse the normal matrix, if the full step descends
        """
        before = self.cost
        noise = 8.0 * EPS * (before * self.moment) ** 0.5 + EPS**2 * self.moment  # of the cost, from roundoff of D
        for halving in range(11):
            trial = self._moved(step, 0.5**halving)
            reduced = self._follow(trial, old) if keep and not halving else self._reduce(trial)
            if self.cost <= before * ROUNDING + noise:
                self.state = trial
                return reduced
        self.cost = before
        return None

    def _solve(self, reduced: Reduced) -> _Step | Status:
        """Next step, or the reason why there is none."""
        if not np.isfinite(self.cost):
            return self._undefined()
        refusal = self._floating(reduced)
        if refusal is not None:
            return refusal
        motions = self.setup.motions(self.state)
        null = self._null(motions, self.state)
        factor = self.factor or self._factorise(reduced, null)
        if isinstance(factor, Status):
            return factor
        self.factor = factor
        first = factor.solve(reduced.right)
        second = self.blocks.back(self.state, reduced, first)
        gain = max(reduced.gain + float(reduced.right @ first), 0.0)
        size = gain
        if motions.shape[1]:
            conditions = self._conditions(motions, self.state)
            if isinstance(conditions, Status):
                return conditions
            shift = conditions.restore(first.reshape(len(self.state.stations), -1)[:, :3], second)
            turned = null @ shift
            first = first + turned
            second = second + displacements(self.state.targets, motions @ shift) * self.problem.free_targets
            size += float(reduced.before @ turned**2)
        return _Step(
            stations=first,
            targets=second,
            size=size**0.5,
            gain=gain,
            noise=4.0 * EPS * self.moment**0.5,
            factor=factor,
            motions=motions,
        )

    def _undefined(self) -> Status:
        problem, names = self.problem, self.setup.names
        along = self.state.targets[problem.target] - self.state.stations[problem.station]
        coinciding = np.flatnonzero(~np.any(along != 0.0, axis=1) & (problem.root > 0.0))
        called = [
            f"the range {names.station(problem.station[i])} to {names.target(problem.target[i])}" for i in coinciding
        ]
        return undefined(status_of.listed(called) if called else "a range between stations")

    def _floating(self, reduced: Reduced) -> Status | None:
        """Reason why a target is not determined relative to its stations, or None."""
        fine = reduced.condition >= WORST_TARGET
        if fine.all():
            return None
        needed = np.any(self.problem.free_targets, axis=1)
        if self.setup.terms.targets is not None:
            needed[self.setup.terms.targets.index] = False  # positive definite by its prior
        bad = np.flatnonzero(~fine & needed)
        if not len(bad):
            return None
        return status_of.floating_targets(self.problem, self.state, self.setup.names, floating=bad)

    def _null(self, motions: np.ndarray, state: IterationState) -> np.ndarray:
        """Free motions in terms of the stations' parameters, (n, f)."""
        null = np.zeros((*self.problem.free_stations.shape, motions.shape[1]))
        null[:, :3] = generators(state.stations) @ motions
        if self.problem.width > 3:
            null[:, 4] = -(1.0 + state.scale)[:, None] * motions[6]
        return (null * self.problem.free_stations[:, :, None]).reshape(
            self.problem.free_stations.size, motions.shape[1]
        )

    def _factorise(self, reduced: Reduced, null: np.ndarray) -> _Factor | Status:
        free = self.free
        before = reduced.before[free]
        empty = np.zeros((0, 0))
        if not len(free):
            return _Factor(free, before, empty, empty)
        if np.any(before <= 0.0):
            return self._network_floats(np.where(before <= 0.0, 1.0, 0.0))
        scale = 1.0 / np.sqrt(before)
        scaled = reduced.normal[free[:, None], free] * scale[:, None] * scale
        basis = np.zeros((len(free), 0))
        if null.shape[1]:
            left, values, _ = np.linalg.svd(null[free] / scale[:, None], full_matrices=False)
            basis = left[:, values > 1e-9 * values[0]]
            scaled += basis @ basis.T
        lower, failed = lapack.dpotrf(scaled, lower=1)
        good = 0.0 if failed else lapack.dpocon(lower, np.abs(scaled).sum(axis=0).max(), uplo="L")[0]
        if not good > WORST_NETWORK:
            values, vectors = np.linalg.eigh(scaled)
            floating = values < max(values[-1] * WORST_NETWORK * 10, 10 * values[0])
            return self._network_floats(np.sum(vectors[:, floating] ** 2, axis=1))
        return _Factor(free, scale, lower, basis)

    def _network_floats(self, part: np.ndarray) -> Status:
        full = np.zeros(self.problem.free_stations.size)
        full[self.free] = part
        between = self.setup.terms.between
        joined = (between.first, between.second) if between is not None else (self.free[:0], self.free[:0])
        return status_of.floating_network(self.problem, self.setup.names, joined, part=full)

    def _conditions(self, motions: np.ndarray, state: IterationState) -> InnerConstraints | Status:
        """Inner constraints at a state, or the reason why they do not fix the free motions."""
        datum = self.setup.datum
        count = motions.shape[1]
        if datum.empty:
            words = status_of.described(motions, self.setup.size)
            return Status(AdjustmentOutcome.RANK_DEFICIENT, status_of.MOTIONS.format(motions=words, count=count))
        free = self.problem.free_stations[:, :3], self.problem.free_targets
        conditions = datum.conditions(state, motions, free)
        _, values, vectors = np.linalg.svd(conditions.response)
        loose = values <= 1e-10 * max(values[0], 1.0)
        if loose.any():
            words = status_of.described(motions @ vectors[loose].T, self.setup.size)
            return Status(AdjustmentOutcome.RANK_DEFICIENT, status_of.DATUM.format(motions=words))
        return conditions

    def _solution(
        self, network: RangingNetwork, status: Status, reduced: Reduced, answer: _Step | None, tests: bool
    ) -> RangingSolution:
        problem, at, n = self.problem, self.at, self.problem.free_stations.size
        state, pvv = self.state, self.cost
        covariance, gauge, statistics = np.full((n, n), np.nan), None, None
        if answer is not None:  # last step; the statistics refer to the state of the normal matrix
            state, pvv = self._moved(answer, 1.0), max(self.cost - answer.gain, 0.0)
        conditions = answer.motions.shape[1] if answer is not None else 0
        if answer is not None and tests:
            covariance, gauge = self._covariance(answer, reduced)
            statistics = self.blocks.statistics(at, state, reduced.inverse, covariance)
            if len(gauge.points):
                x = at.targets[gauge.points]
                moved = (generators(x) @ gauge.motions) * problem.free_targets[gauge.points][:, :, None]
                joined = moved @ gauge.drift.transpose(0, 2, 1)
                statistics.covariance[gauge.points] -= joined + joined.transpose(0, 2, 1)
        computed = statistics
        statistics = statistics or Statistics.unknown(len(state.targets), len(problem.distance))
        free = int(np.sum(problem.free_stations)) + int(np.sum(problem.free_targets))
        count = problem.used + self.setup.terms.count()
        degrees = count - free + conditions
        if status == CONVERGED and degrees > 0 and pvv > status_of.BELIEVABLE**2 * degrees:
            status = status_of.contradiction(problem, state, self.setup.names, statistics=computed) or status
        return RangingSolution(
            network=network,
            stations=state.stations + self.setup.origin,
            targets=state.targets + self.setup.origin,
            zero=state.zero,
            scale=state.scale,
            status=status,
            iterations=self.steps,
            pvv=pvv,
            degrees_of_freedom=degrees,
            width=problem.width,
            covariance=covariance,
            covariance_targets=statistics.covariance,
            redundancy=statistics.redundancy,
            standardised=statistics.standardised,
            detectable=statistics.detectable,
            _setup=self.setup,
            _at=at,
            _answer=state,
            _inverse=reduced.inverse,
            _gauge=gauge,
        )

    def _covariance(self, answer: _Step, reduced: Reduced) -> tuple[np.ndarray, Gauge]:
        """Covariance (n, n) of the stations' parameters in the datum (S-transformation), and the gauge.

        With h the conditions' derivative by the stations, the targets following them, and R the inverse of their
        response: T = 1 - N R h', Q = T Q0 T' + N R (sum over datum targets of H' V^-1 H) R' N'.
        """
        n, motions = self.problem.free_stations.size, answer.motions
        q, null = answer.factor.inverse(n), self._null(motions, self.at)
        f = motions.shape[1]
        gauge = Gauge(motions, null, np.zeros(0, dtype=np.int64), np.zeros((0, 3, f)))
        if not f:
            return q, gauge
        conditions = self._conditions(motions, self.at)
        if isinstance(conditions, Status):  # they were fixed one step before
            raise EstimationError(conditions)
        by_station = np.zeros((*self.problem.free_stations.shape, f))
        by_station[:, :3] = conditions.at_stations
        h, back, spread = by_station.reshape(n, f), np.linalg.inv(conditions.response), np.zeros((f, f))
        if len(conditions.points):
            followed = reduced.inverse[conditions.points] @ conditions.at_targets
            spread = np.einsum("kif,kig->fg", conditions.at_targets, followed)
            everywhere = np.zeros((len(self.at.targets), 3, f))
            everywhere[conditions.points] = followed
            h = h + self.blocks.felt(self.at, everywhere)
            gauge = Gauge(motions, null, conditions.points, followed @ back.T)
        null_response, projected = null @ back, h.T @ q
        moved = null_response @ projected
        return q - moved - moved.T + null_response @ (projected @ h + spread) @ null_response.T, gauge
