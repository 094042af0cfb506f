"""From phases to coordinates: one adjustment of points, ranger zeros, leakage, air and prism normals together."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import InputError
from catseye.estimation.adjustment import Fit, Solution
from catseye.estimation.observations import Distances, Linear, Observations
from catseye.estimation.robust import adjust_robustly
from catseye.geometry.antenna import ground_from_reflector
from catseye.geometry.frame import Transform
from catseye.geometry.mount import gamma, scan_point
from catseye.optics.prism import obliquity_correction, obliquity_slope
from catseye.records.campaign import REFERENCE, Campaign
from catseye.reduction.air import AirField
from catseye.reduction.ranges import Electronics, Phases, Progress
from catseye.reduction.settings import Settings
from catseye.signal.cycles import fraction, whole_cycles

FIXED_POINT = "-F"  # a monument's Kelvin fixed point is ZY101-F, its ranger's scan point ZY101
PASSES = 6  # cap of passes in which cycles, incidence and air are renewed from the adjusted coordinates
SETTLED = 1e-6  # m, no coordinate moves further in the last pass
APPROXIMATE = "approximate positions"
THERMOMETERS = "thermometers"


@dataclass(frozen=True, eq=False)
class Place:
    """A point of the network that can be ranged to.

    name       of the point
    kind       "ranger", "prism", "ball" or "hollow"
    start      (3,) m, ground frame
    normal     (3,) of a prism's entry face, ground frame, or None
    height     m, of a prism
    constant   m, range constant Pc of its glass; 0 for hollow cubes
    group      what its normal's error is shared with: its own name, or its triplet's; "" for none
    typed      its start is an approximate position that somebody typed
    """

    name: str
    kind: str
    start: np.ndarray
    normal: np.ndarray | None = None
    height: float = 0.0
    constant: float = 0.0
    group: str = ""
    typed: bool = True


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
    glass, obliquity  Pc and dPc, metres
    zero, leakage     estimated corrections of the ranger's zero and of the rest of its leakage, to the range
    range_            distance scan point to target as this shot gives it, all corrections applied
    u_range           its standard uncertainty: noise, electronics and path; systematic parameters not counted
    residual          range_ minus the adjusted distance
    standardised      test statistic of the adjustment
    redundancy        of the adjustment
    detectable        smallest error that the adjustment finds, m
    used              took part
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
    range_: np.ndarray
    u_range: np.ndarray
    residual: np.ndarray
    standardised: np.ndarray
    redundancy: np.ndarray
    detectable: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The adjusted network.

    points       names in order; places their records where they can be ranged to (fixed points are no places)
    x            (points, 3) m, ground frame
    covariance   (3 points, 3 points) m^2, order x y z of each point
    start        (points, 3) m, where the adjustment began
    shots        used shots at each point, fired there or from there
    ranges       every shot with a phase
    zeros        ranger: correction to its range, m, and standard uncertainty
    leakage      ranger: what is left of its leakage, V (real, imaginary)
    air          name: estimate and standard uncertainty of thermometer offsets (°C) and profile
    refractivity_ppm   mean group refractivity over the used paths
    variance_factor, degrees_of_freedom   of everything but the typed positions
    fits         of all groups, for reports
    notes        what a person should know, one line each
    """

    points: tuple[str, ...]
    places: dict[str, Place]
    x: np.ndarray
    covariance: np.ndarray
    start: np.ndarray
    shots: np.ndarray
    ranges: RangeShots
    zeros: dict[str, tuple[float, float]]
    leakage: dict[str, tuple[float, float]]
    air: dict[str, tuple[float, float]]
    refractivity_ppm: float
    variance_factor: float
    degrees_of_freedom: float
    status: str
    fits: tuple[Fit, ...]
    notes: tuple[str, ...]

    def index(self, name: str) -> int:
        """Row of a point."""
        return self.points.index(name)

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Covariance (3k, 3k) of some points, in the order given."""
        columns = (3 * np.array([self.index(n) for n in names])[:, None] + np.arange(3)).ravel()
        return self.covariance[np.ix_(columns, columns)]


def nominal_frame(campaign: Campaign) -> Transform:
    """Reflector to ground at the campaign's posture, if the telescope were rigid and perfectly placed."""
    reflector = campaign.site.frames.reflector
    return ground_from_reflector(
        np.radians(campaign.site.campaign.azimuth_deg),
        np.radians(campaign.site.campaign.elevation_deg),
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )


