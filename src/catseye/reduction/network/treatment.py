"""Treatment of a network's observations: plain, robust, data snooping, variance components."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.errors import ArgumentError, EstimationError
from catseye.estimation.least_squares.adjustment import COMPLETE, GroupFit, SolverSettings
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome, Status
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network, fits_near
from catseye.estimation.network.approximate.start import approximate
from catseye.estimation.network.cures import inflation_of, targets_of_ranges
from catseye.estimation.network.datum import with_datum
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
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
from catseye.reduction.network.observations import MDB_LEVEL, MDB_POWER, Detectability

FEW = 300  # points up to which a dense solution beside an existing one is the quickest
NEAR = 1e4  # variance factor of the plain solution up to which the search for wrong observations starts from it
START = (5e-5, 0.5 * PPM)  # of the constant and the scale part of a ranger, m and ratio: any positive start will do

Placed = tuple[
    tuple[str, ...], tuple[str, ...]
]  # names of points with approximate places, and of those on an assumed side


@dataclass(frozen=True)
class AdjustmentOptions:
    """Options of an adjustment.

    datum        "free": inner constraints on the marked points; "fixed": marked points held; None: as the file marks it
    reject       leave out observations that the w test rejects, found from a robust start
    robust       or weigh each by an M-estimate: a key of `estimation.quality.robustness.WEIGHTS`
    components   "rangers": estimate the constant and the ppm part of each ranger's claim; "groups": a factor a group
    scale_by_variance_factor   multiply covariances by the variance factor; tau tests
    level        of all tests of single observations together, and of the chi-square test
    power        probability with which the test of one observation finds an error of the size of its mdb
    mdb_level    level of that test
    relative     pairs of points whose relative ellipsoid is wanted
    solver       settings of every solution, whatever the treatment

    Raises EstimationError for an unknown method, ArgumentError for a level or a power that is no probability and for
    both of `reject` and `robust`.
    """

    datum: str | None = None
    reject: bool = False
    robust: str | None = None
    components: str | None = None
    scale_by_variance_factor: bool = False
    level: float = 0.05
    power: float = MDB_POWER
    mdb_level: float = MDB_LEVEL
    relative: Sequence[tuple[str, str]] = ()
    solver: SolverSettings = COMPLETE

    def __post_init__(self) -> None:
        if self.reject and self.robust is not None:
            raise ArgumentError("robust cannot go with reject: either weigh or leave out", "robust", "reject")
        if not 0.0 < self.level < 1.0:
            raise ArgumentError(f"level = {self.level:g} is invalid (expected a probability between 0 and 1)", "level")
        _ = self.detectability
        if self.robust is not None and self.robust not in WEIGHTS:
            raise EstimationError(f"robust method {self.robust!r} is unknown (expected one of {', '.join(WEIGHTS)})")
        if self.components not in (None, "rangers", "groups"):
            raise EstimationError(
                f"variance components by {self.components!r} are unknown (expected rangers or groups)"
            )

    @cached_property
    def detectability(self) -> Detectability:
        """Level and power of the minimal detectable biases."""
        return Detectability(self.mdb_level, self.power)

    @property
    def treats(self) -> bool:
        """True if observations are not used as claimed."""
        return self.reject or self.robust is not None or self.components is not None


@dataclass(frozen=True, eq=False)
class Treatment:
    """Treatment of a network's observations.

    method       "plain", "rejected", or the name of a robust method
    weights      one (m,) a group: share of its claimed weight that each observation has; 0 where left out
    rejected     one (m,) bool a group
    undecided    one (m,) bool a group: contradicted by others, undecidable which is wrong; almost no weight
    rejections   result of data snooping for each rejected observation
    components   estimated components of variance, on request: of "rangers" a constant, m², and a scale, ratio², each
    components_by   "rangers" or "groups"; None without
    notes        for the user, one line each
    likely       one (m,) bool a group: candidates of data snooping, one by one; all rejected ones where
                 observations were rejected or weighed
    """

    method: str
    weights: tuple[np.ndarray, ...]
    rejected: tuple[np.ndarray, ...]
    undecided: tuple[np.ndarray, ...]
    rejections: tuple[Rejection, ...] = ()
    components: Components | None = None
    components_by: str | None = None
    notes: tuple[str, ...] = ()
    likely: tuple[np.ndarray, ...] = ()

    @classmethod
    def plain(cls, sizes: Sequence[int]) -> "Treatment":
        """Every observation of groups of these sizes as claimed."""
        nothing = tuple(np.zeros(m, dtype=bool) for m in sizes)
        weights = tuple(np.ones(m) for m in sizes)
        return cls(method="plain", weights=weights, rejected=nothing, undecided=nothing, likely=nothing)


Solve = Callable[[Sequence[np.ndarray]], tuple[GroupFit, ...]]


def treated(
    network: ObservationNetwork, options: AdjustmentOptions, *, progress: Progress | None = None
) -> tuple[NetworkSolution, Treatment]:
    """Solution of a network, and the treatment of its observations.

    network    from `records.network.any_file.read_network`
    options    every observation is used as claimed unless they say otherwise
    progress   called with (what, done, of how many)

    Raises EstimationError where a network without an answer is to be treated.
    """
    network, placed = _placed(with_datum(network, options.datum))
    settings = NetworkSettings(options.solver, diagnose=not options.treats)
    plain = replace(adjust_network(network, settings=settings), approximate=placed[0], assumed=placed[1])
    sizes = [len(g.observed) for g in network.groups]
    treatment = Treatment.plain(sizes)
    if not plain.answered:
        return plain, treatment
    solve = _solver(network, plain, options, progress)
    if not options.treats:
        return plain, replace(treatment, likely=_likely(plain, solve, options.level))
    solution = plain
    if options.robust is not None or options.reject:
        inflation, treatment = (
            _weighed(network, solve, sizes, options.robust)
            if options.robust is not None
            else _with_rejections(network, solve, sizes, options.level)
        )
        solution = _final(network, inflation, placed, options, alone=True)
    if options.components is not None:
        solution, treatment = _with_components(network, solution, treatment, options, progress)
    return solution, replace(treatment, likely=treatment.rejected)


def _solver(
    network: ObservationNetwork, plain: NetworkSolution, options: AdjustmentOptions, progress: Progress | None
) -> Solve:
    """Function that adjusts a network with inflated sigmas."""
    count, engine = 0, _engine(plain)
    near = plain.status == CONVERGED and plain.variance_factor < NEAR and not plain.replaced
    small = near and engine is None and len(network.points.names) < FEW
    fast = fits_near(network, plain, options.solver) if small else None
    settings = NetworkSettings(options.solver, diagnose=False)

    def solve(inflation: Sequence[np.ndarray]) -> tuple[GroupFit, ...]:
        nonlocal count
        count += 1
        if progress is not None:
            progress("adjusting", count, 0)
        quick = None if fast is None else fast(inflation)
        if quick is not None:
            return quick
        return adjust_network(network, inflation=inflation, alone=True, settings=settings, engine=engine).fits

    return solve


def _weighed(
    network: ObservationNetwork, solve: Solve, sizes: Sequence[int], method: str
) -> tuple[Sequence[np.ndarray], Treatment]:
    """Inflation of the observations by an M-estimate, and the treatment."""
    estimate = estimate_robustly(solve, sizes, options=RobustOptions(method=method), places=targets_of_ranges(network))
    inflation = [1.0 / np.sqrt(np.maximum(w, MOST_INFLATION**-2)) for w in estimate.weights]
    return inflation, Treatment(
        method=method,
        weights=estimate.weights,
        rejected=estimate.rejected,
        undecided=estimate.undecided,
        notes=() if estimate.status == CONVERGED else (f"robust estimation {estimate.status}",),
    )


def _likely(plain: NetworkSolution, solve: Solve, level: float) -> tuple[np.ndarray, ...]:
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
    network: ObservationNetwork, solve: Solve, sizes: Sequence[int], level: float
) -> tuple[Sequence[np.ndarray], Treatment]:
    """Inflation that leaves out what the w test rejects.

    By data snooping from a robust start; with the treatment.
    """
    start = estimate_robustly(solve, sizes, places=targets_of_ranges(network))
    chosen = snoop(solve, sizes, options=SnoopingOptions(level=level), start=start.rejected, doubtful=start.undecided)
    inflation = inflation_of(chosen.rejected, chosen.undecided)
    return inflation, Treatment(
        method="rejected",
        weights=tuple(1.0 / np.square(i) for i in inflation),
        rejected=chosen.rejected,
        undecided=chosen.undecided,
        rejections=chosen.rejections,
        notes=_rejection_notes(chosen.status),
    )


def _rejection_notes(status: Status) -> tuple[str, ...]:
    """Note on a search for wrong observations; the treatment itself names those that contradict each other."""
    if status == CONVERGED:
        return ()
    if status.outcome is AdjustmentOutcome.UNDECIDED:
        loose = f"are held loosely, with their uncertainties times {MOST_INFLATION:.0f} or more"
        return (
            f"which of the contradicting observations are wrong is undecided; points that only they determine {loose}",
        )
    return (f"rejection {status}",)


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
    network: ObservationNetwork,
    inflation: Sequence[np.ndarray],
    placed: Placed,
    options: AdjustmentOptions,
    *,
    alone: bool,
) -> NetworkSolution:
    settings = NetworkSettings(options.solver)
    solution = adjust_network(network, inflation=inflation, alone=alone, settings=settings)
    return replace(solution, approximate=placed[0], assumed=placed[1])


def _with_components(
    network: ObservationNetwork,
    solution: NetworkSolution,
    treatment: Treatment,
    options: AdjustmentOptions,
    progress: Progress | None,
) -> tuple[NetworkSolution, Treatment]:
    """Adjustment with estimated instead of claimed uncertainties.

    Rejected observations stay out.
    """
    placed = (solution.approximate, solution.assumed)
    out = [np.where(w > 0.5, 1.0, np.inf) for w in treatment.weights] if treatment.method == "rejected" else None
    count, engine = 0, _engine(solution)
    settings = NetworkSettings(options.solver, diagnose=False)

    def scaled(scales: Sequence[np.ndarray]) -> tuple[GroupFit, ...]:
        nonlocal count
        count += 1
        if progress is not None:
            progress("estimating components", count, 0)
        used = scales if out is None else [s * o for s, o in zip(scales, out, strict=True)]
        return adjust_network(network, inflation=used, settings=settings, engine=engine).fits

    sizes = tuple(len(g.observed) for g in network.groups)
    if options.components == "groups":
        model: GroupFactors | RowModel = GroupFactors(tuple(g.name for g in network.groups), sizes)
    else:
        model = _ranger_model(network, solution)
    components = variance_components(scaled, model)
    inflation = model.scales(components.values)
    if out is not None:
        inflation = [s * o for s, o in zip(inflation, out, strict=True)]
    notes = treatment.notes
    if components.status != CONVERGED:
        notes = (*notes, f"variance components {components.status}")
    final = _final(network, inflation, placed, options, alone=False)
    return final, replace(treatment, components=components, components_by=options.components, notes=notes)


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
