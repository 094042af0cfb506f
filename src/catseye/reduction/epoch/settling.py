"""An adjustment repeated until it settles: cycles, air and strengths renewed, explanations judged."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution, SolverSettings, adjust
from catseye.estimation.least_squares.bordered import Border
from catseye.estimation.least_squares.patterns import Patterns, record_price
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.observations.kinds import Linear, ObservationGroup
from catseye.reduction.epoch.allowance import Allowance, AllowanceReason, for_families, for_the_air
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.dish import dish_prior
from catseye.reduction.epoch.motion.scatter import sway_variance
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.prior_names import (
    BENCHMARKS,
    MONUMENTS,
    OFFSETS,
    SOUND,
    THERMOMETERS,
    TRIPLET_BALLS,
    UNJUDGED,
    ZEROS,
)
from catseye.reduction.epoch.record_tests import EpochRecords, Findings, findings_of, innocent_of
from catseye.reduction.epoch.self_check import self_checks, sortings
from catseye.reduction.epoch.shots import ShotGroup, ShotParts, shot_group
from catseye.reduction.epoch.sway import with_sway
from catseye.reduction.epoch.unknowns import CampaignNetwork, rebuilt

PASSES = 6  # cap of passes in which cycles, incidence and air are renewed from the adjusted coordinates
FIRST = 3  # passes that the first takes as long as, more
TESTED = 2  # passes that search for wrong shots; later ones keep the choice, so that it cannot swing to and fro
SEARCHED_C = 1.0  # °C, standard uncertainty of a thermometer's offset while wrong shots are searched for first
RECORDS = (MONUMENTS, OFFSETS, BENCHMARKS, TRIPLET_BALLS, ZEROS, THERMOMETERS, SOUND)  # down-weighted at first
JUDGED = 6  # times that what an adjustment says is judged, and adjusted again with what is allowed for
STRENGTHENED = 2  # passes that look how strong the processes are; later ones keep the strengths
SETTLED = 1e-6  # m, no coordinate moves further in the last pass,
SETTLED_U = 0.02  # or than this share of its standard uncertainty: what is linearised there changes by its square
UNSUSPICIOUS = 1.5  # variance factor, beyond which somebody is wrong though none stands out


class SettledNetwork(NamedTuple):
    """An adjustment that has settled.

    network    with the strengths of its processes as they came out
    solution   of all parameters
    shots      of each ranger, as last seen
    """

    network: CampaignNetwork
    solution: LeastSquaresSolution
    shots: list[tuple[ShotGroup, ShotParts]]


def first_adjustment(
    network: CampaignNetwork, starts: Mapping[str, np.ndarray], progress: Progress | None = None
) -> SettledNetwork:
    """A campaign's first adjustment; without rival explanations of wrong shots where these leave too many in.

    Raises EstimationError or InputError where it finds no answer.
    """
    try:
        return iterate_adjustment(network, starts, progress)
    except (EstimationError, InputError):
        if network.allowance.searched:
            raise
        return iterate_adjustment(_of_shots_alone(network), starts, progress)


def _of_shots_alone(network: CampaignNetwork) -> CampaignNetwork:
    """Network whose misfit is explained by wrong shots alone, as long as these explain it."""
    return replace(network, allowance=replace(network.allowance, searched=True, sway={}))


def judged_network(first: SettledNetwork, progress: Progress | None = None) -> SettledNetwork:
    """A campaign's adjustment, repeated with what its own tests ask for.

    Where records were found wrong, the same is tried with wrong shots alone, and the cheaper of both explanations
    stays: each rejected shot and each error of a record has its price.

    Raises EstimationError where it finds no answer.
    """
    explained = _judged(first, progress)
    if not explained.network.allowance.contradictions:
        return explained
    try:
        plain = _judged(iterate_adjustment(_of_shots_alone(first.network), _places(first), progress), progress)
    except (EstimationError, InputError):
        return explained
    return plain if _cost(plain) < _cost(explained) else explained


def _judged(settled: SettledNetwork, progress: Progress | None) -> SettledNetwork:
    for _ in range(JUDGED):
        allowance, before = allowed(settled), settled.network.allowance
        settled = settled._replace(network=replace(settled.network, allowance=allowance))
        if allowance.same(before):
            break
        network = rebuilt(settled.network)
        anew = allowance.errors.keys() != before.errors.keys() or allowance.searched != before.searched
        active = None if anew else selection_of(settled, network)
        try:
            settled = iterate_adjustment(network, _places(settled), progress, active=active)
        except (EstimationError, InputError):
            tried = allowance.errors.keys() - before.errors.keys()
            if tried:
                settled = settled._replace(network=replace(settled.network, allowance=before.refusing(tried)))
            elif before.errors.keys() - allowance.errors.keys():  # what was taken back as innocent is needed
                return settled._replace(network=replace(settled.network, allowance=before))
            else:
                raise
    return settled


def _places(settled: SettledNetwork) -> dict[str, np.ndarray]:
    """Points as adjusted, to begin there again."""
    network, solution, _ = settled
    return {name: solution.x[network.layout.columns(name)] for name in network.places}


def _cost(settled: SettledNetwork) -> float:
    """Weighted sum of squares, and the prices of rejected shots and of wrong records."""
    network, solution, shots = settled
    rejected = sum(int(np.count_nonzero(~fit.active)) for fit in solution.fits[: len(shots)])
    records = sum(record_price(len(c.explanations[0].errors)) for c in network.allowance.contradictions)
    wider = sum(_widening(network, part, fit.active) for (_, part), fit in zip(shots, solution.fits, strict=False))
    return sum(fit.pvv for fit in solution.fits) + wider + network.settings.critical**2 * rejected + records


def _widening(network: CampaignNetwork, part: ShotParts, active: np.ndarray) -> float:
    """Price of the variance that a sway adds to one ranger's used shots: the logarithm of its likelihood."""
    body, bodies = part.sight.bodies
    added = part.sight.index**2 * sway_variance(body, bodies, network.allowance.sway)
    return float(np.sum(np.log(part.variance / (part.variance - added))[active]))