def places_of(campaign: Campaign) -> dict[str, Place]:
    """Everything that can be ranged to, by name, at its approximate position in the ground frame.

    Source: README of the campaign layout; [PARKER04] eqs. 2.3-2.7 for scan points, 2.44 for the reflector frame;
    [GOLDMAN00] figure 10 for the triplet: ball = mid-point + h_corr * normal, normal towards the prism side.
    """
    to_ground = {"reflector": nominal_frame(campaign), "ground": Transform("ground", "ground", np.eye(3), np.zeros(3))}
    places: dict[str, Place] = {}
    for name, monument in campaign.monuments.items():
        mirror = campaign.mirror_of(name)
        places[name] = Place(
            name,
            "ranger",
            scan_point(
                np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE,
                gamma(monument.alpha1_rad, monument.alpha2_rad, monument.alpha3_rad),
                np.array([mirror.dx_mm, mirror.dy_mm, mirror.dz_mm]) * MILLIMETRE,
            ),
            typed=False,
        )
    for ranger in campaign.feedarm.ranger:
        where = to_ground["reflector"].points(np.array(ranger.nominal_scan_point_mm) * MILLIMETRE)
        places[ranger.name] = Place(ranger.name, "ranger", where)
    for target in campaign.targets.values():
        frame = to_ground[target.frame]
        where = frame.points(np.array(target.position_mm) * MILLIMETRE)
        if target.type == "prism" and target.normal is not None and target.height_mm and target.pc_mm is not None:
            places[target.name] = Place(
                target.name,
                "prism",
                where,
                _unit(frame.directions(target.normal)),
                target.height_mm * MILLIMETRE,
                target.pc_mm * MILLIMETRE,
                target.name,
            )
        else:
            places[target.name] = Place(target.name, "hollow", where)
    for triplet in campaign.triplets.values():
        frame = to_ground[triplet.frame]
        ball = frame.points(np.array(triplet.nominal_position_mm) * MILLIMETRE)
        normal, axis = _unit(frame.directions(triplet.normal)), _unit(frame.directions(triplet.axis))
        middle = ball - triplet.h_corr_mm * MILLIMETRE * normal
        half = 0.5 * triplet.d12_mm * MILLIMETRE * axis
        for prism, where in ((triplet.left_prism, middle - half), (triplet.right_prism, middle + half)):
            places[prism.target] = Place(
                prism.target,
                "prism",
                where,
                normal,
                prism.height_mm * MILLIMETRE,
                prism.pc_mm * MILLIMETRE,
                triplet.triplet,
            )
        places[triplet.ball.target] = Place(
            triplet.ball.target, "ball", ball, constant=triplet.ball.pc_b_mm * MILLIMETRE
        )
    return places


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


@dataclass
class _Layout:
    """Where each parameter stands in the vector of the adjustment."""

    names: list[str] = field(default_factory=list)
    at: dict[str, int] = field(default_factory=dict)
    start: list[float] = field(default_factory=list)
    free: list[bool] = field(default_factory=list)

    def add(self, name: str, parts: Sequence[str], start: Sequence[float], free: Sequence[bool] | None = None) -> None:
        self.at[name] = len(self.names)
        self.names.extend(f"{name} {part}".strip() for part in parts)
        self.start.extend(float(s) for s in start)
        self.free.extend(free if free is not None else [True] * len(parts))

    def columns(self, name: str, count: int = 3) -> np.ndarray:
        return self.at[name] + np.arange(count)


