"""Network of a campaign: its unknowns and their priors."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import MILLIMETRE, PPM, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import InputError
from catseye.estimation.least_squares.bordered import Border
from catseye.estimation.observations.kinds import Distances, Linear, ObservationGroup
from catseye.geometry.frames.rotation import skew
from catseye.names import megahertz
from catseye.records.night.campaign import REFERENCE, ObservedSite
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.allowance import NOTHING, Allowance
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.contradictions.hypotheses import (
    DIRECTIONS,
    EVERYTHING,
    RecordKey,
    is_parameter,
    parameter_of,
    widened,
    with_error,
)
from catseye.reduction.epoch.contradictions.in_common import record_hypotheses
from catseye.reduction.epoch.head import head_unknowns
from catseye.reduction.epoch.motion.telescope_motion import PARTS, TelescopeKnots
from catseye.reduction.epoch.parameter import AIR_KINDS, POINT_KINDS, XYZ, Parameter, ParameterKind
from catseye.reduction.epoch.prior_names import (
    APPROXIMATE,
    BENCHMARKS,
    CONTRADICTED,
    ELECTRONICS,
    FAMILIES,
    GLASS,
    HEADS,
    LEAKAGE,
    LIMITS,
    MONUMENTS,
    OFFSETS,
    PATHS,
    POSTURE,
    REPEATS,
    SOUND,
    THERMOMETERS,
    TRIPLET_AXES,
    TRIPLET_BALLS,
    TRIPLET_SPACINGS,
    ZEROS,
)
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.epoch.self_check import Sorting, sortings
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.strengths import Processes, ProcessStrength, with_processes
from catseye.reduction.site.motion import TelescopeCarrier
from catseye.reduction.site.places import RangedPoint, places_of, unit
from catseye.signal.drift.states import DriftStates

MANY_OF_A_BODY = 150  # typed points from which a body's own place is a parameter
APART = 600  # independent parameters from which each is a single row, not a matrix
BLOCK_KINDS = (ParameterKind.POINT, ParameterKind.NORMAL, ParameterKind.GLASS)
BUSY = 40  # shots on a target, beyond which it forms no block
U_BODY, U_BODY_TURN = 0.03, 5e-4  # m and rad: wider than any real posture error, so that the shots alone decide
WEAK = 0.2  # variance of a mode of the electronics over its shots' noise, below which it is left to these,
SOME_MODES = 1000  # beyond so many
WORST_THERMOMETER_C, WORST_ZERO = 3.0, 0.005  # °C and m: one sigma of what an instrument can have at the worst
LONGEST_TIE = 30  # parameters of one prior: those of a longer one are no block


@dataclass
class UnknownsLayout:
    """Position of each parameter in the vector of the adjustment.

    parameters   in the order of the vector
    start        their start values
    free         False holds one at its start value
    at           first column of each quantity
    points       the same of each point by its name
    """

    parameters: list[Parameter] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    free: list[bool] = field(default_factory=list)
    at: dict[Parameter, int] = field(default_factory=dict)
    points: dict[str, int] = field(default_factory=dict)
    of_air: list[int] = field(default_factory=list)

    def add(
        self, quantity: Parameter, parts: Sequence[str], start: Iterable[float], free: Sequence[bool] | None = None
    ) -> None:
        """Append the parts of a quantity with their start values.

        False in `free` holds one at its value.
        """
        self.at[quantity] = len(self.parameters)
        if quantity.kind in POINT_KINDS:
            self.points[str(quantity)] = len(self.parameters)
        if quantity.kind in AIR_KINDS:
            self.of_air.append(len(self.parameters))
        self.parameters.extend(quantity._replace(part=part or quantity.part) for part in parts)
        self.start.extend(float(s) for s in start)
        self.free.extend(free if free is not None else [True] * len(parts))

    def columns(self, quantity: Parameter | str, count: int = 3) -> np.ndarray:
        """Columns of the first parts of a quantity, or of a point by its name."""
        first = self.points[quantity] if isinstance(quantity, str) else self.at[quantity]
        return first + np.arange(count)

    @property
    def names(self) -> list[str]:
        """Texts of the parameters."""
        return [str(parameter) for parameter in self.parameters]

    @property
    def air(self) -> np.ndarray:
        """Columns of the air's parameters, those of `AirField.parameters`."""
        return np.array(self.of_air, dtype=int)