def iterate_adjustment(
    network: CampaignNetwork,
    starts: Mapping[str, np.ndarray],
    progress: Progress | None = None,
    *,
    keep: float = 0.0,
    predicted: bool = False,
    active: list[np.ndarray] | None = None,
) -> SettledNetwork:
    """The adjustment repeated until cycles, incidence and air no longer change, with the shots as last seen.

    network   with priors for whatever its shots do not hold
    starts    point: (3,) m, where to begin instead of the layout's start
    keep      m, added to what counts as settled: an epoch that is one of many need not be settled to a micrometre
    active    selection to begin with, of the shots and what follows: no wrong ones are searched for from the start
    predicted the priors know where everything is to a few of the shots' sigmas: wrong shots are searched for only where
              one stands out, since none can hide behind another

    Raises EstimationError where it finds no answer.
    """
    network = _holding_unseen(network)
    layout = network.layout
    x = np.array(layout.start)
    for name, where in starts.items():
        if name in layout.points:
            x[layout.columns(name)] = where
    points = [layout.columns(name) for name in network.places if name in layout.points]
    coordinates = np.concatenate(points)
    bodies = [i for i, p in enumerate(layout.parameters) if p.kind is ParameterKind.BODY]
    advice: list[Linear] = []
    border = network.border  # one, whatever strengths: it remembers the last elimination
    u = np.full(len(coordinates), np.inf)
    state: _Pass | None = None
    for turn in range(PASSES):
        if progress is not None:
            progress("adjustment", min(turn + FIRST * (turn > 0), PASSES - 1), PASSES)
        before, state = x, None  # its covariance is large
        adjusted = partial(
            _adjusted,
            x=x,
            search=OutlierSearch(points, advice, critical=network.settings.critical, settled=bodies, doubtful=RECORDS),
            border=border,
            turn=turn,
            predicted=predicted,
            active=active,
        )
        state = adjusted(network)
        if not (turn or predicted or active):
            network, state = with_sway(network, state, adjusted)
        solution, predicted = state.solution, state.predicted
        x, active = solution.x, [f.active for f in solution.fits]
        if not turn:
            advice = dish_prior(network, x, solution.q)
        steady = True
        if turn < STRENGTHENED:
            strength = network.processes.estimated(solution, network.strength, [p.distance for _, p in state.shots])
            steady = strength.near(network.strength)
            network = network if steady else network.with_strength(strength)
        if turn < TESTED:
            u = np.sqrt(solution.q.diagonal()[coordinates])
        moved = np.abs(x - before)[coordinates]
        if turn and steady and np.all(moved < np.maximum(SETTLED + keep, SETTLED_U * u)):
            break
        del solution  # the same
    else:
        raise _unsettled(layout.parameters[coordinates[np.argmax(moved)]], float(moved.max()))
    if not state.complete:
        solution = _plain(state.groups, network, x, active, SolverSettings(border=border))
    if progress is not None:
        progress("adjustment", PASSES, PASSES)
    shots = [shot_group(network.seen_from(name), name, solution.x) for name in network.rangers]  # as they are told
    return SettledNetwork(network, solution, shots)


