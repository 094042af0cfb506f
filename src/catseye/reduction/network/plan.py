"""Recipe for a plan: predicted quality, worth of observations, further ranges, Monte Carlo.

Source: [PARKER04] section 3.3 (errors before the measurement, weights).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.aliases import Progress
from catseye.errors import ArgumentError, EstimationError
from catseye.estimation.deformation.comparison import LARGEST
from catseye.estimation.deformation.deformation import detectable_displacement
from catseye.estimation.deformation.epoch_model import DatumConnection, EpochModel
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork
from catseye.estimation.network.monte_carlo import (
    Disturbance,
    MonteCarloScatter,
    NetworkSimulation,
    RunSums,
    chunks,
    scatter_of,
    seconds_per_run,
)
from catseye.estimation.network.plan import Candidate, Plan, plan, schedule
from catseye.estimation.quality.ellipsoid import weakest_direction
from catseye.processors import one_thread
from catseye.reduction.network.adjusted import AdjustedNetwork, adjusted_network
from catseye.reduction.network.treatment import AdjustmentOptions, treated
from catseye.verdict import Verdict

LARGEST_RATIO = 1.2  # largest acceptable departure over claim in the Monte Carlo
WORTH_PROCESSES_S = 3.0  # s, processor time of a Monte Carlo from which other processes save more than their start

Chunk = tuple[NetworkSimulation, int, int]  # its first run, and their number
RunChunks = Callable[[Sequence[Chunk]], Sequence[dict[str, object]]]  # `chunk_object` of each


@dataclass(frozen=True)
class MonteCarloOptions:
    """Options of the Monte Carlo of a plan.

    runs         number of simulations; 0: none
    seed         of the generator
    air_ppm      standard deviation of a scale error of all ranges together
    station_ppm  the same for each ranger
    refraction   standard deviation of the coefficient of vertical refraction
    blunders     share of gross errors of 20 standard uncertainties; with them, wrong observations are rejected

    Raises ArgumentError for a negative number of runs or seed.
    """

    runs: int = 0
    seed: int = 1
    air_ppm: float = 0.0
    station_ppm: float = 0.0
    refraction: float = 0.0
    blunders: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("runs", self.runs), ("seed", self.seed)):
            if value < 0:
                raise ArgumentError(f"{name} = {value} is invalid (expected 0 or more)", name)


@dataclass(frozen=True)
class PlanOptions:
    """Options of a plan.

    datum        as for an adjustment
    interest     points that matter, by name; None: all that are not held
    budget_s     time of every ranger for further ranges, s: gives a schedule
    shot_s       time of one range, s
    most         further ranges to list
    monte_carlo  options of the simulation
    """

    datum: str | None = None
    interest: Sequence[str] | None = None
    budget_s: float | None = None
    shot_s: float = 5.0
    most: int = 20
    monte_carlo: MonteCarloOptions = MonteCarloOptions()


@dataclass(frozen=True, eq=False)
class PlannedNetwork:
    """Network before it is measured.

    predicted   adjustment of the predicted observations
    plan        worth of the observations, and the candidates
    picked      schedule of additional ranges, empty without a time budget
    scatter     Monte Carlo scatter, if requested
    """

    predicted: AdjustedNetwork
    plan: Plan
    picked: tuple[Candidate, ...]
    scatter: MonteCarloScatter | None

    @property
    def weakest(self) -> np.ndarray:
        """Rows of the points, (k,), weakest first, without held ones."""
        order = np.argsort(-self.plan.weakest, kind="stable")
        return order[self.plan.weakest[order] > 0.0]

    @property
    def worth(self) -> np.ndarray:
        """Worth of every observation in table order, (m,) m."""
        offset = np.cumsum([0, *(len(w) for w in self.plan.worth)])
        return np.concatenate([np.zeros(0), *self.plan.worth])[
            offset[self.predicted.table.group] + self.predicted.table.row
        ]

    @cached_property
    def detectable(self) -> np.ndarray:
        """Smallest displacements, (n,) m, that a second epoch like this would show, in each point's weakest direction.

        By the congruence test of all points at 5 %, with power 80 %. nan for held points, for those that the others do
        not check, and for more than 700 points.
        """
        return _detectable(self.predicted.solution)

    @cached_property
    def weakest_motion(self) -> tuple[float, np.ndarray]:
        """Standard uncertainty, m, of the network's weakest direction, and the share (n,) of each point in it.

        A share is the length of the point's part of the unit vector over all coordinates.
        """
        solution, existing = self.predicted.solution, self.predicted.solution.network.points.existing
        columns = np.flatnonzero(existing.ravel())
        motion = np.zeros(existing.size)
        u, motion[columns] = weakest_direction(solution.q.within(columns))
        return u, np.linalg.norm(motion.reshape(-1, 3), axis=1)

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the plan: every point determined and every observation checked."""
        return _verdict(self)


