"""Phases to coordinates by one adjustment.

It solves for points, ranger zeros, leakage, air and prism normals together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.errors import InputError
from catseye.estimation.least_squares.adjustment import (
    GroupFit,
)
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.allowance import Allowance
from catseye.reduction.epoch.common_errors import considered
from catseye.reduction.epoch.contradictions.contradiction import ClassScatter, Contradiction, GroupTest, RecordTest
from catseye.reduction.epoch.head import head_unknowns
from catseye.reduction.epoch.lines.cycles import Resolved, resolve_cycles, without_shots
from catseye.reduction.epoch.lines.frequency_cycles import FrequencyCycles
from catseye.reduction.epoch.lines.frequency_places import PlacedCampaign, placed_by_frequencies
from catseye.reduction.epoch.lines.hidden_errors import hidden_shifts, leaning_of
from catseye.reduction.epoch.lines.independence import independence_of
from catseye.reduction.epoch.lines.line_tests import line_tests
from catseye.reduction.epoch.lines.mistyped import with_mistyped_found
from catseye.reduction.epoch.motion.scatter import class_scatter, shot_ends
from catseye.reduction.epoch.notes import (
    cycle_notes,
    doubts_of,
    loss_doubts,
    loss_notes,
    record_notes,
    sound_notes,
    wrong_records,
)
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.prior_names import UNJUDGED
from catseye.reduction.epoch.range_shots import RangeShots, ranges_of
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.epoch.reason import Reason
from catseye.reduction.epoch.record_tests import EpochRecords, record_tests
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import (
    SettledNetwork,
    first_adjustment,
    judged_network,
)
from catseye.reduction.epoch.strengths import ProcessStrength
from catseye.reduction.epoch.telescope_track import motion_of
from catseye.reduction.epoch.unknowns import build_network
from catseye.reduction.site.places import RangedPoint


@dataclass(frozen=True, eq=False)
class AdjustedCoordinates:
    """Result of the network adjustment.

    points       names in order; places their records where they can be ranged to (fixed points are no places)
    x            (points, 3) m, ground frame
    joint        their joint covariance, m^2
    start        (points, 3) m, where the adjustment began
    shots        used shots at each point, fired there or from there
    ranges       every shot with a phase
    zeros        ranger: correction to its range, m, and standard uncertainty
    heads        correction of each effect of a head to its sheet, m or rad, and its u: "cyclic ZY101 sine 1"
    u_adjusted   of zeros and heads, by name ("zero ZY101"): u by the adjustment alone, without the errors common to all
                 heads that it considers; with the sheet's u it says what the ranges themselves know
    leakage      ranger: residual leakage, V (real, imaginary)
    air          name: estimate and standard uncertainty of thermometer offsets (°C) and profile
    sound        line: its bias, °C (positive: too warm), and u; for lines of path_temperatures.csv
    refractivity_ppm   mean group refractivity over the used paths
    variance_factor, degrees_of_freedom   of everything but typed positions and instruments' limits
    fits         of all groups, for reports
    notes        for the user, one line each
    unresolved   index into the campaign's shots: reason for unknown whole cycles; such shots are not in `ranges`
    strength     of the processes in time, by the ranges
    doubts       reasons against a good verdict although all tests passed, a sentence each
    refuted      parameters whose priors the ranges contradict and are left out: thermometers, zeros, sounded lines
    records      test of every number of every record
    groups       test of each group of records
    contradictions   between records and ranges, with their explanations
    scatter      of the shots of each class of points
    lines        (points,) independent lines to or from each point
    unchecked    points, one of whose ranges could be wrong without showing
    unmeasured   ranged targets without a usable shot, which are not among the points
    frequencies  whole cycles by several modulation frequencies
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
    u_adjusted: dict[str, float] = field(default_factory=dict)
    records: tuple[RecordTest, ...] = ()
    groups: tuple[GroupTest, ...] = ()
    contradictions: tuple[Contradiction, ...] = ()
    scatter: tuple[ClassScatter, ...] = ()
    lines: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    unchecked: tuple[str, ...] = ()
    unmeasured: tuple[str, ...] = ()
    frequencies: FrequencyCycles = field(default_factory=FrequencyCycles)

    def index(self, name: str) -> int:
        """Row of a point by its name."""
        return self.points.index(name)

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Rows of some points, (k,)."""
        at = {name: row for row, name in enumerate(self.points)}
        return np.array([at[name] for name in names], dtype=int)

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Covariance (3k, 3k) of some points, in their order."""
        return self.joint.block(self.rows(names))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (3 points, 3 points) m^2, order x y z per point.

        EstimationError where there are too many.
        """
        return self.joint.matrix()

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (points, 3) m."""
        return self.joint.u