class _Pass(NamedTuple):
    """One adjustment of several.

    groups      shots and priors
    shots       of each ranger
    complete    it has all tests and the covariance, as good as they can be
    predicted   no wrong shot had to be searched for
    """

    solution: LeastSquaresSolution
    groups: list[ObservationGroup]
    shots: list[tuple[ShotGroup, ShotParts]]
    complete: bool
    predicted: bool


def _adjusted(
    network: CampaignNetwork,
    *,
    x: np.ndarray,
    search: OutlierSearch,
    border: Border | None,
    turn: int,
    predicted: bool,
    active: list[np.ndarray] | None,
) -> _Pass:
    """The adjustment of one pass from x; the first ones search for wrong shots, later ones want no tests."""
    shots = [shot_group(network.seen_from(name), name, x) for name in network.rangers]
    shared = [part.shared_errors for _, part in shots]
    search = replace(search, shared=shared, rivals=_rivals(network, shots))
    searching = not turn and not predicted and active is None
    priors = [_while_searching(p, network) for p in network.priors] if searching else network.priors
    groups: list[ObservationGroup] = [*(group for group, _ in shots), *priors]
    removable = [np.full(len(g.observed), i < len(shots)) for i, g in enumerate(groups)]
    solver = SolverSettings(border=border, tests=turn < TESTED)
    if turn >= TESTED:
        return _Pass(_plain(groups, network, x, active, solver), groups, shots, complete=False, predicted=predicted)
    layout = network.layout
    free, names = np.array(layout.free), layout.names
    if predicted and (active is None or all(a.all() for a in active)):
        solution = adjust(x, groups, free=free, names=names, solver=solver)
        if _unsuspicious(solution, removable, search.critical):
            return _Pass(solution, groups, shots, complete=True, predicted=True)
        active = None
        del solution  # its covariance is large
    solution = adjust_robustly(
        x, groups, removable, outliers=search, free=free, active=active, names=names, border=border
    )
    return _Pass(solution.require_converged(), groups, shots, complete=border is None, predicted=False)


def _plain(
    groups: list[ObservationGroup],
    network: CampaignNetwork,
    x: np.ndarray,
    active: list[np.ndarray] | None,
    solver: SolverSettings,
) -> LeastSquaresSolution:
    """The adjustment of a selection that stays; EstimationError where it finds no answer."""
    layout = network.layout
    free = np.array(layout.free)
    return adjust(x, groups, free=free, active=active, names=layout.names, solver=solver).require_converged()


def _while_searching(prior: ObservationGroup, network: CampaignNetwork) -> ObservationGroup:
    """A prior as the first search has it: thermometers that may be wrong are loose, not as wrong as no air could be."""
    if prior.name != THERMOMETERS or not isinstance(prior, Linear):
        return prior
    owners = [network.layout.parameters[c] for c in np.ravel(prior.columns).tolist()]
    loose = np.array([owner not in network.allowance.held for owner in owners])
    return replace(prior, covariance=np.where(loose, np.maximum(prior.covariance, SEARCHED_C**2), prior.covariance))


def _holding_unseen(network: CampaignNetwork) -> CampaignNetwork:
    """The network that keeps the priors of thermometers whose air no certified path crosses.

    Nothing else knows a scale: what the ranges seem to say of such a thermometer is what the air does that the model
    does not know.
    """
    air, targets = network.field, network.campaign.shots.target
    fired = {(name, targets[k]) for name in network.rangers for k in network.electronics[name].shots}
    marks = [b for b in network.campaign.benchmarks if (b.ranger, b.target) in fired]
    heights = [0.5 * (network.places[b.ranger].start[2] + network.places[b.target].start[2]) for b in marks]
    seen = air.seen_from(np.array(heights))
    unseen = {Parameter(ParameterKind.THERMOMETER, s) for s, on in zip(air.stations, seen, strict=True) if not on}
    return replace(network, allowance=replace(network.allowance, held=network.allowance.held | unseen))