@dataclass(frozen=True, eq=False)
class CampaignNetwork:
    """Fixed part of the problem: unknowns, priors, and shots.

    states      of a large campaign: ranger's errors between its reference shots, as parameters
    processes   of the air, and of the telescope where it is a campaign's, and
    strength    of them, used in the priors
    allowance   beyond the records
    sortings    of the families that it allows for
    """

    campaign: ObservedSite
    settings: ReductionSettings
    phases: Phases
    electronics: dict[str, ElectronicsPhase]
    places: dict[str, RangedPoint]
    layout: UnknownsLayout
    field: AirField
    priors: list[ObservationGroup]
    motion: TelescopeCarrier | None
    states: dict[str, DriftStates]
    processes: Processes
    strength: ProcessStrength
    allowance: Allowance = NOTHING
    sortings: tuple[Sorting, ...] = ()

    @cached_property
    def border(self) -> Border | None:
        """Border of a large network's elimination; None for a dense solution.

        A target that was fired at with its normal, glass and repeated paths is a block, triplets as wholes; one that
        was fired at so often that it meets most of the border is part of that.
        """
        if not self.states:
            return None
        targets = self.campaign.shots.target
        fired = Counter(targets[k] for e in self.electronics.values() for k in e.shots)
        busy = {n for n, count in fired.items() if count > BUSY} | set(self.rangers)
        for triplet in self.campaign.triplets.values():
            if busy & set(triplet.targets):
                busy |= {triplet.triplet, *triplet.targets}
        on_border = np.array(
            [
                p.kind is not ParameterKind.REPEATS and not (p.kind in BLOCK_KINDS and p.of not in busy)
                for p in self.layout.parameters
            ]
        )
        for prior in self.priors:
            if prior.columns.ndim == 1 and len(prior.columns) > LONGEST_TIE:
                on_border[prior.columns] = True
        fine = np.zeros(len(on_border), dtype=bool)
        for name, states in self.states.items():
            at = self.layout.at[Parameter(ParameterKind.ELECTRONICS, name)]
            fine[at + np.arange(states.count)] = True
        return Border(on_border, fine)

    @property
    def rangers(self) -> list[str]:
        """Rangers that fired a usable shot."""
        return [
            name for name in self.campaign.rangers if name in self.electronics and len(self.electronics[name].shots)
        ]

    def with_strength(self, strength: ProcessStrength) -> "CampaignNetwork":
        """Network with other strengths of its processes."""
        return replace(self, priors=with_processes(self.priors, self.processes, strength), strength=strength)

    @property
    def middle_mjd(self) -> float:
        """Middle of the campaign, MJD; its points hold for that."""
        return middle_of(self.campaign.shots.mjd_utc)

    def of_shots(self, shots: Collection[int]) -> "CampaignNetwork":
        """Network with the same unknowns and some of the shots.

        By their index in the campaign.
        """
        selection = {name: np.isin(e.shots, sorted(shots)) for name, e in self.electronics.items()}
        return replace(
            self,
            electronics={name: e.of(selection[name]) for name, e in self.electronics.items()},
            states={name: states.of(selection[name]) for name, states in self.states.items()},
        )

    def seen_from(self, ranger: str) -> "CampaignNetwork":
        """Network whose air knows the lines of one ranger's shots.

        Usable shots, in their order.
        """
        if not self.field.lines:
            return self
        shots, rows = self.campaign.shots, self.electronics[ranger].shots
        ends = [frozenset((ranger, shots.target[k])) for k in rows]
        return replace(self, field=self.field.on_lines(shots.mjd_utc[rows], ends))