@dataclass(frozen=True, eq=False)
class _Network:
    """The fixed part of the problem: what is unknown, what is known beforehand, which shots see what."""

    campaign: Campaign
    settings: Settings
    phases: Phases
    electronics: dict[str, Electronics]
    places: dict[str, Place]
    layout: _Layout
    field: AirField
    priors: list[Observations]

    @property
    def rangers(self) -> list[str]:
        return [name for name in self.campaign.rangers if name in self.electronics and len(self.electronics[name].shots)]


def adjust_coordinates(
    campaign: Campaign,
    phases: Phases,
    electronics: dict[str, Electronics],
    settings: Settings,
    progress: Progress | None = None,
) -> Coordinates:
    """Coordinates of everything that was ranged to or from, with full covariance.

    Cycles, incidence angles and the air along the paths follow from the coordinates, so the adjustment is repeated
    until they no longer change. Wrong shots are found in the first pass and tested again in each.

    Source: [PARKER04] eq. 5.18 and 5.19 for the range, in optical metres: N c/2f - phase c/(4 pi f) =
    n_path D - n (Pc + dPc + D0 + zero); [GOLDMAN00] eq. B.1 for dPc. The priors are the records' uncertainties.
    """
    network = _network(campaign, phases, electronics, settings)
    if not network.rangers:
        raise InputError("shots.csv: no shot on any target has a usable phase and reference; nothing to adjust")
    layout = network.layout
    x = np.array(layout.start)
    free = np.array(layout.free)
    points = [layout.columns(name) for name in network.places if name in layout.at]
    active, solution = None, None
    for turn in range(PASSES):
        if progress is not None:
            progress("adjustment", turn, PASSES)
        shots = [_shot_group(network, name, x) for name in network.rangers]
        groups: list[Observations] = [group for group, _ in shots] + network.priors
        removable = [np.full(len(g.observed), i < len(shots) or g.name == THERMOMETERS) for i, g in enumerate(groups)]
        before = x
        solution = adjust_robustly(
            x,
            groups,
            removable,
            points=points,
            free=free,
            active=active,
            names=layout.names,
            critical=settings.critical,
        )
        x, active = solution.x, [f.active for f in solution.fits]
        if turn and np.max(np.abs((x - before)[_coordinate_columns(network)])) < SETTLED:
            break
    if progress is not None:
        progress("adjustment", PASSES, PASSES)
    assert solution is not None
    return _coordinates(network, solution.require_converged(), [parts for _, parts in shots])


def _coordinate_columns(network: _Network) -> np.ndarray:
    names = [n for n in network.places if n in network.layout.at]
    return np.concatenate([network.layout.columns(n) for n in names])


def _network(
    campaign: Campaign, phases: Phases, electronics: dict[str, Electronics], settings: Settings
) -> _Network:
    places = places_of(campaign)
    fired = {campaign.shots.target[k] for e in electronics.values() for k in e.shots} - {REFERENCE}
    fired |= {t for triplet in campaign.triplets.values() if fired & set(triplet.targets) for t in triplet.targets}
    shooting = {name for name, e in electronics.items() if len(e.shots)}
    seen = {n: p for n, p in places.items() if n in fired or n in shooting or n in campaign.monuments}

    layout = _Layout()
    for name, place in sorted(seen.items()):
        layout.add(name, "xyz", place.start)
    for name, monument in campaign.monuments.items():
        u = (monument.u_x_mm, monument.u_y_mm, monument.u_z_mm)
        where = np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE
        layout.add(name + FIXED_POINT, "xyz", where, [value > 0.0 for value in u])
    for name in sorted(shooting):
        layout.add(f"zero {name}", [""], [0.0])
        layout.add(f"leakage {name}", ["real", "imaginary"], [0.0, 0.0])
    air = AirField.of(campaign, settings)
    layout.add("air", air.names, np.zeros(len(air.names)))
    for group in sorted({p.group for n, p in seen.items() if p.group and n in fired}):
        layout.add(f"normal {group}", ["1", "2"], [0.0, 0.0])
    priors = _priors(campaign, settings, seen, layout, air)
    return _Network(campaign, settings, phases, electronics, seen, layout, air, priors)


