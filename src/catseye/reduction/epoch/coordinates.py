"""Phases to coordinates by one adjustment.

It solves for points, ranger zeros, leakage, air and prism normals together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.errors import InputError
from catseye.estimation.least_squares.adjustment import (
    GroupFit,
)
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.common_errors import considered
from catseye.reduction.epoch.cycles import Resolved, resolve_cycles, without_shots
from catseye.reduction.epoch.head import head_unknowns
from catseye.reduction.epoch.notes import cycle_notes, doubts_of, loss_notes, record_notes, sound_notes, wrong_records
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.range_shots import RangeShots, ranges_of
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.epoch.reason import Reason
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import (
    JUDGED,
    SettledNetwork,
    allowed,
    iterate_adjustment,
    refuted_priors,
    selection_of,
)
from catseye.reduction.epoch.strengths import ProcessStrength
from catseye.reduction.epoch.telescope_track import motion_of
from catseye.reduction.epoch.unknowns import (
    UNJUDGED,
    build_network,
)
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
    n_path D - n (Pc + dPc + D0 + zero); [GOLDMAN00] eq. B.1 for dPc. The priors are the records' uncertainties.
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
    motion = motion_of(campaign)
    network = build_network(campaign, phases, electronics, settings=settings, motion=motion)
    resolved = resolve_cycles(network, progress)
    if resolved.rejected:
        remaining = without_shots(electronics, set(resolved.rejected))
        network = build_network(campaign, phases, remaining, settings=settings, motion=motion)
    if not network.rangers:
        why = next(iter(resolved.rejected.values()), "no shot on any target has a usable phase and reference")
        raise InputError(f"shots.csv: {why}; nothing to adjust")
    settled = iterate_adjustment(network, resolved.starts, progress)
    for _ in range(JUDGED):
        allowance, before = allowed(settled), settled.network.allowance
        settled = settled._replace(network=replace(settled.network, allowance=allowance))
        if allowance.same(before):
            break
        network = build_network(
            campaign, phases, settled.network.electronics, settings=settings, motion=motion, allowance=allowance
        ).with_strength(settled.network.strength)
        starts = {name: settled.solution.x[network.layout.columns(name)] for name in network.places}
        settled = iterate_adjustment(network, starts, progress, active=selection_of(settled, network))
    return settled, resolved


def coordinates_of(settled: SettledNetwork, *, resolved: Resolved) -> AdjustedCoordinates:
    """Points, ranges, heads and air of an adjusted network.

    settled    result of `iterate_adjustment`
    resolved   whole cycles resolved beforehand
    """
    network, solution, shots = settled
    ranges = ranges_of(network, solution, shots)
    solution = considered(network, solution, shots)
    solution = network.allowance.considered(network.field, solution, network.layout.air)
    layout, campaign = network.layout, network.campaign
    names = sorted([*network.places, *(str(Parameter(ParameterKind.FIXED_POINT, m)) for m in campaign.monuments)])
    columns = np.array([layout.columns(n) for n in names])
    count = dict.fromkeys(names, 0)
    for ranger, target, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True):
        count[ranger] += int(used)
        count[target] += int(used)
    judged = [f.name for f in solution.fits if f.name not in UNJUDGED]
    factor, degrees = solution.variance_factor(judged)

    variance = solution.q.diagonal()

    def estimate(column: int) -> tuple[float, float]:
        return float(solution.x[column]), float(np.sqrt(variance[column]))

    constant_parameters = zip(layout.air, network.field.names, strict=False)  # what follows are errors in time
    air_estimates = {n: estimate(int(k)) for k, n in constant_parameters}
    sound = {line.name: air_estimates[line.name] for line in network.field.lines}
    air = {n: value for n, value in air_estimates.items() if n not in sound}
    wrong, refuted = wrong_records(network, solution, air), refuted_priors(settled)
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
            *record_notes(network, solution, wrong, count),
            *sound_notes(network, solution, ranges, sound),
            *loss_notes(ranges),
            *resolved.notes,
            *cycle_notes(ranges),
        ),
        unresolved=resolved.rejected,
        sound=sound,
        strength=network.strength,
        doubts=doubts_of(network, solution, wrong, refuted),
        refuted=tuple(refuted),
    )