def build_network(
    campaign: ObservedSite,
    phases: Phases,
    electronics: dict[str, ElectronicsPhase],
    *,
    settings: ReductionSettings,
    motion: TelescopeCarrier | None = None,
    also: Collection[str] = (),
    known: Collection[str] = (),
    allowance: Allowance = NOTHING,
) -> CampaignNetwork:
    """Unknowns and priors of a campaign.

    motion   where the telescope moves between the shots; its points are then those of the motion's epoch
    also     rangers and targets that take part though not in the shots
    known    points whose typed positions were used before
    allowance   beyond what the records say

    Unknown are the points that were fired at or from (all of a triplet when one of it was), the monuments' fixed
    points, each firing ranger's zero, residual leakage and other effects of its head by its sheet, the air's offsets
    (thermometers, profile, sounded lines), two tilts of every prism face, and the error of every glass constant.
    """
    places = places_of(campaign)
    fired = {campaign.shots.target[k] for e in electronics.values() for k in e.shots} - {REFERENCE}
    fired |= set(also) & set(places)
    fired |= {t for triplet in campaign.triplets.values() if fired & set(triplet.targets) for t in triplet.targets}
    shooting = {name for name, e in electronics.items() if len(e.shots)} | (set(also) & set(campaign.rangers))
    involved = {n: p for n, p in places.items() if n in fired or n in shooting or n in campaign.monuments}

    layout = UnknownsLayout()
    for name, place in sorted(involved.items()):
        layout.add(Parameter(ParameterKind.POINT, name), XYZ, place.start)
    for name, monument in campaign.monuments.items():
        u = (monument.u_x_mm, monument.u_y_mm, monument.u_z_mm)
        where = np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE
        layout.add(Parameter(ParameterKind.FIXED_POINT, name), XYZ, where, [value > 0.0 for value in u])
    for name in sorted(shooting):
        _add_head(layout, campaign, name)
    typed = {n: p for n, p in involved.items() if p.typed and n not in known}
    for body, count in sorted(Counter(p.body for p in typed.values() if p.body).items()):
        if count >= MANY_OF_A_BODY:
            layout.add(Parameter(ParameterKind.BODY, body), (*XYZ, *(f"about {a}" for a in XYZ)), np.zeros(6))
    air = AirField.of(campaign, settings)
    for parameter in air.parameters:
        layout.add(parameter, [""], [0.0])
    telescope = None
    if motion is None and any(p.body == "dish" for p in involved.values()):
        telescope = _telescope(campaign, places, layout)
    processes, strength = Processes.of(air, telescope, layout.at), ProcessStrength()
    for group in sorted({p.group for n, p in involved.items() if p.group and n in fired}):
        layout.add(Parameter(ParameterKind.NORMAL, group), ["1", "2"], [0.0, 0.0])
    for name in sorted(fired):
        if involved[name].u_constant > 0.0:
            layout.add(Parameter(ParameterKind.GLASS, name), [""], [0.0])
    _add_errors(layout, allowance)
    ours = {n: e.shots for n, e in electronics.items() if len(e.shots)}
    sorts = _sorted(campaign, places, ours, layout, allowance=allowance)
    u_path = 0.0 if motion is None else motion.lasting * campaign.site.ranging.path_index_fluctuation_ppm
    fired_lines = {
        Parameter(ParameterKind.PATH, n, campaign.shots.target[k]) for n, e in electronics.items() for k in e.shots
    }
    lines = sorted(fired_lines, key=str) if u_path > 0.0 else []
    for line in lines:
        layout.add(line, [""], [0.0])
    priors = [
        *_priors(campaign, settings, involved, layout, air, allowance),
        *_families(layout, sorts, allowance),
        *_contradicted(layout, allowance),
        *processes.priors(strength),
        *_typed(settings, typed, layout),
    ]
    if lines:
        columns = [layout.at[line] for line in lines]
        priors.append(_independent(PATHS, columns, np.zeros(len(lines)), np.full(len(lines), u_path)))
    priors = _widened(priors, layout, campaign, involved, allowance)
    network = CampaignNetwork(
        campaign=campaign,
        settings=settings,
        phases=phases,
        electronics=electronics,
        places=involved,
        layout=layout,
        field=air,
        priors=priors,
        motion=motion,
        states={},
        processes=processes,
        strength=strength,
        allowance=allowance,
        sortings=tuple(sorts),
    )
    if any(e.walk is not None for e in electronics.values()):
        network.priors[:] = [_apart(prior) for prior in priors]
        _share_by_states(network)
    return network


def rebuilt(network: CampaignNetwork) -> CampaignNetwork:
    """Network with the unknowns and priors of its campaign and its allowance, where these have changed."""
    return build_network(
        network.campaign,
        network.phases,
        network.electronics,
        settings=network.settings,
        motion=network.motion,
        allowance=network.allowance,
    ).with_strength(network.strength)


