"""Monte Carlo simulation of a network: noise, air and blunders drawn, each run adjusted.

Runs are drawn in blocks, each from a generator of its own, so that a run is the same however the runs are divided among
processes; what they add to the result are sums. Observations without blunders are solved in batches, see `batched`;
blunders, and what a batch refuses, one run after the other.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.errors import EstimationError
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.network.adjustment import FixedParts, fixed_parts
from catseye.estimation.network.batched import BatchedNetwork
from catseye.estimation.network.copies import Predict, prediction
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.observations.kinds import Distances, ZenithAngles
from catseye.estimation.observations.sight import TWO_PI
from catseye.estimation.quality.sample_covariance import CovarianceTest, covariance_test, whitening

XY = np.arange(2)
BLOCK = 25  # runs of one generator
TOGETHER = 8  # blocks drawn and solved together
MOST_TESTED = 300  # coordinates of the matrix test; of more, as many are chosen evenly
LARGEST_DENSE_RUN = 600  # parameters, above which networks of ranges go another way
SEARCH = 20.0  # adjustments in a search for blunders
CHUNK_S = 1.0  # s, processor time of a chunk of runs: long beside a process's start, short beside an interruption

Solve = Callable[[ObservationNetwork], NetworkSolution]


@dataclass(frozen=True)
class Disturbance:
    """Disturbances in addition to the claimed noise.

    common_ppm    standard deviation of a scale error common to all ranges: the index of air
    station_ppm   standard deviation of a scale error per ranger: its own thermometer
    refraction    standard deviation of the coefficient k of vertical refraction, which bends all zenith angles
    blunders      share of observations with a gross error
    size          standard deviations of such an error, either sign
    """

    common_ppm: float = 0.0
    station_ppm: float = 0.0
    refraction: float = 0.0
    blunders: float = 0.0
    size: float = 20.0


UNDISTURBED = Disturbance()


@dataclass(frozen=True, eq=False)
class MonteCarloScatter:
    """Result of the runs.

    runs          that converged
    asked         runs requested
    rms           (n, 3) m, root mean square departure of each coordinate from the truth
    predicted     (n, 3) m, claimed standard uncertainties
    ratio         root mean square of departure over claim, all free coordinates: 1 when the claim holds
    found         share of the blunders that were rejected, nan without any
    false         share of the good observations that were rejected
    covariance    departures of the coordinates against their planned covariance, as matrices
    """

    runs: int
    asked: int
    rms: np.ndarray
    predicted: np.ndarray
    ratio: float
    found: float
    false: float
    covariance: CovarianceTest


@dataclass(frozen=True, eq=False)
class DrawnRuns:
    """Runs of a network, drawn and not yet solved.

    truth      (r, n) parameters
    observed   (r, m) of each group
    wrong      (r, m) bool of each group: blunders
    """

    truth: np.ndarray
    observed: list[np.ndarray]
    wrong: list[np.ndarray]


@dataclass(frozen=True, eq=False)
class RunSums:
    """Sums over some runs, of f parameters that move.

    asked, runs        runs drawn, and those that converged
    squares            (f,) of the departures from the truth
    claims             (f,) of the claimed variances
    ratios             of each run's mean of departure² over claim, coordinates only
    moments            (k, k) of the products of independent combinations of the departures
    rejected, blunders              blunders that were rejected, and all
    good_rejected, good             the same of the other observations
    status             of a run that did not converge, or ""
    """

    asked: int
    runs: int
    squares: np.ndarray
    claims: np.ndarray
    ratios: float
    moments: np.ndarray
    rejected: int = 0
    blunders: int = 0
    good_rejected: int = 0
    good: int = 0
    status: str = ""

    def __add__(self, other: "RunSums") -> "RunSums":
        summed = {name: value + getattr(other, name) for name, value in vars(self).items() if name != "status"}
        return RunSums(**summed, status=other.status or self.status)

    def to_object(self) -> dict[str, Any]:
        """Object for JSON, exact."""
        lower = self.moments[np.tril_indices(len(self.moments))]
        arrays = {"squares": self.squares.tolist(), "claims": self.claims.tolist(), "moments": lower.tolist()}
        return {**vars(self), **arrays}

    @classmethod
    def from_object(cls, content: Mapping[str, Any]) -> "RunSums":
        """Sums of an object that `to_object` made."""
        lower = np.array(content["moments"])
        k = int(np.sqrt(2 * len(lower)))
        moments = np.zeros((k, k))
        moments[np.tril_indices(k)] = lower
        moments = moments + np.tril(moments, -1).T
        arrays = {name: np.array(content[name]) for name in ("squares", "claims")}
        return cls(**{**content, **arrays, "moments": moments})


@dataclass(frozen=True, eq=False)
class NetworkSimulation:
    """Network to be measured and adjusted many times.

    network       with its datum marked; its coordinates and parameters are the truth of every run
    parts         of it that all runs share
    combinations  (k, f) of the f parameters that move, of coordinates alone: their errors are independent and of unit
                  variance by the plan
    disturbance   in addition to the claimed noise
    seed          of the generators
    in_batches    True: runs are solved in batches
    """

    network: ObservationNetwork
    parts: FixedParts
    combinations: np.ndarray
    disturbance: Disturbance
    seed: int
    in_batches: bool

    @classmethod
    def of(cls, solution: NetworkSolution, *, seed: int, disturbance: Disturbance = UNDISTURBED) -> "NetworkSimulation":
        """Simulation of a network that was solved with its predicted observations."""
        parts = fixed_parts(solution)
        moving = np.flatnonzero(parts.free)
        tested = np.flatnonzero(moving < solution.network.points.xyz.size)
        if len(tested) > MOST_TESTED:
            tested = tested[np.linspace(0, len(tested) - 1, MOST_TESTED).round().astype(int)]
        root = whitening(solution.q.within(moving[tested]))
        combinations = np.zeros((len(root), len(moving)))
        combinations[:, tested] = root
        alone = disturbance.blunders > 0.0 or not BatchedNetwork.suits(solution)
        return cls(
            network=solution.network,
            parts=parts,
            combinations=combinations,
            disturbance=disturbance,
            seed=seed,
            in_batches=not alone,
        )

    @cached_property
    def moving(self) -> np.ndarray:
        """Columns (f,) of the parameters that move."""
        return np.flatnonzero(self.parts.free)

    @cached_property
    def batches(self) -> BatchedNetwork:
        """The network, to be solved in batches."""
        return BatchedNetwork(self.parts)

    @cached_property
    def planned(self) -> np.ndarray:
        """Planned parameters (n,)."""
        points = self.network.points
        starts = [p.start for p in self.network.parameters]
        return np.concatenate([np.where(points.absent, 0.0, points.xyz).ravel(), starts])

    @cached_property
    def _angles(self) -> np.ndarray:
        """Mask (f,) of the angles among the parameters that move, which have no turn."""
        other_units = [p.unit == "rad" for p in self.network.parameters]
        return np.array([False] * self.network.points.xyz.size + other_units)[self.moving]

    @cached_property
    def _predictions(self) -> list[Predict]:
        return [prediction(group, self.planned) for group in self.network.groups]

    def draw(self, first: int, count: int) -> DrawnRuns:
        """Runs `first` to `first + count - 1`; the first begins a block."""
        sigma = np.array([p.sigma if np.isfinite(p.sigma) else 0.0 for p in self.network.parameters])
        blocks = [
            _drawn(self.network, np.random.default_rng([self.seed, block]), self.disturbance)
            for block in range(first // BLOCK, -(-(first + count) // BLOCK))
        ]
        joined = [np.concatenate(part)[:count] for part in zip(*blocks, strict=True)]
        priors, common, station, bend, *errors = joined
        truth = np.repeat(self.planned[None], count, axis=0)
        truth[:, len(self.planned) - len(sigma) :] += sigma * priors
        scale = (common * self.disturbance.common_ppm + station * self.disturbance.station_ppm) * PPM
        noise, wrong = errors[::2], errors[1::2]
        observed = []
        for group, predict, error, bad in zip(self.network.groups, self._predictions, noise, wrong, strict=True):
            values, _ = predict(truth, np.repeat(group.observed[None], count, axis=0))
            drawn = values + error
            if isinstance(group, Distances):
                drawn = drawn + values * scale[:, points_of(group)[0]]
            if isinstance(group, ZenithAngles):
                along = truth[:, group.target[:, None] + XY] - truth[:, group.origin[:, None] + XY]
                level = np.hypot(along[..., 0], along[..., 1])
                drawn = drawn - bend * self.disturbance.refraction * level / (2.0 * group.radius)
            observed.append(drawn + bad * self.disturbance.size * np.sqrt(variances(group)))
        return DrawnRuns(truth, observed, [bad != 0.0 for bad in wrong])

    def run(self, first: int, count: int, solve: Solve, progress: Progress | None = None) -> RunSums:
        """Sums over runs, drawn and solved.

        first      of them; begins a block
        count      of them
        solve      adjusts a network, rejection included
        progress   called with (what, done, of how many)
        """
        f, k = len(self.moving), len(self.combinations)
        sums = RunSums(asked=0, runs=0, squares=np.zeros(f), claims=np.zeros(f), ratios=0.0, moments=np.zeros((k, k)))
        step = BLOCK * (TOGETHER if self.in_batches else 1)
        for low in range(first, first + count, step):
            if progress is not None:
                progress("Monte Carlo runs", low - first, count)
            sums += self._solved(self.draw(low, min(step, first + count - low)), solve)
        return sums

    def _solved(self, runs: DrawnRuns, solve: Solve) -> RunSums:
        """Sums over drawn runs, solved here."""
        count, status = len(runs.truth), ""
        x, claims = np.full((2, count, len(self.moving)), np.nan)
        usable, tally = np.zeros(count, dtype=bool), np.zeros(4, dtype=int)
        if self.in_batches:
            solved = self.batches.solve(runs.observed)
            x, claims, usable = solved.x[:, self.moving], solved.variance, solved.accepted
            tally[3] = sum(wrong[usable].size for wrong in runs.wrong)
        for r in np.flatnonzero(~usable):
            pairs = zip(self.network.groups, runs.observed, strict=True)
            groups = tuple(replace(group, observed=o[r]) for group, o in pairs)  # type: ignore[type-var]
            solution = solve(replace(self.network, groups=groups))
            if not solution.status.usable:
                status = str(solution.status)
                continue
            x[r], claims[r], usable[r] = solution.state[self.moving], solution.q.diagonal()[self.moving], True
            tally += _rejections(solution, [wrong[r] for wrong in runs.wrong])
        departure = x[usable] - runs.truth[usable][:, self.moving]
        departure[:, self._angles] -= TWO_PI * np.round(departure[:, self._angles] / TWO_PI)
        claims, z = claims[usable], departure @ self.combinations.T
        placed = (self.moving < self.network.points.xyz.size) & (claims > 0.0)
        of_claim = np.where(placed, departure**2 / np.where(claims > 0.0, claims, 1.0), 0.0)
        ratios = of_claim.sum(axis=1) / np.maximum(placed.sum(axis=1), 1)
        return RunSums(
            asked=count,
            runs=len(z),
            squares=np.sum(departure**2, axis=0),
            claims=claims.sum(axis=0),
            ratios=float(ratios.sum()),
            moments=z.T @ z,
            rejected=int(tally[0]),
            blunders=int(tally[1]),
            good_rejected=int(tally[2]),
            good=int(tally[3]),
            status=status,
        )


def _drawn(network: ObservationNetwork, generator: np.random.Generator, disturbance: Disturbance) -> list[np.ndarray]:
    """Random numbers of one block of r runs.

    Standard normal ones of the parameters (r, p), the common scale (r, 1), the stations' scales (r, points) and the
    refraction (r, 1); then, for each group, noise (r, m) of its covariance and signs (r, m) of blunders, 0 for none.
    """
    sizes = (len(network.parameters), 1, len(network.points.names), 1)
    numbers = [generator.standard_normal((BLOCK, size)) for size in sizes]
    signs = []
    for group in network.groups:
        m, covariance = len(group.observed), group.covariance
        noise = generator.standard_normal((BLOCK, m))
        if covariance.ndim == 1:
            noise = noise * np.sqrt(covariance)
        else:
            b, n = (1, m) if covariance.ndim == 2 else covariance.shape[:2]
            factor = np.linalg.cholesky(covariance.reshape(b, n, n))
            noise = np.einsum("bij,rbj->rbi", factor, noise.reshape(BLOCK, b, n)).reshape(BLOCK, m)
        sign = np.zeros((BLOCK, m), dtype=np.int8)
        if disturbance.blunders > 0.0:
            bad = generator.random((BLOCK, m)) < disturbance.blunders
            sign = np.where(bad, generator.choice([-1, 1], (BLOCK, m)), 0).astype(np.int8)
        signs.append((noise, sign))
    return [*numbers, *(part for pair in signs for part in pair)]


def _rejections(solution: NetworkSolution, wrong: Sequence[np.ndarray]) -> np.ndarray:
    """Blunders rejected and all, good observations rejected and all, (4,)."""
    total = np.zeros(4, dtype=int)
    for fit, bad in zip(solution.fits, wrong, strict=True):
        out = ~fit.active
        total += [np.sum(bad & out), bad.sum(), np.sum(~bad & out), np.sum(~bad)]
    return total


def chunks(simulation: NetworkSimulation, runs: int) -> list[tuple[int, int]]:
    """First run and number of runs of each chunk, of `CHUNK_S` at least where there are enough.

    They depend on the network and on the number of runs, never on the machine or the processes.

    simulation   of a network
    runs         of all chunks
    """
    blocks = -(-runs // BLOCK)
    each = max(1, int(CHUNK_S / (seconds_per_run(simulation) * BLOCK)))
    number = -(-blocks // each)
    edges = [BLOCK * (blocks * k // number) for k in range(number)] + [runs]
    return [(low, high - low) for low, high in pairwise(edges)]


def seconds_per_run(simulation: NetworkSimulation) -> float:
    """Processor time of a run, s, within a factor of three, of a core of 2020.

    Fitted to 20 to 600 parameters; see `benchmarks/bench_plan.py`.
    """
    k = len(simulation.moving)
    rows = sum(len(g.observed) for g in simulation.network.groups)
    if simulation.in_batches:
        return 1e-4 + 3e-7 * rows + 6e-11 * k**3
    alone = 5e-3 + 2e-6 * rows + 2e-10 * min(k, LARGEST_DENSE_RUN) ** 3
    return alone * (SEARCH if simulation.disturbance.blunders > 0.0 else 1.0)


def scatter_of(simulation: NetworkSimulation, sums: RunSums) -> MonteCarloScatter:
    """Scatter of the runs, compared with the claimed uncertainties and the planned covariance.

    Raises EstimationError when no run converged.
    """
    if not sums.runs:
        raise EstimationError(f"none of {sums.asked} Monte Carlo runs converged: {sums.status}")
    points = simulation.network.points
    size = points.xyz.size
    full = np.zeros((2, size))
    placed = simulation.moving < size
    full[:, simulation.moving[placed]] = np.sqrt(np.stack([sums.squares, sums.claims])[:, placed] / sums.runs)
    rms, predicted = np.where(points.absent, np.nan, full.reshape(2, -1, 3))
    return MonteCarloScatter(
        runs=sums.runs,
        asked=sums.asked,
        rms=rms,
        predicted=predicted,
        ratio=(sums.ratios / sums.runs) ** 0.5,
        found=sums.rejected / sums.blunders if sums.blunders else float("nan"),
        false=sums.good_rejected / sums.good if sums.good else 0.0,
        covariance=covariance_test(sums.moments, sums.runs),
    )