def _independent(name: str, columns: Sequence[int], observed: Sequence[float], sigma: Sequence[float]) -> Linear:
    count = len(columns)
    return Linear(
        name,
        np.asarray(observed, dtype=float),
        np.asarray(sigma, dtype=float) ** 2,
        np.asarray(columns),
        np.eye(count),
    )


def _priors(
    campaign: Campaign, settings: Settings, seen: dict[str, Place], layout: _Layout, air: AirField
) -> list[Observations]:
    priors: list[Observations] = []
    columns, observed, sigma = [], [], []
    for name, monument in campaign.monuments.items():
        place, mirror = seen[name], campaign.mirror_of(name)
        for axis in "xyz":
            u = getattr(monument, f"u_{axis}_mm") * MILLIMETRE
            if u > 0.0:
                columns.append(layout.at[name + FIXED_POINT] + "xyz".index(axis))
                observed.append(getattr(monument, f"{axis}_mm") * MILLIMETRE)
                sigma.append(u)
        fixed = layout.columns(name + FIXED_POINT)
        offset = place.start - np.array(layout.start)[fixed]
        priors.append(
            Linear(
                "mirror offsets",
                offset,
                np.eye(3) * _positive(mirror.u_offset_mm * MILLIMETRE, f"mirrors/{mirror.zp}.toml: u_offset_mm") ** 2,
                np.concatenate([layout.columns(name), fixed]),
                np.hstack([np.eye(3), -np.eye(3)]),
            )
        )
    if columns:
        priors.append(_independent("monuments", columns, observed, sigma))

    rangers = [n for n in campaign.rangers if f"zero {n}" in layout.at]
    mirrors = [campaign.mirror_of(n) for n in rangers]
    priors.append(
        _independent(
            "ranger zeros",
            [layout.at[f"zero {n}"] for n in rangers],
            np.zeros(len(rangers)),
            [_positive(m.u_d0_mm * MILLIMETRE, f"mirrors/{m.zp}.toml: u_d0_mm") for m in mirrors],
        )
    )
    priors.append(
        _independent(
            "leakage",
            [c for n in rangers for c in layout.columns(f"leakage {n}", 2)],
            np.zeros(2 * len(rangers)),
            np.repeat([_positive(m.u_leakage_volt, f"mirrors/{m.zp}.toml: u_leakage_volt") for m in mirrors], 2),
        )
    )
    count = len(air.names)
    at = layout.columns("air", count)
    priors.append(_independent(THERMOMETERS, at[:-1], np.zeros(count - 1), air.sigmas[:-1]))
    priors.append(_independent("air profile", at[-1:], [0.0], air.sigmas[-1:]))

    normals = [name for name in layout.at if name.startswith("normal ")]
    if normals:
        u_normal = [
            settings.u_plate_normal if n.removeprefix("normal ") in campaign.triplets else settings.u_normal
            for n in normals
        ]
        priors.append(
            _independent(
                "normals",
                [c for n in normals for c in layout.columns(n, 2)],
                np.zeros(2 * len(normals)),
                np.repeat(u_normal, 2),
            )
        )
    typed = [n for n, p in sorted(seen.items()) if p.typed]
    if typed:
        priors.append(
            _independent(
                APPROXIMATE,
                [c for n in typed for c in layout.columns(n)],
                np.concatenate([seen[n].start for n in typed]),
                np.full(3 * len(typed), settings.u_position),
            )
        )
    for triplet in campaign.triplets.values():
        if triplet.ball.target in seen:
            priors.extend(_triplet(triplet, seen, layout, settings))
    for benchmark in campaign.benchmarks:
        if benchmark.target in seen and benchmark.ranger in seen:
            u = _positive(benchmark.u_mm * MILLIMETRE, f"benchmarks.csv: {benchmark.target}, u_mm")
            length = benchmark.certified_distance_mm * MILLIMETRE
            priors.append(_length("benchmarks", length, u, layout, benchmark.ranger, benchmark.target))
    return priors


def _positive(u: float, where: str) -> float:
    if u <= 0.0:
        raise InputError(f"{where} = 0 (expected above 0: an exact value cannot be weighed against ranges)")
    return u