def _add_head(layout: UnknownsLayout, campaign: ObservedSite, name: str) -> None:
    """Add a ranger's zero, residual leakages and other effects of its head, in place."""
    layout.add(Parameter(ParameterKind.ZERO, name), [""], [0.0])
    for leakage in _leakages_of(campaign, name):
        layout.add(leakage, [f"real {leakage.part}".strip(), f"imaginary {leakage.part}".strip()], [0.0, 0.0])
    for unknown in head_unknowns(campaign, name):
        layout.add(unknown.quantity, unknown.parts, np.zeros(len(unknown.parts)))


def _add_errors(layout: UnknownsLayout, allowance: Allowance) -> None:
    """Add parameters of contradicted records without priors, in place."""
    for key, sigma in allowance.errors.items():
        if is_parameter(key):
            layout.add(parameter_of(key), DIRECTIONS if len(sigma) > 1 else ("",), np.zeros(len(sigma)))


def middle_of(mjd_utc: np.ndarray) -> float:
    """Half-way between the first shot and the last, MJD."""
    return float(0.5 * (mjd_utc.min() + mjd_utc.max()))


def _telescope(campaign: ObservedSite, places: dict[str, RangedPoint], layout: UnknownsLayout) -> TelescopeKnots | None:
    """Knots of the telescope's expansion.

    Their parameters are added to the layout.
    """
    telescope = TelescopeKnots.of(float(np.ptp(campaign.shots.mjd_utc)) * SECONDS_PER_DAY, places)
    if telescope is not None:
        numbers = [str(i) for i in range(len(telescope.knots))]
        for part in PARTS:
            layout.add(Parameter(ParameterKind.TELESCOPE, part), numbers, np.zeros(len(numbers)))
    return telescope


def _sorted(
    campaign: ObservedSite,
    places: dict[str, RangedPoint],
    shots: dict[str, np.ndarray],
    layout: UnknownsLayout,
    *,
    allowance: Allowance,
) -> list[Sorting]:
    """Bins of the families with an allowance.

    Their parameters are added to the layout.
    """
    if not allowance.families:
        return []
    sorts = [s for s in sortings(campaign, places, shots) if s.family in allowance.families]
    for sorting in sorts:
        bins = [str(i) for i in range(len(sorting.labels))]
        layout.add(Parameter(ParameterKind.FAMILY, sorting.family.name), bins, np.zeros(len(bins)))
    return sorts


def path_ppm(network: CampaignNetwork) -> float:
    """Fluctuation of a path's index between campaigns or epochs, ppm."""
    constant_part = 0.0 if network.motion is None else network.motion.lasting
    return float(network.campaign.site.ranging.path_index_fluctuation_ppm * np.sqrt(1.0 - constant_part**2))


def _share_by_states(network: CampaignNetwork) -> None:
    """Add parameters for errors that shots share, in place.

    The electronics' walk, and the index of repeated lines.
    """
    layout, targets, settings = network.layout, network.campaign.shots.target, network.settings
    per_radian = 0.5 * SPEED_OF_LIGHT / network.campaign.site.ranging.modulation_hz / TWO_PI
    ppm = path_ppm(network)
    all_states: dict[str, DriftStates] = {}
    for name in network.rangers:
        electronics = network.electronics[name]
        assert electronics.walk is not None
        ends = np.array([network.places[targets[k]].start for k in electronics.shots])
        path = ppm * PPM * np.linalg.norm(ends - network.places[name].start, axis=1)
        noise = network.phases.u_phase[electronics.shots] ** 2 + (path / per_radian) ** 2
        all_states[name] = electronics.walk.states(noise)
    strongest = np.sort(np.concatenate([s.strength for s in all_states.values()]))[::-1]
    room = max(settings.most_states - sum(s.count - len(s.strength) for s in all_states.values()), 0)
    required = max(int(np.count_nonzero(strongest > WEAK)), SOME_MODES)
    limit = min(room, required)
    largest_neglected = strongest[limit] if limit < len(strongest) else 0.0
    repeated = []
    for name in network.rangers:
        electronics = network.electronics[name]
        states = all_states[name].without(float(largest_neglected))
        network.states[name] = states
        layout.add(
            Parameter(ParameterKind.ELECTRONICS, name), [str(k) for k in range(states.count)], np.zeros(states.count)
        )
        first = layout.at[Parameter(ParameterKind.ELECTRONICS, name)]
        columns = np.where(states.prior_columns < 0, -1, first + states.prior_columns)
        network.priors.append(
            Linear(ELECTRONICS, np.zeros(len(columns)), np.ones(len(columns)), columns, states.prior_slopes)
        )
        count = Counter(targets[k] for k in electronics.shots)
        repeated += [Parameter(ParameterKind.REPEATS, name, t) for t, n in sorted(count.items()) if n > 1]
    if ppm > 0.0 and repeated:
        for line in repeated:
            layout.add(line, [""], [0.0])
        columns = np.array([layout.at[line] for line in repeated])
        zero = np.zeros(len(repeated))
        network.priors.append(_apart(_independent(REPEATS, columns, zero, np.full(len(repeated), ppm))))


