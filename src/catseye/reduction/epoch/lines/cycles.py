"""Whole cycles of points typed too badly for the nearest integer.

A shot's nearest integer is safe while misfit and five standard uncertainties of its coarse length stay under a
quarter wavelength. Such shots are adjusted first; they and the records (benchmarks, triplets' dimensions) may then
make others safe. Points that are still too uncertain are searched for jointly from all rangers with
`estimation.ambiguity.search`, against the stations as adjusted, round after round: rangers of the feed arm first,
then points that only these have seen. A point without an answer is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT
from catseye.estimation.ambiguity.search import AmbiguityStatus, Located
from catseye.estimation.least_squares.adjustment import (
    NONCENTRALITY,
    SolverSettings,
    adjust,
)
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.reduction.epoch.lines.cycle_search import CycleScene, search, spread
from catseye.reduction.epoch.lines.frequency_cycles import FrequencyCycles
from catseye.reduction.epoch.parameter import ParameterKind
from catseye.reduction.epoch.prior_names import THERMOMETERS, ZEROS
from catseye.reduction.epoch.ranges import ElectronicsPhase
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork, build_network

REQUIRED_SIGMAS = 5.0  # standard uncertainties of misfit that the margin must hold
ROUNDED = 1.01  # the layout's 15 mm in space are 8.7 mm a coordinate; its rounded 10 mm pass, being 1 in 1000 too large
MANY = 6  # more points than this share one note
ROUNDS = 8  # cap of rounds; each makes a point safe, or is the last


@dataclass(frozen=True, eq=False)
class Resolved:
    """Result before the first pass of the adjustment.

    starts     point: (3,) m, start of the adjustment instead of the typed position
    rejected   index into the campaign's shots: reason that its whole cycles are unknown
    notes      one line per point
    doubtful   points that may be wrong by whole half wavelengths
    frequencies   whole cycles by several modulation frequencies
    """

    starts: dict[str, np.ndarray]
    rejected: dict[int, Reason]
    notes: tuple[str, ...]
    doubtful: frozenset[str] = frozenset()
    frequencies: FrequencyCycles = field(default_factory=FrequencyCycles)


def resolve_cycles(
    network: CampaignNetwork, progress: Progress | None = None, *, starts: Mapping[str, np.ndarray] | None = None
) -> Resolved:
    """Better starts for badly typed points.

    Also the shots on them whose whole cycles stay unknown.

    network    of all shots that have a phase
    progress   called with (task, number done, total)
    starts     (3,) m of points that are known better than as typed

    Shots whose whole cycles `network.phases` knows are safe. Nothing happens where every typed position keeps five
    standard uncertainties within a quarter wavelength.
    Raises EstimationError where the safe shots alone find no answer.

    Source: the law of `signal.cycles.whole`; search by [TEUNISSEN95], see `estimation.ambiguity.search`.
    """
    settings, targets = network.settings, network.campaign.shots.target
    doubtful = doubtful_points(network)
    if not doubtful:
        return Resolved({}, {}, ())
    ends = {int(k): {name, targets[k]} for name, e in network.electronics.items() for k in e.shots}
    cycles = network.phases.cycles
    waiting = {k for k, names in ends.items() if names & doubtful and (cycles is None or cycles[k] < 0)}
    if not waiting:
        return Resolved({}, {}, ())
    x = np.array(network.layout.start)
    for name in (starts or {}).keys() & network.places.keys():
        x[network.layout.columns(name)] = (starts or {})[name]
    candidates = frozenset(doubtful)
    last: dict[str, Located] = {}
    found_as: dict[str, Located] = {}
    for turn in range(ROUNDS):
        if progress is not None:
            progress("whole cycles", turn, ROUNDS)
        scene = _adjusted(network, x, waiting)
        x = scene.solution.x
        safe = _safe(scene, waiting)
        waiting -= safe
        placed = {n for n in doubtful if not _too_wide(network, spread(scene, n))}
        doubtful -= placed
        located = set()
        for name in sorted(doubtful & {n for k in waiting for n in ends[k]}):
            mine = {k for k in waiting if name in ends[k] and not (ends[k] - {name}) & doubtful}
            if not mine:
                continue
            last[name] = search(scene, name, mine)
            if last[name].status is AmbiguityStatus.FOUND:
                located.add(name)
        for name in located:
            x[network.layout.columns(name)] = last[name].x
            found_as[name] = last[name]
        doubtful -= located
        waiting = {k for k in waiting if ends[k] & doubtful}  # wrong shots among the others appear in the adjustment
        if not waiting or not (located or safe or placed):
            break
    if progress is not None:
        progress("whole cycles", ROUNDS, ROUNDS)
    unresolved = sorted({name for k in waiting for name in ends[k] & doubtful})
    starts = {
        name: x[network.layout.columns(name)] for name in sorted(candidates)
    }  # an unresolved point may have safe shots as well
    rejected = {k: _reason(network, settings, sorted(ends[k] & doubtful), last) for k in sorted(waiting)}
    notes = [*_found_notes(network, settings, found_as), *_unresolved_notes(network, settings, unresolved, last)]
    return Resolved(starts, rejected, tuple(notes))


def doubtful_points(network: CampaignNetwork) -> set[str]:
    """Typed points too uncertain for the nearest integer.

    Their uncertainty does not keep five standard uncertainties within a quarter wavelength, or they contradict a
    certified distance, whatever they claim.
    """
    usual, places = network.settings.u_position, network.places
    wide = {n for n, p in places.items() if p.typed and _too_wide(network, p.u_typed(usual) ** 2 * np.eye(3))}
    for b in network.campaign.benchmarks:
        if b.target in places and b.ranger in places:
            ends = places[b.target], places[b.ranger]
            typed = [p for p in ends if p.typed]
            miss = float(np.linalg.norm(ends[0].start - ends[1].start)) - b.certified_distance_mm * MILLIMETRE
            u = float(np.linalg.norm([b.u_mm * MILLIMETRE, *(p.u_typed(usual) for p in typed)]))
            wide |= {p.name for p in typed if abs(miss) > REQUIRED_SIGMAS * ROUNDED * u}
    return wide


def without_shots(electronics: dict[str, ElectronicsPhase], out: set[int]) -> dict[str, ElectronicsPhase]:
    """Electronics at the remaining shots.

    A ranger without any stays, empty.
    """
    remaining = {}
    for name, e in electronics.items():
        keep = np.array([int(k) not in out for k in e.shots], dtype=bool)
        remaining[name] = e.of(keep)
    return remaining


def _too_wide(network: CampaignNetwork, covariance: np.ndarray) -> bool:
    """True if a point is too uncertain for the nearest integer.

    In its worst direction.
    """
    quarter = 0.25 * SPEED_OF_LIGHT / network.campaign.site.ranging.modulation_hz
    return bool(REQUIRED_SIGMAS * np.sqrt(np.linalg.eigvalsh(covariance)[-1]) > ROUNDED * quarter)


def _adjusted(network: CampaignNetwork, x: np.ndarray, waiting: set[int]) -> CycleScene:
    """Network adjusted without the waiting shots.

    Wrong shots are left out; all parameters with covariance.
    """
    electronics = without_shots(network.electronics, waiting)
    used: set[int] = set()
    part = build_network(
        network.campaign, network.phases, electronics, settings=network.settings, motion=network.motion
    )
    if part.rangers:
        column = {parameter: i for i, parameter in enumerate(network.layout.parameters)}
        at = np.array([column.get(parameter, -1) for parameter in part.layout.parameters])
        at[[p.kind is ParameterKind.ELECTRONICS for p in part.layout.parameters]] = -1  # other shots have other states
        begin = np.where(at < 0, part.layout.start, x[at])
        pairs = [shot_group(part, name, begin) for name in part.rangers]
        groups: list[ObservationGroup] = [group for group, _ in pairs] + part.priors
        removable = [
            np.full(len(g.observed), i < len(pairs) or g.name in (THERMOMETERS, ZEROS)) for i, g in enumerate(groups)
        ]
        solution = adjust_robustly(
            begin,
            groups,
            removable,
            outliers=OutlierSearch(
                points=[part.layout.columns(n) for n in part.places if n in part.layout.points],
                critical=network.settings.critical,
                shared=[p.shared_errors for _, p in pairs],
            ),
            free=np.array(part.layout.free),
            names=part.layout.names,
            border=part.border,
        ).require_converged()
        x = x.copy()
        x[at[at >= 0]] = solution.x[at >= 0]
        used = {
            int(k)
            for fit, (_, p) in zip(solution.fits, pairs, strict=False)
            for k, on in zip(p.electronics.shots, fit.active, strict=True)
            if on
        }
    pairs = [shot_group(network, name, x) for name in network.rangers]
    active = [np.isin(p.electronics.shots, sorted(used)) for _, p in pairs]
    active += [np.ones(len(g.observed), dtype=bool) for g in network.priors]
    adjusted = adjust(
        x,
        [*(g for g, _ in pairs), *network.priors],
        free=np.array(network.layout.free),
        active=active,
        names=network.layout.names,
        solver=SolverSettings(border=network.border),
    ).require_converged()
    pairs = [shot_group(network, name, adjusted.x) for name in network.rangers]
    return CycleScene(network, [p for _, p in pairs], adjusted)


def _safe(scene: CycleScene, waiting: set[int]) -> set[int]:
    """Waiting shots whose nearest integer is safe.

    All the others predict their range well enough.
    """
    safe = set()
    for fit, part in zip(scene.solution.fits, scene.parts, strict=False):
        half = scene.network.campaign.half_wavelengths(part.electronics.shots)
        u = fit.detectable_error / NONCENTRALITY
        misfit = fit.estimated_error - half * np.rint(fit.estimated_error / half)  # cycles belong to an older place
        resolved = np.abs(misfit) + REQUIRED_SIGMAS * u < 0.5 * half
        safe |= {int(k) for k, ok in zip(part.electronics.shots, resolved, strict=True) if ok}
    return safe & waiting


def _u_mm(network: CampaignNetwork, settings: ReductionSettings, name: str) -> float:
    """Standard uncertainty of each coordinate as typed, mm."""
    return network.places[name].u_typed(settings.u_position) / MILLIMETRE


def _found_notes(network: CampaignNetwork, settings: ReductionSettings, located: dict[str, Located]) -> list[str]:
    if len(located) > MANY:
        least = min(located, key=lambda name: located[name].discrimination)
        return [
            f"{len(located)} points too uncertain for the nearest integer: whole cycles found jointly; least certain "
            f"{least}, {next_candidate(located[least])}"
        ]
    return [
        f"{name}: position uncertain by {_u_mm(network, settings, name):.0f} mm; whole cycles found "
        f"jointly from {len(one.cycles)} shots{', one of them left out' * (one.left_out >= 0)}, {next_candidate(one)}"
        for name, one in sorted(located.items())
    ]


def next_candidate(located: Located) -> str:
    """Distance of the second best set of whole cycles, in words."""
    if not np.isfinite(located.discrimination):
        return "no other candidate"
    return f"next candidate at least {np.sqrt(located.discrimination):.0f} sigma worse"


def _unresolved_notes(
    network: CampaignNetwork, settings: ReductionSettings, unresolved: list[str], last: dict[str, Located]
) -> list[str]:
    if len(unresolved) > MANY:
        return [
            f"{len(unresolved)} points have shots whose whole cycles are unknown, see rejected: "
            f"{', '.join(unresolved[:MANY])} ..."
        ]
    return [str(_reason(network, settings, [name], last)) for name in unresolved]


def _reason(
    network: CampaignNetwork, settings: ReductionSettings, names: list[str], last: dict[str, Located]
) -> Reason:
    """Reason for unknown whole cycles, by the points at the shot's ends."""
    name = names[0]
    u = _u_mm(network, settings, name)
    why = last[name].text if name in last else "the other ends of its shots are as uncertain; survey it better"
    return Reason(ShotStatus.CYCLES_UNKNOWN, f"typed position of {name} is uncertain by {u:.0f} mm; {why}")
