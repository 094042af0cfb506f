"""Recipe for a network: plain or robust adjustment, data snooping, variance components."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network, fits_near
from catseye.estimation.network.approximate.start import approximate
from catseye.estimation.network.cures import inflation_of, targets_of_ranges
from catseye.estimation.network.datum import with_datum
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.network.monte_carlo import Disturbance, MonteCarloScatter, scatter
from catseye.estimation.network.ranging_engine import RangingCovariance
from catseye.estimation.observations.kinds import Distances
from catseye.estimation.quality.reliability import observation_tests
from catseye.estimation.quality.robustness import (
    MOST_INFLATION,
    WEIGHTS,
    Rejection,
    RobustOptions,
    SnoopingOptions,
    estimate_robustly,
    snoop,
)
from catseye.estimation.quality.variance_components import Components, GroupFactors, RowModel, variance_components

FEW = 300  # points up to which a dense solution beside an existing one is the quickest
NEAR = 1e4  # variance factor of the plain solution up to which the search for wrong observations starts from it
START = (5e-5, 0.5 * PPM)  # of the constant and the scale part of a ranger, m and ratio: any positive start will do

Placed = tuple[
    tuple[str, ...], tuple[str, ...]
]  # names of points with approximate places, and of those on an assumed side


@dataclass(frozen=True, eq=False)
class AdjustedNetwork:
    """Network with its solution and the treatment of observations.

    solution     of the adjustment, with the treatment below
    treatment    "plain", "rejected", or the name of a robust method
    weights      one (m,) a group: share of its claimed weight that each observation has; 0 where left out
    rejected     one (m,) bool a group
    undecided    one (m,) bool a group: contradicted by others, undecidable which is wrong; almost no weight
    rejections   result of data snooping for each rejected observation
    components   estimated components of variance, on request
    notes        for the user, one line each
    likely       one (m,) bool a group: candidates of data snooping, one by one; all rejected ones where
                 observations were rejected or weighed
    """

    solution: NetworkSolution
    treatment: str
    weights: tuple[np.ndarray, ...]
    rejected: tuple[np.ndarray, ...]
    undecided: tuple[np.ndarray, ...]
    rejections: tuple[Rejection, ...] = ()
    components: Components | None = None
    notes: tuple[str, ...] = ()
    likely: tuple[np.ndarray, ...] = ()


def adjusted(
    network: ObservationNetwork,
    *,
    datum: str | None = None,
    reject: bool = False,
    robust: str | None = None,
    level: float = 0.05,
    components: str | None = None,
    progress: Progress | None = None,
) -> AdjustedNetwork:
    """Adjusted coordinates of a network.

    Every observation is used as claimed unless an argument says otherwise.

    network      from `records.network.any_file.read_network`
    datum        as `adjust_network`
    reject       leave out observations that the w test rejects, found from a robust start
    robust       or weigh each by an M-estimate: a key of `estimation.quality.robustness.WEIGHTS`
    level        of all tests together, for `reject`
    components   "rangers": estimate the constant and the ppm part of each ranger's claim; "groups": a factor a group

    Raises EstimationError for an unknown method, or where a network without an answer is to be treated.
    """
    if robust is not None and robust not in WEIGHTS:
        raise EstimationError(f"robust method {robust!r} is unknown (expected one of {', '.join(WEIGHTS)})")
    if components not in (None, "rangers", "groups"):
        raise EstimationError(f"variance components by {components!r} are unknown (expected rangers or groups)")
    network, placed = _placed(with_datum(network, datum))
    treated = reject or robust is not None or components is not None
    plain = replace(
        adjust_network(network, settings=NetworkSettings(diagnose=not treated)),
        approximate=placed[0],
        assumed=placed[1],
    )
    sizes = [len(g.observed) for g in network.groups]
    no_rows = tuple(np.zeros(m, dtype=bool) for m in sizes)
    result = AdjustedNetwork(plain, "plain", tuple(np.ones(m) for m in sizes), no_rows, no_rows, likely=no_rows)
    if not plain.answered:
        return result
    count, engine = 0, _engine(plain)
    near = plain.status == CONVERGED and plain.variance_factor < NEAR and not plain.replaced
    fast = fits_near(network, plain) if near and engine is None and len(network.points.names) < FEW else None

    def solve(inflation: Sequence[np.ndarray]) -> tuple[GroupFit, ...]:
        nonlocal count
        count += 1
        if progress is not None:
            progress("adjusting", count, 0)
        quick = None if fast is None else fast(inflation)
        if quick is not None:
            return quick
        return adjust_network(
            network, inflation=inflation, alone=True, settings=NetworkSettings(diagnose=False), engine=engine
        ).fits

    if not treated:
        return replace(result, likely=_likely(plain, solve, level))
    if robust is not None:
        estimate = estimate_robustly(
            solve, sizes, options=RobustOptions(method=robust), places=targets_of_ranges(network)
        )
        inflation = [1.0 / np.sqrt(np.maximum(w, MOST_INFLATION**-2)) for w in estimate.weights]
        solution = _final(network, inflation, placed, alone=True)
        notes = () if estimate.status == CONVERGED else (f"robust estimation {estimate.status}",)
        result = replace(
            result,
            solution=solution,
            treatment=robust,
            weights=estimate.weights,
            rejected=estimate.rejected,
            undecided=estimate.undecided,
            notes=notes,
        )
    elif reject:
        result = _with_rejections(network, solve, sizes, placed, level)
    if components is not None:
        result = _with_components(network, result, components, progress)
    return replace(result, likely=result.rejected)


def _likely(
    plain: NetworkSolution, solve: Callable[[Sequence[np.ndarray]], tuple[GroupFit, ...]], level: float
) -> tuple[np.ndarray, ...]:
    """Candidates that data snooping, one by one, would reject.

    From a plain adjustment; nothing is rejected here.
    """
    sizes = [len(fit.residual) for fit in plain.fits]
    tests = observation_tests(plain.fits, level=level)
    if not any(np.any(p < level) for p in tests.adjusted):
        return tuple(np.zeros(m, dtype=bool) for m in sizes)
    options = SnoopingOptions(level=level)
    if plain.status.usable:
        return snoop(solve, sizes, options=options, weigh=False).rejected
    start = estimate_robustly(solve, sizes, places=targets_of_ranges(plain.network))  # its tests are void
    return snoop(solve, sizes, options=options, start=start.rejected, doubtful=start.undecided, weigh=False).rejected


def _with_rejections(
    network: ObservationNetwork,
    solve: Callable[[Sequence[np.ndarray]], tuple[GroupFit, ...]],
    sizes: Sequence[int],
    placed: Placed,
    level: float,
) -> AdjustedNetwork:
    """Adjustment without observations that the w test rejects.

    By data snooping from a robust start.
    """
    start = estimate_robustly(solve, sizes, places=targets_of_ranges(network))
    chosen = snoop(solve, sizes, options=SnoopingOptions(level=level), start=start.rejected, doubtful=start.undecided)
    inflation = inflation_of(chosen.rejected, chosen.undecided)
    return AdjustedNetwork(
        solution=_final(network, inflation, placed, alone=True),
        treatment="rejected",
        weights=tuple(1.0 / np.square(i) for i in inflation),
        rejected=chosen.rejected,
        undecided=chosen.undecided,
        rejections=chosen.rejections,
        notes=() if chosen.status == CONVERGED else (f"rejection {chosen.status}",),
    )


def _placed(network: ObservationNetwork) -> tuple[ObservationNetwork, Placed]:
    """Network with approximate places, and the names of placed points."""
    if not network.points.unplaced.any():
        return network, ((), ())
    begin, nothing = approximate(network), not np.isfinite(network.points.xyz).any()
    parameters = tuple(replace(p, start=float(v)) for p, v in zip(network.parameters, begin.parameters, strict=True))
    points = replace(
        network.points, xyz=begin.xyz, datum=network.points.datum & (np.isfinite(network.points.xyz) | nothing)
    )
    return replace(network, points=points, parameters=parameters), (begin.found, begin.assumed)


def _engine(solution: NetworkSolution) -> str | None:
    """Engine for many intermediate solutions.

    The ranging one where it served, without a fallback to another.
    """
    return "ranging" if isinstance(solution.q, RangingCovariance) else None


def _final(
    network: ObservationNetwork, inflation: Sequence[np.ndarray], placed: Placed, *, alone: bool
) -> NetworkSolution:
    return replace(adjust_network(network, inflation=inflation, alone=alone), approximate=placed[0], assumed=placed[1])


def _with_components(
    network: ObservationNetwork, result: AdjustedNetwork, by: str, progress: Progress | None
) -> AdjustedNetwork:
    """Adjustment with estimated instead of claimed uncertainties.

    Rejected observations stay out.
    """
    placed = (result.solution.approximate, result.solution.assumed)
    out = [np.where(w > 0.5, 1.0, np.inf) for w in result.weights] if result.treatment == "rejected" else None
    count, engine = 0, _engine(result.solution)

    def scaled(scales: Sequence[np.ndarray]) -> tuple[GroupFit, ...]:
        nonlocal count
        count += 1
        if progress is not None:
            progress("estimating components", count, 0)
        used = scales if out is None else [s * o for s, o in zip(scales, out, strict=True)]
        return adjust_network(network, inflation=used, settings=NetworkSettings(diagnose=False), engine=engine).fits

    sizes = tuple(len(g.observed) for g in network.groups)
    if by == "groups":
        model: GroupFactors | RowModel = GroupFactors(tuple(g.name for g in network.groups), sizes)
    else:
        model = _ranger_model(network, result.solution)
    components = variance_components(scaled, model)
    inflation = model.scales(components.values)
    if out is not None:
        inflation = [s * o for s, o in zip(inflation, out, strict=True)]
    solution = _final(network, inflation, placed, alone=False)
    notes = result.notes
    if components.status != CONVERGED:
        notes = (*notes, f"variance components {components.status}")
    return replace(result, solution=solution, components=components, notes=notes)


def _ranger_model(network: ObservationNetwork, solution: NetworkSolution) -> RowModel:
    """Variance model sigma^2 = a^2 + (b D)^2 per ranging point.

    Over all groups of ranges; other groups as claimed.
    """
    ranging = [points_of(g)[0] if isinstance(g, Distances) and g.covariance.ndim == 1 else None for g in network.groups]
    used = [o for o in ranging if o is not None]
    if not used:
        raise EstimationError("variance components by rangers: no independent ranges (expected slope distances)")
    rangers = np.unique(np.concatenate(used))
    names = [network.points.names[i] for i in rangers]
    cofactors, columns, fixed = [], [], []
    for group, origin, fit in zip(network.groups, ranging, solution.fits, strict=True):
        m = len(group.observed)
        if origin is None:
            cofactors.append(np.zeros((m, 0)))
            columns.append(np.zeros(0, dtype=int))
            fixed.append(fit.sigma**2)
            continue
        k = np.searchsorted(rangers, origin)
        part = np.zeros((m, 2 * len(rangers)))
        part[np.arange(m), 2 * k] = 1.0
        part[np.arange(m), 2 * k + 1] = np.square(group.observed)
        cofactors.append(part)
        columns.append(np.arange(2 * len(rangers)))
        fixed.append(np.zeros(m))
    return RowModel(
        names=tuple(f"{what}^2 of {name}" for name in names for what in ("constant", "scale")),
        sigmas=tuple(f.sigma for f in solution.fits),
        cofactors=tuple(cofactors),
        columns=tuple(columns),
        start=np.tile(np.square(START), len(rangers)),
        fixed=tuple(fixed),
    )


def monte_carlo_scatter(
    network: ObservationNetwork,
    *,
    runs: int,
    seed: int,
    air_ppm: float = 0.0,
    station_ppm: float = 0.0,
    refraction: float = 0.0,
    blunders: float = 0.0,
    progress: Progress | None = None,
) -> MonteCarloScatter:
    """Monte Carlo simulation of a planned network; see `scatter`.

    It is measured many times with external errors, and adjusted each time.

    network      with its datum as it will be; its coordinates are the truth
    runs, seed   number of simulations, seed of the generator
    air_ppm      standard deviation of a scale error of all ranges together
    station_ppm  the same for each ranger
    refraction   standard deviation of the coefficient of vertical refraction
    blunders     share of gross errors of 20 standard uncertainties; with them, wrong observations are rejected
    """
    disturbance = Disturbance(common_ppm=air_ppm, station_ppm=station_ppm, refraction=refraction, blunders=blunders)

    def solve(drawn: ObservationNetwork) -> NetworkSolution:
        return adjusted(drawn, reject=blunders > 0.0).solution

    with threadpool_limits(limits=1, user_api="blas"):  # spinning pools make small matrices many times slower
        return scatter(network, solve, runs=runs, seed=seed, disturbance=disturbance, progress=progress)