def _independent(name: str, columns: ArrayLike, observed: ArrayLike, sigma: ArrayLike) -> Linear:
    """Prior of independent parameters."""
    at, count = np.asarray(columns), np.size(columns)
    apart = count > APART
    return Linear(
        name,
        np.asarray(observed, dtype=float),
        np.asarray(sigma, dtype=float) ** 2,
        at[:, None] if apart else at,
        np.ones((count, 1)) if apart else np.eye(count),
    )


def _apart(prior: ObservationGroup) -> ObservationGroup:
    """Prior with a row of its own per independent parameter.

    It ties none together; unchanged if it is no such prior.
    """
    if not isinstance(prior, Linear) or prior.columns.ndim == 2 or prior.covariance.ndim != 1:
        return prior
    m, k = prior.matrix.shape
    if m != k or np.count_nonzero(prior.matrix - np.diag(np.diag(prior.matrix))):
        return prior
    return replace(prior, columns=prior.columns[:, None], matrix=np.diag(prior.matrix)[:, None].copy())


def _priors(
    campaign: ObservedSite,
    settings: ReductionSettings,
    involved: dict[str, RangedPoint],
    layout: UnknownsLayout,
    air: AirField,
    allowance: Allowance,
) -> list[ObservationGroup]:
    count = len(air.stations)
    at, sigmas = layout.air, allowance.priors(air)
    priors = [
        *_survey(campaign, involved, layout),
        *_heads(campaign, layout),
        _independent(THERMOMETERS, at[:count], np.zeros(count), sigmas[:count]),
        _independent(LIMITS, at[:count], np.zeros(count), np.full(count, WORST_THERMOMETER_C)),
        _independent("air profile", at[count : count + 1], [0.0], sigmas[count : count + 1]),
        *_sound(air, at[count + 1 : count + 1 + len(air.lines)]),
        *_directions(campaign, settings, layout),
        *_glass(involved, layout),
    ]
    for triplet in campaign.triplets.values():
        if triplet.ball.target in involved:
            priors.extend(_triplet(triplet, involved, layout, settings))
    for benchmark in campaign.benchmarks:
        if benchmark.target in involved and benchmark.ranger in involved:
            u = _positive(benchmark.u_mm * MILLIMETRE, f"benchmarks.csv: {benchmark.target}, u_mm")
            length = benchmark.certified_distance_mm * MILLIMETRE
            priors.append(_length(BENCHMARKS, length, u, layout, benchmark.ranger, benchmark.target))
    return priors


def _families(layout: UnknownsLayout, sorts: Sequence[Sorting], allowance: Allowance) -> list[ObservationGroup]:
    """Common errors of each bin's shots, by the spread they showed."""
    priors: list[ObservationGroup] = []
    for sorting in sorts:
        count = len(sorting.labels)
        columns = layout.columns(Parameter(ParameterKind.FAMILY, sorting.family.name), count)
        sigma = np.full(count, allowance.families[sorting.family])
        priors.append(_independent(FAMILIES, columns, np.zeros(count), sigma))
    return priors