def _length(name: str, length: float, u: float, layout: _Layout, origin: str, target: str) -> Distances:
    one = np.ones(1)
    return Distances(
        name,
        length * one,
        u**2 * np.eye(1),
        layout.columns(origin, 1),
        layout.columns(target, 1),
        one,
        0.0 * one,
        np.zeros((1, 0), dtype=int),
        np.zeros((1, 0)),
    )


def _triplet(triplet, seen: dict[str, Place], layout: _Layout, settings: Settings) -> list[Observations]:
    """What a data sheet says of a unit: ball above the prisms' mid-point, prisms apart by d12 along the axis.

    The axis is good to some tenths of a degree, 3 mm across the unit: it only helps where a prism was not ranged.
    """
    left, right, ball = triplet.left_prism.target, triplet.right_prism.target, triplet.ball.target
    where = f"triplets/{triplet.triplet}.toml"
    normal = seen[left].normal
    assert normal is not None
    along = np.outer(normal, normal)
    u_h = _positive(triplet.u_h_corr_mm * MILLIMETRE, f"{where}: u_h_corr_mm")
    u_lateral = _positive(triplet.u_lateral_mm * MILLIMETRE, f"{where}: u_lateral_mm")
    u_d12 = _positive(triplet.u_d12_mm * MILLIMETRE, f"{where}: u_d12_mm")
    eye = np.eye(3)
    length = triplet.d12_mm * MILLIMETRE
    axis = _unit(seen[right].start - seen[left].start)
    across = np.linalg.svd(axis[None])[2][1:]
    return [
        Linear(
            "triplet balls",
            triplet.h_corr_mm * MILLIMETRE * normal,
            u_h**2 * along + u_lateral**2 * (eye - along),
            np.concatenate([layout.columns(ball), layout.columns(left), layout.columns(right)]),
            np.hstack([eye, -0.5 * eye, -0.5 * eye]),
        ),
        _length("triplet spacings", length, u_d12, layout, left, right),
        Linear(
            "triplet axes",
            np.zeros(2),
            (length * settings.u_plate_normal) ** 2 * np.eye(2),
            np.concatenate([layout.columns(left), layout.columns(right)]),
            np.hstack([-across, across]),
        ),
    ]


@dataclass(frozen=True, eq=False)
class _ShotParts:
    """The pieces of one ranger's ranges, for the record of every correction."""

    name: str
    electronics: Electronics
    target: tuple[str, ...]
    phase: np.ndarray
    cycles: np.ndarray
    margin: np.ndarray
    refractivity: np.ndarray
    incidence: np.ndarray
    glass: np.ndarray
    obliquity: np.ndarray
    leakage_slope: np.ndarray