def adjust_coordinates(
    campaign: ObservedSite,
    phases: Phases,
    electronics: dict[str, ElectronicsPhase],
    *,
    settings: ReductionSettings,
    progress: Progress | None = None,
) -> AdjustedCoordinates:
    """Coordinates of every ranged point, with full covariance.

    Cycles, incidence angles and the air along the paths follow from the coordinates, so the adjustment is repeated
    until they no longer change. Wrong shots are searched for in the first pass, and in the second once more with the
    dish as a prior of its own prisms; later passes keep the choice. Before the first pass `resolve_cycles` handles
    points that are typed too badly for the nearest integer.

    Source: [PARKER04] eq. 5.18 and 5.19 for the range, in optical metres: N c/2f - phase c/(4 pi f) =
    n_path D - n (Pc + dPc + D0 + zero); [GOLDMAN00] eq. B.1 for dPc, section 1.1, steps 1 and
    3 (balls, and rangers of the feed arm), appendix C (incidences). The priors are the records' uncertainties.
    """
    settled, resolved = settled_network(campaign, phases, electronics, settings=settings, progress=progress)
    return coordinates_of(settled, resolved=resolved)


def settled_network(
    campaign: ObservedSite,
    phases: Phases,
    electronics: dict[str, ElectronicsPhase],
    *,
    settings: ReductionSettings,
    progress: Progress | None = None,
) -> tuple[SettledNetwork, Resolved]:
    """Adjusted network with its covariance, and the cycles resolved beforehand; see `adjust_coordinates`."""
    placed = placed_by_frequencies(campaign, phases, electronics, settings=settings, motion=motion_of(campaign))
    resolve = partial(_resolved_network, placed, settings=settings, progress=progress)
    first, resolved = resolve(Allowance())
    if sway := first.network.allowance.sway:  # the cycles were searched for without it
        first, resolved = resolve(Allowance(sway=sway))
    first, resolved = with_mistyped_found(first, resolved, progress)
    return judged_network(first, progress), resolved


def _resolved_network(
    placed: PlacedCampaign,
    allowance: Allowance,
    *,
    settings: ReductionSettings,
    progress: Progress | None,
) -> tuple[SettledNetwork, Resolved]:
    """Adjusted network of the shots with resolved cycles, and these."""
    campaign, phases, electronics = placed.campaign, placed.phases, placed.electronics
    motion = motion_of(campaign)
    network = build_network(campaign, phases, electronics, settings=settings, motion=motion, allowance=allowance)
    resolved = resolve_cycles(network, progress, starts=placed.starts)
    resolved = replace(
        resolved,
        starts={**placed.starts, **resolved.starts},
        rejected={**placed.rejected, **resolved.rejected},
        notes=(*placed.notes, *resolved.notes),
        frequencies=placed.frequencies,
    )
    if resolved.rejected:
        remaining = without_shots(electronics, set(resolved.rejected))
        network = build_network(campaign, phases, remaining, settings=settings, motion=motion, allowance=allowance)
    if not network.rangers:
        why = next(iter(resolved.rejected.values()), "no shot on any target has a usable phase and reference")
        raise InputError(f"shots.csv: {why}; nothing to adjust")
    return first_adjustment(network, resolved.starts, progress), resolved