def _contradicted(layout: UnknownsLayout, allowance: Allowance) -> list[ObservationGroup]:
    """Priors of errors of records that have none."""
    priors: list[ObservationGroup] = []
    for key, sigma in allowance.errors.items():
        if is_parameter(key):
            columns = layout.columns(parameter_of(key), len(sigma))
            priors.append(_independent(CONTRADICTED, columns, np.zeros(len(sigma)), sigma))
    return priors


def _widened(
    priors: list[ObservationGroup],
    layout: UnknownsLayout,
    campaign: ObservedSite,
    places: dict[str, RangedPoint],
    allowance: Allowance,
) -> list[ObservationGroup]:
    """Priors, those of contradicted records wider, and the limits of their instruments with them."""
    if not allowance.errors:
        return priors
    result = [_beyond_limits(prior, layout, allowance) if prior.name == LIMITS else prior for prior in priors]
    for hypothesis in record_hypotheses(priors, layout.parameters, campaign, places):
        sigma = np.array(allowance.errors.get(hypothesis.key, ()))
        for i, rows in hypothesis.priors.items() if len(sigma) else ():
            if is_parameter(hypothesis.key):
                result[i] = with_error(result[i], rows, layout.columns(parameter_of(hypothesis.key), len(sigma)))
            else:
                result[i] = widened(result[i], rows, sigma)
    return result


def _beyond_limits(prior: ObservationGroup, layout: UnknownsLayout, allowance: Allowance) -> ObservationGroup:
    """Limits of instruments, wider where records of them are contradicted.

    Of several explanations a limit would speak against the one that has it.
    """
    groups = {ParameterKind.ZERO: RecordGroup.ZEROS, ParameterKind.THERMOMETER: RecordGroup.THERMOMETERS}
    for k, parameter in enumerate(layout.parameters[c] for c in np.ravel(prior.columns).tolist()):
        for of in (parameter.of, EVERYTHING):
            sigma = allowance.errors.get(RecordKey(groups[parameter.kind], of))
            if sigma is not None:
                prior = widened(prior, (np.array([k]), np.eye(1)), np.array(sigma))
    return prior


def _sound(air: AirField, columns: np.ndarray) -> list[ObservationGroup]:
    """Prior of each sounded line's bias.

    One parameter a line, as its length errs in all rows alike.
    """
    if not air.lines:
        return []
    return [_independent(SOUND, columns, np.zeros(len(columns)), [line.sigma for line in air.lines])]


def _typed(
    settings: ReductionSettings, places: dict[str, RangedPoint], layout: UnknownsLayout
) -> list[ObservationGroup]:
    """Priors of typed positions.

    Against the ground, or against the body that carries the point, wherever that stands.

    Each has its own error; a departure of the dish from its nominal posture is common to all points on it. As
    independent errors, two thousand would determine that to a fifth of a millimetre. With few points their sum is
    negligible beside the shots: night-01's points would move by 6 um.
    """
    bodies = {q.of: layout.columns(q, 6) for q in layout.at if q.kind is ParameterKind.BODY}
    typed = sorted(places)
    if not typed:
        return []
    middle = {b: np.mean([p.start for p in places.values() if p.body == b], axis=0) for b in bodies}
    columns, matrix = np.full((len(typed), 3, 7), -1), np.zeros((len(typed), 3, 7))
    for i, name in enumerate(typed):
        columns[i, :, 0], matrix[i, :, 0] = layout.columns(name), 1.0
        body = places[name].body
        if body in bodies:
            columns[i, :, 1:] = bodies[body]
            matrix[i, :, 1:4], matrix[i, :, 4:] = -np.eye(3), skew(places[name].start - middle[body])
    where = np.concatenate([places[n].start for n in typed])
    u_start = np.repeat([places[n].u_typed(settings.u_position) for n in typed], 3)
    if not bodies:
        return [_independent(APPROXIMATE, columns[:, :, 0].ravel(), where, u_start)]
    u = np.repeat([U_BODY, U_BODY_TURN], 3)
    return [
        Linear(APPROXIMATE, where, u_start**2, columns.reshape(-1, 7), matrix.reshape(-1, 7)),
        *(_independent(POSTURE, at, np.zeros(6), u) for at in bodies.values()),
    ]