def _shot_group(network: _Network, name: str, x: np.ndarray) -> tuple[Distances, _ShotParts]:
    """One ranger's shots as distances in optical metres, with everything that depends on where things are."""
    campaign, layout, places = network.campaign, network.layout, network.places
    electronics, phases = network.electronics[name], network.phases
    rows = electronics.shots
    targets = tuple(campaign.shots.target[k] for k in rows)
    m = len(rows)
    origin = np.full(m, layout.at[name])
    target = np.array([layout.at[t] for t in targets])
    a = x[origin[:, None] + np.arange(3)]
    b = x[target[:, None] + np.arange(3)]
    towards = a - b
    distance = np.linalg.norm(towards, axis=1)
    towards = towards / distance[:, None]

    air_columns = layout.columns("air", len(network.field.names))
    air = network.field.along(campaign.shots.mjd_utc[rows], a, b, x[air_columns])
    n = 1.0 + air.refractivity
    d0 = campaign.mirror_of(name).d0_mm * MILLIMETRE
    glass = np.array([places[t].constant for t in targets])
    incidence, obliquity, normal_columns, normal_slopes = _obliquity(network, targets, towards, x)

    half = 0.5 * SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz  # in vacuum: optical metres
    phase = fraction(phases.phase[rows], electronics.phase)
    coarse = n * (distance - glass - obliquity - d0 - x[layout.at[f"zero {name}"]])
    cycles, margin = whole_cycles(coarse, phase, half)
    observed = (cycles - phase / TWO_PI) * half

    # Leakage left over, complex dL: a phasor A exp(i phi) turns by Im(dL exp(-i phi)) / A, reference and target alike.
    per_radian = -half / TWO_PI
    lit, cube = phases.phasor[rows], electronics.reference
    turn = np.stack([(1.0 / p).imag for p in (lit, cube)]), np.stack([(1.0 / p).real for p in (lit, cube)])
    leakage_slope = per_radian * np.stack([t[0] - t[1] for t in turn], axis=1)

    covariance = np.diag((per_radian * phases.u_phase[rows]) ** 2) + per_radian**2 * electronics.covariance
    path = campaign.site.ranging.path_index_fluctuation_ppm * PPM * distance
    same = np.array(targets)[:, None] == np.array(targets)
    covariance += same * np.outer(path, path)

    group = Distances(
        name=name,
        observed=observed,
        covariance=covariance,
        origin=origin,
        target=target,
        scale=n,
        offset=-n * (glass + obliquity + d0)
        - distance * (air.slopes @ x[air_columns])
        + n * np.sum(normal_slopes * x[normal_columns], axis=1),
        nuisance=np.concatenate(
            [
                np.full((m, 1), layout.at[f"zero {name}"]),
                np.broadcast_to(layout.columns(f"leakage {name}", 2), (m, 2)),
                np.broadcast_to(air_columns, (m, len(air_columns))),
                normal_columns,
            ],
            axis=1,
        ),
        coefficient=np.concatenate(
            [-n[:, None], leakage_slope, distance[:, None] * air.slopes, -n[:, None] * normal_slopes], axis=1
        ),
    )
    parts = _ShotParts(
        name, electronics, targets, phase, cycles, margin, air.refractivity, incidence, glass, obliquity, leakage_slope
    )
    return group, parts


def _obliquity(
    network: _Network, targets: Sequence[str], towards: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Incidence and dPc at the estimated normals, and the derivatives of dPc by each normal's two tilts.

    A shot on anything but a prism gets the first parameter's column with a zero derivative.
    """
    m = len(targets)
    ratio = network.campaign.site.ranging.bk7_to_air_group_index_ratio
    incidence, correction, slopes = np.zeros(m), np.zeros(m), np.zeros((m, 2))
    columns = np.zeros((m, 2), dtype=int)
    prisms = [k for k, t in enumerate(targets) if network.places[t].normal is not None]
    for k in prisms:
        place = network.places[targets[k]]
        columns[k] = network.layout.columns(f"normal {place.group}", 2)
        normal, first, second = _tilted(place.normal, x[columns[k]])
        cosine = min(float(normal @ towards[k]), 1.0)
        incidence[k] = np.arccos(cosine)
        if cosine <= 0.0:  # the face looks away: no such shot returns; judged as if grazing, and rejected by its range
            cosine = 0.0
        correction[k] = float(obliquity_correction(place.height, ratio, cosine))
        sine = np.sqrt(1.0 - cosine**2)
        if sine > 1e-6:
            by_angle = float(obliquity_slope(place.height, ratio, cosine))
            slopes[k] = by_angle * -np.array([first @ towards[k], second @ towards[k]]) / sine
    return incidence, correction, columns, slopes


def _tilted(normal: np.ndarray, tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The normal tilted by two small angles (rad) along two directions of the face, and those directions."""
    across = np.linalg.svd(normal[None])[2][1:]
    return _unit(normal + across.T @ tilt), across[0], across[1]


def _coordinates(network: _Network, solution: Solution, parts: list[_ShotParts]) -> Coordinates:
    layout, campaign = network.layout, network.campaign
    names = sorted([*network.places, *(m + FIXED_POINT for m in campaign.monuments)])
    columns = np.concatenate([layout.columns(n) for n in names])
    ranges = _ranges(network, solution, parts)
    count = {n: 0 for n in names}
    for ranger, target, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True):
        count[ranger] += int(used)
        count[target] += int(used)
    judged = [f.name for f in solution.fits if f.name != APPROXIMATE]
    factor, degrees = solution.variance_factor(judged)

    def estimate(column: int) -> tuple[float, float]:
        return float(solution.x[column]), float(np.sqrt(solution.covariance[column, column]))

    air = {n: estimate(layout.at["air"] + i) for i, n in enumerate(network.field.names)}
    leakage_at = {n: layout.columns(f"leakage {n}", 2) for n in network.rangers}
    used_paths = ranges.refractivity[ranges.used]
    return Coordinates(
        points=tuple(names),
        places=network.places,
        x=solution.x[columns].reshape(-1, 3),
        covariance=solution.covariance[np.ix_(columns, columns)],
        start=np.array(layout.start)[columns].reshape(-1, 3),
        shots=np.array([count[n] for n in names]),
        ranges=ranges,
        zeros={n: estimate(layout.at[f"zero {n}"]) for n in network.rangers},
        leakage={n: (float(solution.x[c[0]]), float(solution.x[c[1]])) for n, c in leakage_at.items()},
        air=air,
        refractivity_ppm=float(used_paths.mean() / PPM) if len(used_paths) else float("nan"),
        variance_factor=factor,
        degrees_of_freedom=degrees,
        status=solution.status,
        fits=solution.fits,
        notes=tuple(_notes(network, solution, air)),
    )


