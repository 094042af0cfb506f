"""Recipe for a plan: predicted quality, worth of observations, further ranges, Monte Carlo."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from catseye.aliases import Progress
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork
from catseye.estimation.network.monte_carlo import Disturbance, MonteCarloScatter, scatter
from catseye.estimation.network.plan import Candidate, Plan, plan, schedule
from catseye.reduction.network.adjusted import AdjustedNetwork, adjusted_network
from catseye.reduction.network.treatment import AdjustmentOptions, treated
from catseye.verdict import Verdict

LARGEST_RATIO = 1.2  # largest acceptable departure over claim in the Monte Carlo


@dataclass(frozen=True)
class MonteCarloOptions:
    """Options of the Monte Carlo of a plan.

    runs         number of simulations; 0: none
    seed         of the generator
    air_ppm      standard deviation of a scale error of all ranges together
    station_ppm  the same for each ranger
    refraction   standard deviation of the coefficient of vertical refraction
    blunders     share of gross errors of 20 standard uncertainties; with them, wrong observations are rejected
    """

    runs: int = 0
    seed: int = 1
    air_ppm: float = 0.0
    station_ppm: float = 0.0
    refraction: float = 0.0
    blunders: float = 0.0


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
    def verdict(self) -> Verdict:
        """Verdict on the plan: every point determined and every observation checked."""
        return _verdict(self)


def planned(
    network: ObservationNetwork, options: PlanOptions | None = None, *, progress: Progress | None = None
) -> PlannedNetwork:
    """Network before it is measured.

    network    observed values are not used
    options    points of interest, time, Monte Carlo
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
        drawn = monte_carlo_scatter(found.solution.network, options.monte_carlo, progress=progress)
    return PlannedNetwork(adjusted_network(found.solution), found, picked, drawn)


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
    return Verdict("good", "every point would be determined and every observation checked by others")


def monte_carlo_scatter(
    network: ObservationNetwork, monte_carlo: MonteCarloOptions, *, progress: Progress | None = None
) -> MonteCarloScatter:
    """Monte Carlo simulation of a planned network; see `scatter`.

    It is measured many times with external errors, and adjusted each time.

    network       with its datum as it will be; its coordinates are the truth
    monte_carlo   number of simulations and their errors
    progress      called with (what, done, of how many)
    """
    o = monte_carlo
    disturbance = Disturbance(
        common_ppm=o.air_ppm, station_ppm=o.station_ppm, refraction=o.refraction, blunders=o.blunders
    )
    options = AdjustmentOptions(reject=o.blunders > 0.0)

    def solve(drawn: ObservationNetwork) -> NetworkSolution:
        return treated(drawn, options)[0]

    with threadpool_limits(limits=1, user_api="blas"):  # spinning pools make small matrices many times slower
        return scatter(network, solve, runs=o.runs, seed=o.seed, disturbance=disturbance, progress=progress)