def _survey(campaign: ObservedSite, involved: dict[str, RangedPoint], layout: UnknownsLayout) -> list[ObservationGroup]:
    """Priors of fixed points as surveyed, and mirrors above them.

    A zero u holds a coordinate and defines the datum.
    """
    priors: list[ObservationGroup] = []
    columns, observed, sigma = [], [], []
    for name, monument in campaign.monuments.items():
        for i, axis in enumerate("xyz"):
            u = getattr(monument, f"u_{axis}_mm") * MILLIMETRE
            if u > 0.0:
                columns.append(layout.at[Parameter(ParameterKind.FIXED_POINT, name)] + i)
                observed.append(getattr(monument, f"{axis}_mm") * MILLIMETRE)
                sigma.append(u)
        mirror = campaign.mirror_of(name)
        fixed = layout.columns(Parameter(ParameterKind.FIXED_POINT, name))
        u_offset = _positive(mirror.u_offset_mm * MILLIMETRE, f"mirrors/{mirror.zp}.toml: u_offset_mm")
        priors.append(
            Linear(
                OFFSETS,
                involved[name].start - np.array(layout.start)[fixed],
                np.full(3, u_offset**2),
                np.concatenate([layout.columns(name), fixed]),
                np.hstack([np.eye(3), -np.eye(3)]),
            )
        )
    if columns:
        priors.append(_independent(MONUMENTS, columns, observed, sigma))
    return priors


def _heads(campaign: ObservedSite, layout: UnknownsLayout) -> list[ObservationGroup]:
    """Priors of the heads of the rangers that fired.

    Zeros, leakage and other effects, as calibrated.
    """
    rangers = [n for n in campaign.rangers if Parameter(ParameterKind.ZERO, n) in layout.at]
    mirrors = [campaign.mirror_of(n) for n in rangers]
    zeros = [layout.at[Parameter(ParameterKind.ZERO, n)] for n in rangers]
    u_zero = [_positive(m.u_d0_mm * MILLIMETRE, f"mirrors/{m.zp}.toml: u_d0_mm") for m in mirrors]
    quadratures = [c for n in rangers for q in _leakages_of(campaign, n) for c in layout.columns(q, 2)]
    u_leakage = [
        _positive(u, f"mirrors/{m.zp}.toml: u_leakage_volt")
        for n, m in zip(rangers, mirrors, strict=True)
        for u in (m.at_modulation(hz).u_leakage_volt for hz in _modulations(campaign, n))
    ]
    return [
        _independent(ZEROS, zeros, np.zeros(len(zeros)), u_zero),
        _independent(LIMITS, zeros, np.zeros(len(zeros)), np.full(len(zeros), WORST_ZERO)),
        _independent(LEAKAGE, quadratures, np.zeros(len(quadratures)), np.repeat(u_leakage, 2)),
        *(_head(campaign, n, layout) for n in rangers if head_unknowns(campaign, n)),
    ]


def _modulations(campaign: ObservedSite, name: str) -> list[float]:
    """Modulation frequencies of a ranger, Hz: the site's, then further ones that it fired at."""
    usual = campaign.site.ranging.modulation_hz
    if not campaign.several_frequencies:
        return [usual]
    mine = np.flatnonzero(np.array(campaign.shots.ranger) == name)
    return [usual, *(hz for hz in np.unique(campaign.modulation_of(mine)).tolist() if hz != usual)]


def _leakage_at(campaign: ObservedSite, name: str, modulation_hz: float) -> Parameter:
    usual = modulation_hz == campaign.site.ranging.modulation_hz
    return Parameter(ParameterKind.LEAKAGE, name, "" if usual else f"at {megahertz(modulation_hz)}")


def _leakages_of(campaign: ObservedSite, name: str) -> list[Parameter]:
    """Residual leakages of a ranger, one a modulation frequency, as each was calibrated by itself."""
    return [_leakage_at(campaign, name, hz) for hz in _modulations(campaign, name)]


def leakage_quantities(campaign: ObservedSite, name: str, shots: np.ndarray) -> list[Parameter]:
    """Residual leakage of each of a ranger's shots (m,), by their index."""
    return [_leakage_at(campaign, name, hz) for hz in campaign.modulation_of(shots).tolist()]