def _rivals(
    network: CampaignNetwork, shots: Sequence[tuple[ShotGroup, ShotParts]]
) -> Callable[[Sequence[ObservationGroup], LeastSquaresSolution], Patterns] | None:
    """Patterns of wrong records, which explain a misfit instead of wrong shots; None where they did not."""
    if network.allowance.searched:
        return None

    def rivals(_: Sequence[ObservationGroup], solution: LeastSquaresSolution) -> Patterns:
        records = EpochRecords(network, solution, shots)
        return records.patterns(records.suspected())

    return rivals


def _unsettled(worst: Parameter, moved: float) -> EstimationError:
    return EstimationError(
        f"not settled: cycles, air and incidence still move {worst} by {moved / MILLIMETRE:.3f} mm after {PASSES} "
        "passes; check its typed position"
    )


def _unsuspicious(solution: LeastSquaresSolution, removable: Sequence[np.ndarray], critical: float) -> bool:
    """True if every removable observation passes its test by half a sigma, and all together theirs."""
    if not solution.solved or solution.status != CONVERGED:
        return False
    large = [np.abs(f.standardised[may]) > critical - 0.5 for f, may in zip(solution.fits, removable, strict=True)]
    factor, _ = solution.variance_factor([f.name for f in solution.fits if f.name not in UNJUDGED])
    return not any(each.any() for each in large) and factor < UNSUSPICIOUS


def selection_of(settled: SettledNetwork, network: CampaignNetwork) -> list[np.ndarray]:
    """Selection for another network with the same shots: those that took part in a settled one."""
    count = len(settled.shots)
    shots = [fit.active for fit in settled.solution.fits[:count]]
    return [*shots, *(np.ones(len(prior.observed), dtype=bool) for prior in network.priors)]


def allowed(settled: SettledNetwork) -> Allowance:
    """Allowance after an adjustment: records records, explanations judged, residuals averaged."""
    network, solution, shots = settled
    air, layout, allowance = network.field, network.layout, network.allowance
    records = EpochRecords(network, _with_all_records(settled), shots)
    if innocent := innocent_of(records):
        return allowance.acquitting(innocent)
    findings = findings_of(records)
    if findings.errors:
        return allowance.explained(findings.contradictions, findings.errors)
    if not allowance.searched and _stopped(settled):
        return replace(allowance, searched=True, reasons=(*allowance.reasons, *_impossible(findings)))
    named = {
        Parameter(ParameterKind.THERMOMETER, k.of) for k in allowance.errors if k.group is RecordGroup.THERMOMETERS
    }
    allowance = for_the_air(allowance, air, solution, layout.air, dropped=named)
    own = {name: network.electronics[name].shots for name in network.rangers}
    lines = [(p.name, p.electronics.shots, 1.0 + p.refractivity, p.distance) for _, p in shots]
    groups = [*(g for g, _ in shots), *network.priors]
    sorts = sortings(network.campaign, network.places, own)
    return for_families(allowance, self_checks(groups, solution, sorts, lines))


def _with_all_records(settled: SettledNetwork) -> LeastSquaresSolution:
    """Solution with the records that the search for wrong shots left out, and the shots that it left in."""
    network, solution, shots = settled
    fits = solution.fits
    if all(fit.active.all() for fit in fits[len(shots) :]):
        return solution
    active = [fit.active if k < len(shots) else np.ones_like(fit.active) for k, fit in enumerate(fits)]
    groups = [*(group for group, _ in shots), *network.priors]
    return _plain(groups, network, solution.x, active, SolverSettings(border=network.border))


def _stopped(settled: SettledNetwork) -> bool:
    """True where shots are used that a test would leave out: a wrong record seemed to explain them."""
    critical = settled.network.settings.critical
    fits = settled.solution.fits[: len(settled.shots)]
    return any(bool(np.any(fit.active & (np.abs(fit.standardised) > critical))) for fit in fits)


def _impossible(findings: Findings) -> list[AllowanceReason]:
    """Reason where nothing but an impossible error explains the misfit."""
    if findings.impossible is None:
        return []
    text = (
        f"only an error that such a record cannot have would explain the misfit: {findings.impossible.text}; the "
        "record is kept, and something else departs from the model"
    )
    return [AllowanceReason(text)]