def planned(
    network: ObservationNetwork,
    options: PlanOptions | None = None,
    *,
    run: RunChunks | None = None,
    apart: bool = False,
    progress: Progress | None = None,
) -> PlannedNetwork:
    """Network before it is measured.

    network    observed values are not used
    options    points of interest, time, Monte Carlo
    run, apart   as for `monte_carlo_scatter`
    progress   called with (what, done, of how many)

    Raises EstimationError where the network floats.
    """
    options = options or PlanOptions()
    found = plan(network, datum=options.datum, interest=options.interest, most=options.most)
    picked: tuple[Candidate, ...] = ()
    if options.budget_s is not None:
        picked = schedule(found, budget_s=options.budget_s, shot_s=options.shot_s)
    drawn = None
    if options.monte_carlo.runs:
        drawn = monte_carlo_scatter(found.solution, options.monte_carlo, run=run, apart=apart, progress=progress)
    return PlannedNetwork(adjusted_network(found.solution), found, picked, drawn)


def _detectable(solution: NetworkSolution) -> np.ndarray:
    """Detectable displacements between two equal epochs; nan without a test."""
    names = solution.network.points.names
    undefined = np.full(len(names), np.nan)
    if len(names) > LARGEST:
        return undefined
    try:
        connection = DatumConnection.of(solution, solution, None, 0.0)
        model = EpochModel.of(solution, solution, names, connection)
        return detectable_displacement(model.epochs(np.arange(len(names))), datum=connection.datum)[0]
    except EstimationError:  # nothing to compare: every coordinate is held, or none is redundant
        return undefined


def _verdict(planned: PlannedNetwork) -> Verdict:
    predicted = planned.predicted
    if not predicted.answered:
        return Verdict("failed", predicted.solution.status)
    alone = int(np.isinf(planned.worth).sum())
    if alone:
        return Verdict("doubtful", f"{alone} observations are indispensable: losing one leaves a point undetermined")
    unchecked = int(np.sum(~predicted.table.checked))
    if unchecked:
        return Verdict("doubtful", f"an error in {unchecked} of {len(predicted.table)} observations would not show")
    if planned.scatter is not None and planned.scatter.ratio > LARGEST_RATIO:
        ratio = planned.scatter.ratio
        return Verdict("doubtful", f"in the Monte Carlo the departures are {ratio:.2f} times the claimed uncertainties")
    if planned.scatter is not None and planned.scatter.normal and planned.scatter.covariance.excess > LARGEST_RATIO:
        test = planned.scatter.covariance
        return Verdict(
            "doubtful",
            f"in the Monte Carlo the departures along one combination of the coordinates are {test.largest:.2f} times "
            f"the claim (by chance up to {test.by_chance:.2f})",
        )
    return Verdict("good", "every point would be determined and every observation checked by others")


def monte_carlo_scatter(
    solution: NetworkSolution,
    monte_carlo: MonteCarloOptions,
    *,
    run: RunChunks | None = None,
    apart: bool = False,
    progress: Progress | None = None,
) -> MonteCarloScatter:
    """Monte Carlo simulation of a planned network, measured many times with external errors and adjusted each time.

    solution      of the network with its predicted observations; its coordinates are the truth
    monte_carlo   number of simulations and their errors
    run           runs chunks elsewhere; None: here, one after the other
    apart         True: elsewhere, however short
    progress      called with (what, done, of how many)

    The result depends on the options and the network, not on where or in which order chunks run. Raises
    EstimationError when no run converges.
    """
    o = monte_carlo
    disturbance = Disturbance(
        common_ppm=o.air_ppm, station_ppm=o.station_ppm, refraction=o.refraction, blunders=o.blunders
    )
    simulation = NetworkSimulation.of(solution, seed=o.seed, disturbance=disturbance)
    parts = chunks(simulation, o.runs)
    if run is not None and (apart or o.runs * seconds_per_run(simulation) > WORTH_PROCESSES_S):
        found = [RunSums.from_object(content) for content in run([(simulation, *part) for part in parts])]
    else:
        found = [_chunk_sums(simulation, *part, progress=_part_of(progress, part[0], o.runs)) for part in parts]
    return scatter_of(simulation, sum(found[1:], found[0]))


def chunk_object(simulation: NetworkSimulation, first: int, count: int) -> dict[str, object]:
    """Sums over some runs as an object for JSON, computed in any process.

    simulation   of a network
    first        run
    count        of runs
    """
    return _chunk_sums(simulation, first, count).to_object()


def _chunk_sums(simulation: NetworkSimulation, first: int, count: int, *, progress: Progress | None = None) -> RunSums:
    options = AdjustmentOptions(reject=simulation.disturbance.blunders > 0.0)

    def solve(drawn: ObservationNetwork) -> NetworkSolution:
        return treated(drawn, options)[0]

    with one_thread():  # spinning pools make small matrices many times slower
        return simulation.run(first, count, solve, progress)


def _part_of(progress: Progress | None, before: int, runs: int) -> Progress | None:
    """Progress over all runs, of a chunk that begins after some."""
    if progress is None:
        return None
    return lambda what, done, _: progress(what, before + done, runs)