def _head(campaign: ObservedSite, name: str, layout: UnknownsLayout) -> Linear:
    """Prior of the errors of one ranger's head sheet."""
    zp = campaign.mirror_of(name).zp
    columns: list[int] = []
    u: list[float] = []
    for unknown in head_unknowns(campaign, name):
        columns.extend(layout.columns(unknown.quantity, len(unknown.parts)))
        u.extend([_positive(unknown.u, f"mirrors/{zp}.toml: {unknown.key}")] * len(unknown.parts))
    return _independent(HEADS, columns, np.zeros(len(columns)), u)


def _directions(campaign: ObservedSite, settings: ReductionSettings, layout: UnknownsLayout) -> list[ObservationGroup]:
    """Priors of normals' tilts.

    Of prisms and triplets' plates, against their typed directions.
    """
    normals = [quantity for quantity in layout.at if quantity.kind is ParameterKind.NORMAL]
    if not normals:
        return []
    triplets = [n.of in campaign.triplets for n in normals]
    columns = [c for n in normals for c in layout.columns(n, 2)]
    u = np.repeat(np.where(triplets, settings.u_plate_normal, settings.u_normal), 2)
    return [_independent("normals", columns, np.zeros(len(columns)), u)]


def _glass(involved: dict[str, RangedPoint], layout: UnknownsLayout) -> list[ObservationGroup]:
    """Priors of the glass constants' errors.

    Each is common to every shot on its target.
    """
    names = [name for name in sorted(involved) if Parameter(ParameterKind.GLASS, name) in layout.at]
    if not names:
        return []
    columns = [layout.at[Parameter(ParameterKind.GLASS, name)] for name in names]
    return [_independent(GLASS, columns, np.zeros(len(names)), [involved[n].u_constant for n in names])]


def _positive(u: float, where: str) -> float:
    if u <= 0.0:
        raise InputError(f"{where} = 0 (expected above 0: an exact value cannot be weighed against ranges)")
    return u


def _length(name: str, length: float, u: float, layout: UnknownsLayout, origin: str, target: str) -> Distances:
    one = np.ones(1)
    return Distances(
        name=name,
        observed=length * one,
        covariance=u**2 * np.eye(1),
        origin=layout.columns(origin, 1),
        target=layout.columns(target, 1),
        scale=one,
        offset=0.0 * one,
        nuisance=np.zeros((1, 0), dtype=int),
        coefficient=np.zeros((1, 0)),
    )


def _triplet(
    triplet: TripletRecord, involved: dict[str, RangedPoint], layout: UnknownsLayout, settings: ReductionSettings
) -> list[ObservationGroup]:
    """Priors of a triplet's data sheet.

    Ball above the prisms' mid-point, prisms apart by d12 along the axis.

    The axis is good to some tenths of a degree, 3 mm across the unit: it helps only where a prism was not ranged.
    """
    left_prism, right_prism, ball = triplet.left_prism.target, triplet.right_prism.target, triplet.ball.target
    where = f"triplets/{triplet.triplet}.toml"
    normal = involved[left_prism].normal
    assert normal is not None
    along = np.outer(normal, normal)
    u_h = _positive(triplet.u_h_corr_mm * MILLIMETRE, f"{where}: u_h_corr_mm")
    u_lateral = _positive(triplet.u_lateral_mm * MILLIMETRE, f"{where}: u_lateral_mm")
    u_d12 = _positive(triplet.u_d12_mm * MILLIMETRE, f"{where}: u_d12_mm")
    eye = np.eye(3)
    length = triplet.d12_mm * MILLIMETRE
    axis = unit(involved[right_prism].start - involved[left_prism].start)
    across = np.linalg.svd(axis[None])[2][1:]
    return [
        Linear(
            TRIPLET_BALLS,
            triplet.h_corr_mm * MILLIMETRE * normal,
            u_h**2 * along + u_lateral**2 * (eye - along),
            np.concatenate([layout.columns(ball), layout.columns(left_prism), layout.columns(right_prism)]),
            np.hstack([eye, -0.5 * eye, -0.5 * eye]),
        ),
        _length(TRIPLET_SPACINGS, length, u_d12, layout, left_prism, right_prism),
        Linear(
            TRIPLET_AXES,
            np.zeros(2),
            (length * settings.u_plate_normal) ** 2 * np.eye(2),
            np.concatenate([layout.columns(left_prism), layout.columns(right_prism)]),
            np.hstack([-across, across]),
        ),
    ]