def _ranges(network: _Network, solution: Solution, parts: list[_ShotParts]) -> RangeShots:
    x, layout = solution.x, network.layout
    fits = solution.fits[: len(parts)]
    zero, leakage, range_, u_range, residual, detectable = [], [], [], [], [], []
    for part, fit in zip(parts, fits, strict=True):
        n = 1.0 + part.refractivity
        own_zero = np.full(len(n), x[layout.at[f"zero {part.name}"]])
        at = x[layout.at[part.name] + np.arange(3)]
        to = np.array([x[layout.columns(t)] for t in part.target])
        zero.append(own_zero)
        leakage.append(-(part.leakage_slope @ x[layout.columns(f"leakage {part.name}", 2)]) / n)
        residual.append(fit.residual / n)
        range_.append(np.linalg.norm(to - at, axis=1) + fit.residual / n)
        u_range.append(fit.sigma / n)
        detectable.append(fit.detectable_error / n)
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
        glass=join([p.glass for p in parts]),
        obliquity=join([p.obliquity for p in parts]),
        zero=join(zero),
        leakage=join(leakage),
        range_=join(range_),
        u_range=join(u_range),
        residual=join(residual),
        standardised=join([f.standardised for f in fits]),
        redundancy=join([f.redundancy for f in fits]),
        detectable=join(detectable),
        used=join([f.active for f in fits]),
    )


def _notes(network: _Network, solution: Solution, air: dict[str, tuple[float, float]]) -> list[str]:
    """What the adjustment noticed about the records, one line each."""
    notes = []
    for fit in solution.fits:
        if fit.name == THERMOMETERS:
            for name, active in zip(network.field.names, fit.active, strict=False):
                value, u = air[name]
                if not active:
                    notes.append(f"{name}'s thermometer lies: it reads {value:+.2f} °C too high (u {u:.2f} °C)")
    typed = [n for n, p in sorted(network.places.items()) if p.typed]
    moved = np.array([np.linalg.norm(solution.x[network.layout.columns(n)] - network.places[n].start) for n in typed])
    unit = {t: triplet.triplet for triplet in network.campaign.triplets.values() for t in triplet.targets}
    usual = float(np.median(moved)) / 1.538 if len(moved) > 5 else np.inf  # median of chi with 3 degrees of freedom
    wrong = {unit.get(n, n): d for n, d in zip(typed, moved, strict=True) if d > 4.0 * usual}
    notes += [
        f"{n}: its typed position is {d / MILLIMETRE:.0f} mm off, the others' some {np.median(moved) / MILLIMETRE:.0f}"
        for n, d in wrong.items()
    ]
    return notes