def coordinates_of(settled: SettledNetwork, *, resolved: Resolved, with_records: bool = True) -> AdjustedCoordinates:
    """Points, ranges, heads and air of an adjusted network.

    settled        result of `iterate_adjustment`
    resolved       whole cycles resolved beforehand
    with_records   False leaves out the table of all records' tests
    """
    network, solution, shots = settled
    tests = [
        line_tests(group, part.target, fit, solution=solution)
        for (group, part), fit in zip(shots, solution.fits, strict=False)
    ]
    ranges = ranges_of(network, solution, shots, tests)
    adjusted = solution.q.diagonal()
    solution = considered(network, solution, shots)
    solution = network.allowance.considered(network.field, solution, network.layout.air)
    tested, is_night = EpochRecords(network, settled.solution, shots), network.motion is None
    leaning = leaning_of(tested) if is_night else None
    if leaning is not None:
        solution = leaning.considered(solution)
    by_survey = hidden_shifts(tested, solution.q) if is_night else {}
    layout, campaign = network.layout, network.campaign
    doubtful = resolved.doubtful | set(ranges.ill_fitting)
    independence = independence_of(network, tests, claimed=solution.q, by_survey=by_survey, doubtful=doubtful)
    places = {n: place for n, place in network.places.items() if n not in independence.unmeasured}
    names = sorted([*places, *(str(Parameter(ParameterKind.FIXED_POINT, m)) for m in campaign.monuments)])
    columns = np.array([layout.columns(n) for n in names])
    count = dict.fromkeys(names, 0)
    for ranger, target, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True):
        if used:
            count[ranger] += 1
            count[target] += 1
    judged = [f.name for f in solution.fits if f.name not in UNJUDGED]
    factor, degrees = solution.variance_factor(judged)

    variance = solution.q.diagonal()

    def estimate(column: int) -> tuple[float, float]:
        return float(solution.x[column]), float(np.sqrt(variance[column]))

    constant_parameters = zip(layout.air, network.field.names, strict=False)  # what follows are errors in time
    air_estimates = {n: estimate(int(k)) for k, n in constant_parameters}
    sound = {line.name: air_estimates[line.name] for line in network.field.lines}
    air = {n: value for n, value in air_estimates.items() if n not in sound}
    disagreement = (resolved.frequencies.disagreement,) if resolved.frequencies.disagreement else ()
    wrong, refuted = wrong_records(network), network.allowance.refuted
    records, groups = record_tests(tested) if with_records else ((), ())
    heads = {
        str(layout.parameters[column]): column
        for n in network.rangers
        for unknown in head_unknowns(campaign, n)
        for column in layout.columns(unknown.quantity, len(unknown.parts)).tolist()
    }
    zeros = {n: layout.at[Parameter(ParameterKind.ZERO, n)] for n in network.rangers}
    leakage_at = {n: layout.columns(Parameter(ParameterKind.LEAKAGE, n), 2) for n in network.rangers}
    used_paths = ranges.refractivity[ranges.used]
    ends = shot_ends(network.places, [(p.name, p.target, p.distance) for _, p in shots])
    return AdjustedCoordinates(
        points=tuple(names),
        places=places,
        x=solution.x[columns],
        joint=JointPoints.of(solution.q, columns),
        start=np.array(layout.start)[columns],
        shots=np.array([count[n] for n in names]),
        ranges=ranges,
        heads={name: estimate(column) for name, column in heads.items()},
        zeros={n: estimate(column) for n, column in zeros.items()},
        u_adjusted={
            **{str(Parameter(ParameterKind.ZERO, n)): float(np.sqrt(adjusted[column])) for n, column in zeros.items()},
            **{name: float(np.sqrt(adjusted[column])) for name, column in heads.items()},
        },
        leakage={n: (float(solution.x[c[0]]), float(solution.x[c[1]])) for n, c in leakage_at.items()},
        air=air,
        refractivity_ppm=float(used_paths.mean() / PPM) if len(used_paths) else float("nan"),
        variance_factor=factor,
        degrees_of_freedom=degrees,
        status=solution.status,
        fits=solution.fits,
        notes=(
            *record_notes(network, solution, wrong, count, independence),
            *([leaning.note] if leaning is not None else []),
            *sound_notes(network, solution, ranges, sound),
            *loss_notes(ranges, independence, network.settings.critical),
            *resolved.notes,
            *cycle_notes(ranges),
        ),
        unresolved=resolved.rejected,
        sound=sound,
        strength=network.strength,
        doubts=(
            *disagreement,
            *doubts_of(network, solution, wrong, refuted),
            *(loss_doubts(ranges, independence, campaign.triplet_of, network.settings.critical) if is_night else ()),
        ),
        refuted=refuted,
        records=records,
        groups=groups,
        contradictions=network.allowance.contradictions,
        scatter=class_scatter(ends, solution.fits, network.allowance.sway),
        lines=np.array([independence.lines.get(n, 0) for n in names]),
        unchecked=independence.unchecked(names),
        unmeasured=independence.unmeasured,
        frequencies=resolved.frequencies,
    )
