"""From phases to coordinates: one adjustment of points, ranger zeros, leakage, air and prism normals together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE, PPM, SPEED_OF_LIGHT
from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.adjustment import (
    CONVERGED,
    GroupFit,
    LeastSquaresSolution,
    SolverSettings,
    adjust,
)
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.least_squares.robust import CHECKED, OutlierSearch, adjust_robustly
from catseye.estimation.observations.kinds import Linear, ObservationGroup
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.allowance import DOUBTED_C, Allowance, for_families, for_the_air, refused
from catseye.reduction.epoch.cycles import KEPT, MANY, Resolved, line_errors, resolve_cycles, without_shots
from catseye.reduction.epoch.dish import dish_advice
from catseye.reduction.epoch.head import head_unknowns
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases, Progress
from catseye.reduction.epoch.reason import Reason
from catseye.reduction.epoch.self_check import self_checks, sortings
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import ShotGroup, ShotParts, shot_group
from catseye.reduction.epoch.strengths import ProcessStrength
from catseye.reduction.epoch.unknowns import (
    APPROXIMATE,
    HEADS,
    SOUND,
    THERMOMETERS,
    WEAK,
    ZEROS,
    CampaignNetwork,
    build_network,
)
from catseye.reduction.site.places import RangedPoint

PASSES = 6  # cap of passes in which cycles, incidence and air are renewed from the adjusted coordinates
FIRST = 3  # passes that the first takes as long as, more
TESTED = 2  # passes that search for wrong shots; later ones keep the choice, so that it cannot swing to and fro
SEARCHED_C = 1.0  # °C, standard uncertainty of a thermometer's offset while wrong shots are searched for first
JUDGED = 3  # times that what an adjustment says is judged, and adjusted again with what is allowed for
STRENGTHENED = 2  # passes that look how strong the processes are; later ones keep the strengths
SETTLED = 1e-6  # m, no coordinate moves further in the last pass,
SETTLED_U = 0.1  # or than this share of its standard uncertainty: what is linearised there changes by its square
UNSUSPICIOUS = 1.5  # variance factor, beyond which somebody is wrong though none stands out


@dataclass(frozen=True, eq=False)
class RangeShots:
    """Every target shot that has a phase, one row a shot, sorted by ranger; lengths in metres.

    shot              index into the campaign's shots
    ranger, target    names
    phase             rad, the target's phase after the electronics' at that instant, [0, 2 pi)
    electronics       rad, phase of the electronics at that instant
    cycles, margin    whole half wavelengths and how far the coarse length was from another number
    refractivity      n_g - 1 along the path
    incidence         rad, on a prism's face; 0 for others
    glass, obliquity  Pc (with what was estimated of it) and dPc, metres
    zero, leakage     estimated corrections of the ranger's zero and of the rest of its leakage, to the range
    head              what the mirror's axes, the coupling of amplitude to phase and cyclic terms add to the range
    range_            distance scan point to target as this shot gives it, all corrections applied
    u_range           its standard uncertainty: noise, electronics and path; systematic parameters not counted
    residual          range_ minus the adjusted distance
    standardised      test statistic of the adjustment
    redundancy        of the adjustment
    detectable        smallest error that a test at the level 0.1 % finds four times in five, m; rejection at |w| = 3.5
                      asks for 5 % more
    used              took part
    thin              its whole cycles are not beyond doubt: what all other lines and the records predict of this range
                      misses it by so much, or is so uncertain, that misfit and five standard uncertainties reach a
                      quarter wavelength; repeats on one line share their cycles and do not check each other
    """

    shot: np.ndarray
    ranger: tuple[str, ...]
    target: tuple[str, ...]
    phase: np.ndarray
    electronics: np.ndarray
    cycles: np.ndarray
    margin: np.ndarray
    refractivity: np.ndarray
    incidence: np.ndarray
    glass: np.ndarray
    obliquity: np.ndarray
    zero: np.ndarray
    leakage: np.ndarray
    head: np.ndarray
    range_: np.ndarray
    u_range: np.ndarray
    residual: np.ndarray
    standardised: np.ndarray
    redundancy: np.ndarray
    detectable: np.ndarray
    used: np.ndarray
    thin: np.ndarray


@dataclass(frozen=True, eq=False)
class AdjustedCoordinates:
    """The adjusted network.

    points       names in order; places their records where they can be ranged to (fixed points are no places)
    x            (points, 3) m, ground frame
    joint        their joint covariance, m^2
    start        (points, 3) m, where the adjustment began
    shots        used shots at each point, fired there or from there
    ranges       every shot with a phase
    zeros        ranger: correction to its range, m, and standard uncertainty
    heads        how far each effect of a head is off its sheet, m or rad, and its u: "cyclic ZY101 sine 1"
    leakage      ranger: what is left of its leakage, V (real, imaginary)
    air          name: estimate and standard uncertainty of thermometer offsets (°C) and profile
    sound        line: what it is found to read too warm, °C, and u; for lines of path_temperatures.csv
    refractivity_ppm   mean group refractivity over the used paths
    variance_factor, degrees_of_freedom   of everything but the typed positions
    fits         of all groups, for reports
    notes        what a person should know, one line each
    unresolved   index into the campaign's shots: why its whole cycles cannot be known; such shots are not in `ranges`
    strength     of the processes in time, as the ranges have them
    doubts       why the answer is not good although its tests passed, a sentence each
    refuted      whose priors the ranges contradict, so that they are left out: thermometers, zeros, sounded lines
    """

    points: tuple[str, ...]
    places: dict[str, RangedPoint]
    x: np.ndarray
    joint: JointPoints
    start: np.ndarray
    shots: np.ndarray
    ranges: RangeShots
    zeros: dict[str, tuple[float, float]]
    heads: dict[str, tuple[float, float]]
    leakage: dict[str, tuple[float, float]]
    air: dict[str, tuple[float, float]]
    refractivity_ppm: float
    variance_factor: float
    degrees_of_freedom: float
    status: str
    fits: tuple[GroupFit, ...]
    notes: tuple[str, ...]
    unresolved: dict[int, Reason]
    sound: dict[str, tuple[float, float]] = field(default_factory=dict)
    strength: ProcessStrength = field(default_factory=ProcessStrength)
    doubts: tuple[str, ...] = ()
    refuted: tuple[Parameter, ...] = ()

    def index(self, name: str) -> int:
        """Row of a point by its name."""
        return self.points.index(name)

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Rows of some points, (k,)."""
        at = {name: row for row, name in enumerate(self.points)}
        return np.array([at[name] for name in names], dtype=int)

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Covariance (3k, 3k) of some points, in the order given."""
        return self.joint.block(self.rows(names))

    @property
    def covariance(self) -> np.ndarray:
        """(3 points, 3 points) m^2, order x y z of each point; EstimationError where there are too many."""
        return self.joint.matrix()

    @property
    def u(self) -> np.ndarray:
        """(points, 3) m, standard uncertainties."""
        return self.joint.u


class SettledNetwork(NamedTuple):
    """An adjustment that has settled.

    network    with the strengths of its processes as they came out
    solution   of all parameters
    shots      of each ranger, as last seen
    """

    network: CampaignNetwork
    solution: LeastSquaresSolution
    shots: list[tuple[ShotGroup, ShotParts]]


def adjust_coordinates(
    campaign: ObservedSite,
    phases: Phases,
    electronics: dict[str, ElectronicsPhase],
    *,
    settings: ReductionSettings,
    progress: Progress | None = None,
) -> AdjustedCoordinates:
    """Coordinates of everything that was ranged to or from, with full covariance.

    Cycles, incidence angles and the air along the paths follow from the coordinates, so the adjustment is repeated
    until they no longer change. Wrong shots are searched for in the first pass, and in the second once more with what
    the dish then says of its own prisms; later passes keep the choice. Before the first pass `resolve_cycles` looks
    after points that are typed too badly for the nearest integer.

    Source: [PARKER04] eq. 5.18 and 5.19 for the range, in optical metres: N c/2f - phase c/(4 pi f) =
    n_path D - n (Pc + dPc + D0 + zero); [GOLDMAN00] eq. B.1 for dPc. The priors are the records' uncertainties.
    """
    network = build_network(campaign, phases, electronics, settings=settings)
    resolved = resolve_cycles(network, progress)
    if resolved.rejected:
        network = build_network(campaign, phases, without_shots(electronics, set(resolved.rejected)), settings=settings)
    if not network.rangers:
        why = next(iter(resolved.rejected.values()), "no shot on any target has a usable phase and reference")
        raise InputError(f"shots.csv: {why}; nothing to adjust")
    settled = settle_network(network, resolved.starts, progress)
    for _ in range(JUDGED):
        allowance = allowed(settled)
        if allowance.same(settled.network.allowance):
            break
        network = build_network(
            campaign, phases, settled.network.electronics, settings=settings, allowance=allowance
        ).with_strength(settled.network.strength)
        starts = {name: settled.solution.x[network.layout.columns(name)] for name in network.places}
        settled = settle_network(network, starts, progress, active=_selection(settled, network))
    return coordinates_of(settled, resolved=resolved)


def _refuted(settled: SettledNetwork) -> dict[Parameter, float]:
    """Parameters whose priors were left out, and the values that the ranges give them."""
    network, solution, shots = settled
    found: dict[Parameter, float] = {}
    for group, fit in zip(network.priors, solution.fits[len(shots) :], strict=True):
        if fit.name in (THERMOMETERS, ZEROS, SOUND):
            columns = np.ravel(group.columns)[~fit.active].tolist()
            found |= {network.layout.parameters[c]: float(solution.x[c]) for c in columns}
    return found


def _selection(settled: SettledNetwork, network: CampaignNetwork) -> list[np.ndarray]:
    """What takes part in a network with the shots of one that has settled: the shots that took part there."""
    count = len(settled.shots)
    shots = [fit.active for fit in settled.solution.fits[:count]]
    return [*shots, *(np.ones(len(prior.observed), dtype=bool) for prior in network.priors)]


def allowed(settled: SettledNetwork) -> Allowance:
    """What is to be allowed for after an adjustment: its explanations judged, its residuals averaged."""
    network, solution, shots = settled
    air, layout = network.field, network.layout
    dropped, variance = _refuted(settled), solution.q.diagonal()
    u = {n: float(np.sqrt(variance[c])) for n, c in zip(air.stations, layout.air, strict=False)}
    allowance = refused(network.allowance, dropped, air, u, len(network.rangers))
    if allowance.held != network.allowance.held:
        return allowance
    allowance = for_the_air(allowance, air, solution, layout.air, dropped=dropped)
    own = {name: network.electronics[name].shots for name in network.rangers}
    lines = [(p.name, p.electronics.shots, 1.0 + p.refractivity, p.distance) for _, p in shots]
    groups = [*(g for g, _ in shots), *network.priors]
    sorts = sortings(network.campaign, network.places, own)
    return for_families(allowance, self_checks(groups, solution, sorts, lines))


def settle_network(
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
    layout, settings = network.layout, network.settings
    x = np.array(layout.start)
    for name, where in starts.items():
        if name in layout.points:
            x[layout.columns(name)] = where
    free = np.array(layout.free)
    points = [layout.columns(name) for name in network.places if name in layout.points]
    coordinates = np.concatenate(points)
    solution = None
    advice: list[Linear] = []
    solver, names = SolverSettings(border=network.border), layout.names
    for turn in range(PASSES):
        if progress is not None:
            progress("adjustment", min(turn + FIRST * (turn > 0), PASSES - 1), PASSES)
        shots = [shot_group(network.seen_from(name), name, x) for name in network.rangers]
        searching = not turn and not predicted and active is None
        priors = [_while_searching(p, network) for p in network.priors] if searching else network.priors
        groups: list[ObservationGroup] = [group for group, _ in shots] + priors
        removable = [_removable(g, network, shots=i < len(shots)) for i, g in enumerate(groups)]
        if searching:
            for g, may in zip(groups, removable, strict=True):
                may &= g.name != THERMOMETERS
        before, solution = x, None  # its covariance is large
        if predicted and turn < TESTED and (active is None or all(a.all() for a in active)):
            solution = adjust(x, groups, free=free, names=names, solver=solver)
            predicted = _unsuspicious(solution, removable, settings.critical)
            active = None
        if turn < TESTED and not predicted:
            solution = adjust_robustly(
                x,
                groups,
                removable,
                outliers=OutlierSearch(
                    points=points,
                    advice=advice,
                    critical=settings.critical,
                    shared=[part.shared_errors for _, part in shots],
                ),
                free=free,
                active=active,
                names=names,
                border=network.border,
            )
        elif turn >= TESTED:
            solution = adjust(x, groups, free=free, active=active, names=names, solver=solver)
        assert solution is not None
        x, active = solution.require_converged().x, [f.active for f in solution.fits]
        if not turn:
            advice = dish_advice(network, x, solution.q)
        steady = True
        if turn < STRENGTHENED:
            strength = network.processes.estimated(solution, network.strength, [p.distance for _, p in shots])
            steady = strength.near(network.strength)
            network = network if steady else network.with_strength(strength)
        moved = np.abs(x - before)[coordinates]
        u = np.sqrt(solution.q.diagonal()[coordinates])
        if turn and steady and np.all(moved < np.maximum(SETTLED + keep, SETTLED_U * u)):
            break
    else:
        raise _unsettled(layout.parameters[coordinates[np.argmax(moved)]], float(moved.max()))
    if progress is not None:
        progress("adjustment", PASSES, PASSES)
    assert solution is not None
    return SettledNetwork(network, solution, shots)


def _while_searching(prior: ObservationGroup, network: CampaignNetwork) -> ObservationGroup:
    """A prior as the first search has it: thermometers that may be wrong are loose, not as wrong as no air could be."""
    if prior.name != THERMOMETERS or not isinstance(prior, Linear):
        return prior
    loose = _removable(prior, network, shots=False)
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


def _removable(group: ObservationGroup, network: CampaignNetwork, *, shots: bool) -> np.ndarray:
    """(m,) bool: which observations of a group may be left out."""
    if shots or group.name not in (THERMOMETERS, ZEROS, SOUND):
        return np.full(len(group.observed), shots)
    owners = [network.layout.parameters[c] for c in np.ravel(group.columns).tolist()]
    return np.array([owner not in network.allowance.held for owner in owners])


def _unsettled(worst: Parameter, moved: float) -> EstimationError:
    return EstimationError(
        f"not settled: cycles, air and incidence still move {worst} by {moved / MILLIMETRE:.3f} mm after {PASSES} "
        "passes; check its typed position"
    )


def _unsuspicious(solution: LeastSquaresSolution, removable: Sequence[np.ndarray], critical: float) -> bool:
    """Whether every observation that may be wrong passes its test by half a sigma, and all together theirs."""
    if not solution.solved or solution.status != CONVERGED:
        return False
    large = [np.abs(f.standardised[may]) > critical - 0.5 for f, may in zip(solution.fits, removable, strict=True)]
    factor, _ = solution.variance_factor([f.name for f in solution.fits if f.name != APPROXIMATE])
    return not any(each.any() for each in large) and factor < UNSUSPICIOUS


def coordinates_of(settled: SettledNetwork, *, resolved: Resolved) -> AdjustedCoordinates:
    """What an adjusted network says of points, ranges, heads and air.

    settled    as `settle_network` gave it
    resolved   what was known of whole cycles before
    """
    network, solution, shots = settled
    layout, campaign = network.layout, network.campaign
    names = sorted([*network.places, *(str(Parameter(ParameterKind.FIXED_POINT, m)) for m in campaign.monuments)])
    columns = np.array([layout.columns(n) for n in names])
    ranges = _ranges(network, solution, shots)
    count = dict.fromkeys(names, 0)
    for ranger, target, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True):
        count[ranger] += int(used)
        count[target] += int(used)
    judged = [f.name for f in solution.fits if f.name != APPROXIMATE]
    factor, degrees = solution.variance_factor(judged)

    variance = solution.q.diagonal()

    def estimate(column: int) -> tuple[float, float]:
        return float(solution.x[column]), float(np.sqrt(variance[column]))

    lasting = zip(layout.air, network.field.names, strict=False)  # what follows are errors in time
    every = {n: estimate(int(k)) for k, n in lasting}
    sound = {line.name: every[line.name] for line in network.field.lines}
    air = {n: value for n, value in every.items() if n not in sound}
    leakage_at = {n: layout.columns(Parameter(ParameterKind.LEAKAGE, n), 2) for n in network.rangers}
    used_paths = ranges.refractivity[ranges.used]
    return AdjustedCoordinates(
        points=tuple(names),
        places=network.places,
        x=solution.x[columns],
        joint=JointPoints.of(solution.q, columns),
        start=np.array(layout.start)[columns],
        shots=np.array([count[n] for n in names]),
        ranges=ranges,
        heads={
            str(layout.parameters[column]): estimate(column)
            for n in network.rangers
            for unknown in head_unknowns(campaign, n)
            for column in layout.columns(unknown.quantity, len(unknown.parts))
        },
        zeros={n: estimate(layout.at[Parameter(ParameterKind.ZERO, n)]) for n in network.rangers},
        leakage={n: (float(solution.x[c[0]]), float(solution.x[c[1]])) for n, c in leakage_at.items()},
        air=air,
        refractivity_ppm=float(used_paths.mean() / PPM) if len(used_paths) else float("nan"),
        variance_factor=factor,
        degrees_of_freedom=degrees,
        status=solution.status,
        fits=solution.fits,
        notes=(
            *_notes(network, solution, air, count),
            *_sound_notes(network, solution, ranges, sound),
            *_losses(ranges),
            *resolved.notes,
            *_thin_notes(ranges),
        ),
        unresolved=resolved.rejected,
        sound=sound,
        strength=network.strength,
        doubts=_doubts(network, solution),
        refuted=tuple(_refuted(settled)),
    )


def _ranges(
    network: CampaignNetwork, solution: LeastSquaresSolution, shots: list[tuple[ShotGroup, ShotParts]]
) -> RangeShots:
    x, layout, parts = solution.x, network.layout, [p for _, p in shots]
    fits = solution.fits[: len(parts)]
    zero, leakage, glass, range_, u_range, residual, detectable, thin, redundancy = [], [], [], [], [], [], [], [], []
    quarter = 0.25 * SPEED_OF_LIGHT / network.campaign.site.ranging.modulation_hz  # of the optical length, as the fits
    for (group, part), fit in zip(shots, fits, strict=True):
        n = 1.0 + part.refractivity
        own_zero = np.full(len(n), x[layout.at[Parameter(ParameterKind.ZERO, part.name)]])
        at = x[layout.columns(part.name)]
        to = np.array([x[layout.columns(t)] for t in part.target])
        zero.append(own_zero)
        leakage.append(-(part.leakage_slope @ x[layout.columns(Parameter(ParameterKind.LEAKAGE, part.name), 2)]) / n)
        constants = [Parameter(ParameterKind.GLASS, t) for t in part.target]
        rest = [x[layout.at[c]] if c in layout.at else 0.0 for c in constants]
        glass.append(part.glass + np.array(rest))
        own = fit.residual + part.shared_error(x)
        residual.append(own / n)
        range_.append(np.linalg.norm(to - at, axis=1) + own / n)
        u_range.append(np.sqrt(part.variance) / n)
        redundancy.append(_redundancy(group, part, fit, solution))
        detectable.append(fit.detectable_error / n)
        error, u = line_errors(group, part.target, fit, solution=solution)
        thin.append(np.abs(error) + KEPT * u >= quarter)
    join = np.concatenate
    return RangeShots(
        shot=join([p.electronics.shots for p in parts]),
        ranger=tuple(p.name for p in parts for _ in p.target),
        target=tuple(t for p in parts for t in p.target),
        phase=join([p.phase for p in parts]),
        electronics=join([p.electronics.phase for p in parts]),
        cycles=join([p.cycles for p in parts]),
        margin=join([p.margin for p in parts]),
        refractivity=join([p.refractivity for p in parts]),
        incidence=join([p.incidence for p in parts]),
        glass=join(glass),
        obliquity=join([p.obliquity for p in parts]),
        zero=join(zero),
        leakage=join(leakage),
        head=join([p.head.at(x) for p in parts]),
        range_=join(range_),
        u_range=join(u_range),
        residual=join(residual),
        standardised=join([f.standardised for f in fits]),
        redundancy=join(redundancy),
        detectable=join(detectable),
        used=join([f.active for f in fits]),
        thin=join(thin),
    )


def _redundancy(group: ShotGroup, part: ShotParts, fit: GroupFit, solution: LeastSquaresSolution) -> np.ndarray:
    """(m,) redundancy numbers of ranges, what they share with others counted as theirs.

    With the shared errors B z as parameters, C = D + B S B' and P_v as it is without them, P_v C = P_v D + D^-1 A Q B':
    so 1 - a Q (a - b)' / D.
    """
    columns, _ = part.shared
    if not columns.shape[1]:
        return fit.redundancy
    jacobian = group.predict(solution.x)[1]
    without = jacobian.copy()
    without[:, -columns.shape[1] :] = 0.0
    spread = np.sum(solution.q.products(group.columns, jacobian) * without, axis=1)
    return np.where(fit.active, 1.0 - spread / group.covariance, 1.0)


def _thin_notes(ranges: RangeShots) -> list[str]:
    """Points on which the whole cycles of used shots hang on little."""
    thin = {}
    for name, rows in _by_target(ranges):
        used = ranges.used[rows]
        doubtful = int((used & ranges.thin[rows]).sum())
        if doubtful:
            thin[name] = (
                f"{name}: the whole cycles of {doubtful} of its {used.sum()} shots are not beyond doubt: without "
                "each, position and other shots do not say its range to a quarter wavelength at five sigma"
            )
    what = "points have shots whose whole cycles are not beyond doubt without them, to a quarter wavelength at 5 sigma"
    return _together(thin, what)


def _by_target(ranges: RangeShots) -> list[tuple[str, np.ndarray]]:
    """Each target with its rows, sorted by name."""
    names, number = np.unique(np.array(ranges.target), return_inverse=True)
    rows = np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])
    return list(zip(names.tolist(), rows, strict=True))


def _together(notes: Mapping[str, str], what: str) -> list[str]:
    """A note a point; of many one line for all."""
    if len(notes) <= MANY:
        return list(notes.values())
    return [f"{len(notes)} {what}: {', '.join(list(notes)[:MANY])} ..."]


def _losses(ranges: RangeShots) -> list[str]:
    """Targets that lost all shots, or hang on one that no other checks; rangers that lost most of theirs."""
    unmeasured, unchecked = {}, {}
    for name, mine in _by_target(ranges):
        used = ranges.used[mine]
        alone = used & (ranges.detectable[mine] >= CHECKED * ranges.u_range[mine])
        if not used.any():
            unmeasured[name] = (
                f"{name}: none of its {len(mine)} shots fits the others and its typed position: its coordinates here "
                "are not measured; check its typed position or say how bad it is (u_position_mm)"
            )
        elif not used.all() and alone.any():
            unchecked[name] = (
                f"{name}: {(~used).sum()} of its {len(mine)} shots contradict the rest and nothing checks "
                f"{alone.sum()} of those left: it may be further off than its uncertainty says; range it again"
            )
    notes = [
        *_together(unmeasured, "points have no shot that fits the others and their typed positions: not measured here"),
        *_together(
            unchecked,
            "points lost shots that contradict the rest, and nothing checks those left: they may be further off than "
            "their uncertainties say; range them again",
        ),
    ]
    ranger = np.array(ranges.ranger)
    for name in sorted(set(ranges.ranger)):
        mine = ranger == name
        if mine.sum() > 2 and (mine & ~ranges.used).sum() > mine.sum() / 2:
            notes.append(
                f"{name}: {(mine & ~ranges.used).sum()} of its {mine.sum()} shots do not fit: rather its survey, its "
                "mirror sheet or its samples than light from elsewhere"
            )
    return notes


def _notes(
    network: CampaignNetwork, solution: LeastSquaresSolution, air: dict[str, tuple[float, float]], count: dict[str, int]
) -> list[str]:
    """What the adjustment noticed about the records, one line each; `count` are the used shots at each point."""
    notes = []
    for group, fit in zip(network.priors, solution.fits[-len(network.priors) :], strict=True):
        if fit.name in (THERMOMETERS, ZEROS):  # not of all, where earlier epochs know some already
            owners = [network.layout.parameters[c].of for c in np.ravel(group.columns).tolist()]
        if fit.name == THERMOMETERS:
            for station, active in zip(owners, fit.active, strict=True):
                value, u = air[station]
                if not active:
                    notes.append(f"{station}'s thermometer is biased: it reads {value:+.2f} °C too high (u {u:.2f} °C)")
        if fit.name == ZEROS:
            for ranger, active, off, u in zip(owners, fit.active, fit.residual, fit.sigma, strict=True):
                if not active:
                    notes.append(
                        f"{ranger}'s zero is not the sheet's: its ranges ask for {-off / MILLIMETRE:+.3f} mm, "
                        f"{abs(off) / u:.0f} u_d0: see d0_mm of {network.campaign.mirror_of(ranger).zp}"
                    )
        if fit.name == HEADS and np.any(np.abs(fit.standardised) > network.settings.critical):
            worst = int(np.argmax(np.abs(fit.standardised)))
            called = network.layout.parameters[int(np.ravel(group.columns)[worst])]
            notes.append(
                f"{called}: not the mirror sheet's, the ranges contradict it (w {fit.standardised[worst]:.1f}, limit "
                f"{network.settings.critical}); check the sheet's value and u"
            )
    notes += network.allowance.texts
    left_out = max((states.neglected for states in network.states.values()), default=0.0)
    if left_out > WEAK:
        notes.append(
            f"so many shots leave modes of the electronics to the shots' own errors, the strongest with "
            f"{100.0 * left_out:.0f} % of their variance: shots between the same two references share that"
        )
    typed = [n for n, p in sorted(network.places.items()) if p.typed and count[n] >= 3]  # fewer do not place a point
    moved = np.array([np.linalg.norm(solution.x[network.layout.columns(n)] - network.places[n].start) for n in typed])
    unit = {t: triplet.triplet for triplet in network.campaign.triplets.values() for t in triplet.targets}
    usual = float(np.median(moved)) / 1.538 if len(moved) > 5 else np.inf  # median of chi with 3 degrees of freedom
    wrong = {
        unit.get(n, n): d
        for n, d in zip(typed, moved, strict=True)
        if d > 4.0 * max(usual, network.places[n].u_start or 0.0)
    }
    notes += [
        f"{n}: its typed position is {d / MILLIMETRE:.0f} mm off, the others' some {np.median(moved) / MILLIMETRE:.0f}"
        for n, d in wrong.items()
    ]
    return notes


def _doubts(network: CampaignNetwork, solution: LeastSquaresSolution) -> tuple[str, ...]:
    """Why the answer is not good: what had to be allowed for, and thermometers at the end of their priors."""
    doubts = list(network.allowance.texts)
    air = network.field
    sigmas = network.allowance.sigmas(air)
    for station, column, sigma in zip(air.stations, network.layout.air, sigmas, strict=False):
        value = float(solution.x[column])
        if abs(value) > DOUBTED_C * sigma:
            doubts.append(f"{station}'s thermometer is biased by {value:+.2f} °C, {abs(value) / sigma:.1f} of its u")
    return tuple(doubts)


def _sound_notes(
    network: CampaignNetwork, solution: LeastSquaresSolution, ranges: RangeShots, sound: dict[str, tuple[float, float]]
) -> list[str]:
    """What each sounded line did to the index of its shots, and whether the ranges believe it."""
    w = next((f.standardised for f in solution.fits if f.name == SOUND), np.zeros(0))
    mjd = network.campaign.shots.mjd_utc[ranges.shot]
    pairs = [frozenset(pair) for pair in zip(ranges.ranger, ranges.target, strict=True)]
    return [
        line.note(mjd[[pair == line.ends for pair in pairs]], sound[line.name], w_line, network.settings.critical)
        for line, w_line in zip(network.field.lines, w, strict=True)
    ]
