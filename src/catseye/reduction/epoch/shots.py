"""A ranger's shots as observations.

Distances in optical metres, with every correction and its derivative.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, PPM, SECONDS_PER_DAY, TWO_PI
from catseye.estimation.least_squares.conflict import SharedErrors
from catseye.estimation.observations.kinds import Distances, MovingDistances
from catseye.optics.retroreflector.prism import obliquity_correction, obliquity_slope
from catseye.reduction.epoch.air.field import PathAir
from catseye.reduction.epoch.contradictions.hypotheses import WITHOUT_PRIOR, ShotLines, parameter_of, slopes_of
from catseye.reduction.epoch.head import HeadCorrections, head_corrections, head_noise, radian_length
from catseye.reduction.epoch.motion.scatter import sway_variance
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import ElectronicsPhase
from catseye.reduction.epoch.self_check import unit_of
from catseye.reduction.epoch.telescope_track import buffer_middles
from catseye.reduction.epoch.unknowns import CampaignNetwork, leakage_quantities, path_ppm
from catseye.reduction.site.motion import shaken
from catseye.signal.cycles.whole import fraction, unwrapped_length, whole_cycles

ShotGroup = Distances | MovingDistances


@dataclass(frozen=True, eq=False)
class ShotParts:
    """Components of one ranger's ranges, for the record of every correction.

    name, electronics  of the ranger; its other fields have a row a shot
    target             names
    phase              rad, the target's after the electronics', as measured
    cycles, margin     whole half wavelengths, and distance of the coarse length from another number, m
    refractivity       n_g - 1 along the path
    incidence          rad, on a prism's face
    glass, obliquity   Pc and dPc, m
    leakage_columns    (m, 2) parameters of the residual leakage at each shot's modulation frequency
    leakage_slope      (m, 2) m/V, of the observed optical length by the residual leakage
    head               correction of the range for the ranger's head: `head.at(x)` with the estimated parameters
    distance           m, of the adjusted points
    sight              lines, as errors of records change them
    variance           m^2, of the optical length, errors shared with other shots included
    lasting            parameters of the telescope's motion since the middle and of averages that are allowed for, -1
                       for none; and the derivatives of the optical length by them, m
    shared             parameters of the shared errors, -1 for none; and the derivatives of the optical length
                       by them, m: of a large campaign, else None
    """

    name: str
    electronics: ElectronicsPhase
    target: tuple[str, ...]
    phase: np.ndarray
    cycles: np.ndarray
    margin: np.ndarray
    refractivity: np.ndarray
    incidence: np.ndarray
    glass: np.ndarray
    obliquity: np.ndarray
    leakage_columns: np.ndarray
    leakage_slope: np.ndarray
    head: HeadCorrections
    distance: np.ndarray
    sight: ShotLines
    variance: np.ndarray
    lasting: tuple[np.ndarray, np.ndarray]
    shared: tuple[np.ndarray, np.ndarray]

    def lasting_error(self, x: np.ndarray) -> np.ndarray:
        """Errors (m,), m, of the optical lengths beyond the points.

        By the parameters x.
        """
        columns, slopes = self.lasting
        return np.asarray(np.sum(np.where(columns < 0, 0.0, x[columns]) * slopes, axis=1))

    @property
    def shared_errors(self) -> SharedErrors | None:
        """Shared errors as parameters; None where covariances hold them."""
        columns, slopes = self.shared
        return SharedErrors(columns, slopes, self.variance) if columns.shape[1] else None

    def shared_error(self, x: np.ndarray) -> np.ndarray:
        """Shared errors (m,), m, of the optical lengths, by the parameters x."""
        columns, slopes = self.shared
        return np.asarray(np.sum(np.where(columns < 0, 0.0, x[columns]) * slopes, axis=1))


@dataclass(frozen=True, eq=False)
class _Sights:
    """Begin and end of one ranger's m shots, at their own times.

    origin, target   (m,) columns of the ranger's and the targets' x
    a, b             (m, 3) m, ground: scan points and targets
    distance         (m,) m
    towards          (m, 3) unit, from target to ranger
    turns            rotation and shift of both ends from the network's epoch to each shot; None without motion
    """

    origin: np.ndarray
    target: np.ndarray
    a: np.ndarray
    b: np.ndarray
    distance: np.ndarray
    towards: np.ndarray
    turns: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None

    @staticmethod
    def of(network: CampaignNetwork, name: str, targets: tuple[str, ...], x: np.ndarray) -> "_Sights":
        layout, m = network.layout, len(targets)
        origin = np.full(m, layout.points[name])
        target = np.array([layout.points[t] for t in targets])
        a = x[origin[:, None] + np.arange(3)]
        b = x[target[:, None] + np.arange(3)]
        turns = None
        if network.motion is not None:
            times = buffer_middles(network.campaign, network.electronics[name].shots)
            turns = *network.motion.carried((name,) * m, times), *network.motion.carried(targets, times)
            a, b = (np.einsum("mij,mj->mi", r, p) + s for p, r, s in ((a, *turns[:2]), (b, *turns[2:])))
        towards = a - b
        distance = np.linalg.norm(towards, axis=1)
        return _Sights(
            origin=origin, target=target, a=a, b=b, distance=distance, towards=towards / distance[:, None], turns=turns
        )

    @property
    def ranger_seen(self) -> np.ndarray:
        """Ranger (m, 3) seen from a target at rest."""
        return self.towards if self.turns is None else np.einsum("mji,mj->mi", self.turns[2], self.towards)

    @property
    def sent(self) -> np.ndarray:
        """Vector (m, 3), m, from scan point to target at rest.

        As a ranger that stands still sends its beam.
        """
        return self.b - self.a if self.turns is None else np.einsum("mji,mj->mi", self.turns[0], self.b - self.a)


def shot_group(network: CampaignNetwork, name: str, x: np.ndarray) -> tuple[ShotGroup, ShotParts]:
    """One ranger's shots as distances in optical metres.

    Where the network moves, x are the points at its epoch, and each shot finds them where the telescope carried them.
    """
    campaign, layout, places = network.campaign, network.layout, network.places
    electronics, phases = network.electronics[name], network.phases
    rows = electronics.shots
    targets = tuple(campaign.shots.target[k] for k in rows)
    sights = _Sights.of(network, name, targets, x)
    distance = sights.distance
    air = network.field.along(campaign.shots.mjd_utc[rows], sights.a, sights.b, x[layout.air])
    n = 1.0 + air.refractivity
    d0 = campaign.mirror_of(name).d0_mm * MILLIMETRE
    glass = np.array([places[t].constant for t in targets])
    incidence, obliquity, normal_columns, normal_slopes = _obliquity(network, targets, sights.ranger_seen, x)

    half = campaign.half_wavelengths(rows)  # in vacuum: optical metres
    phase = fraction(phases.phase[rows], electronics.phase)
    lit, cube = phases.phasor[rows], electronics.reference
    head = head_corrections(
        campaign,
        name,
        layout.at,
        sight=sights.sent,
        phase=phase,
        amplitude=np.abs(lit),
        reference_amplitude=np.abs(cube),
        per_radian=radian_length(campaign.modulation_of(rows), n),
    )
    zero = x[layout.at[Parameter(ParameterKind.ZERO, name)]]
    expanding, growth = _expansion(network, name, targets, sights)
    families = _families(network, name, n, distance)
    expansion = np.sum(np.where(expanding < 0, 0.0, x[expanding]) * growth, axis=1)
    coarse = n * (distance + expansion - glass - obliquity - d0 - zero - head.at(x))
    cycles, margin = whole_cycles(coarse, phase, half)
    if phases.cycles is not None:
        cycles = np.where(phases.cycles[rows] < 0, cycles, phases.cycles[rows])
    observed = unwrapped_length(cycles, phase, half)
    sight = _sight(network, name, targets, sights, index=n, optical=observed)
    contradicted = _contradicted(network, sight)
    per_radian = -half / TWO_PI
    jitter = n**2 * _jitter(network, name, targets)
    shared = _shared(network, name, targets, distance=distance, per_radian=per_radian)
    leakage = leakage_quantities(campaign, name, rows)
    covariance, variance = _covariance(network, name, targets, distance, per_radian)
    parts = ShotParts(
        name=name,
        electronics=electronics,
        target=targets,
        phase=phase,
        cycles=cycles,
        margin=margin,
        refractivity=air.refractivity,
        incidence=incidence,
        glass=glass,
        obliquity=obliquity,
        leakage_columns=np.array([layout.columns(quantity, 2) for quantity in leakage]).reshape(-1, 2),
        leakage_slope=_leakage_slope(per_radian, lit, cube),
        head=head,
        distance=distance,
        sight=sight,
        variance=variance + jitter,
        lasting=(
            np.concatenate([expanding, families[0], contradicted[0]], axis=1),
            np.concatenate([n[:, None] * growth, families[1], contradicted[1]], axis=1),
        ),
        shared=shared,
    )
    offset = (
        -n * (glass + obliquity + d0 + head.value)
        - distance * air_parameters(network, air, x)
        + n * np.sum(normal_slopes * x[normal_columns], axis=1)
    )
    nuisance, coefficient = _nuisance(network, parts, sights, air, (normal_columns, normal_slopes))
    covariance += jitter if covariance.ndim == 1 else np.diag(jitter)
    origin, target = sights.origin, sights.target
    if sights.turns is None:
        return Distances(
            name=name,
            observed=observed,
            covariance=covariance,
            origin=origin,
            target=target,
            scale=n,
            offset=offset,
            nuisance=nuisance,
            coefficient=coefficient,
        ), parts
    origin_turn, origin_shift, target_turn, target_shift = sights.turns
    moving = MovingDistances(
        name=name,
        observed=observed,
        covariance=covariance,
        origin=origin,
        target=target,
        origin_turn=origin_turn,
        origin_shift=origin_shift,
        target_turn=target_turn,
        target_shift=target_shift,
        scale=n,
        offset=offset,
        nuisance=nuisance,
        coefficient=coefficient,
    )
    return moving, parts


def _jitter(network: CampaignNetwork, name: str, targets: tuple[str, ...]) -> np.ndarray:
    """Variance (m,), m^2, of the distances by the telescope's jitter, and by the sway that is allowed for.

    By the campaign's table or the epoch's.
    """
    table, body, bodies = network.campaign.jitter, network.places[name].body, [network.places[t].body for t in targets]
    sway = sway_variance(body, bodies, network.allowance.sway)
    if table is None:
        return sway if network.motion is None else sway + network.motion.jitter(name, targets)
    times = network.campaign.shots.mjd_utc[network.electronics[name].shots]
    return sway + shaken(body, bodies, table.mm(times))


def _leakage_slope(per_radian: np.ndarray, lit: np.ndarray, cube: np.ndarray) -> np.ndarray:
    """Derivative of the optical length by residual leakage, (m, 2) m/V.

    Residual leakage is complex, dL.

    A phasor A exp(i phi) turns by Im(dL exp(-i phi)) / A, reference and target alike.
    """
    turn = np.stack([(1.0 / p).imag for p in (lit, cube)]), np.stack([(1.0 / p).real for p in (lit, cube)])
    return per_radian[:, None] * np.stack([t[0] - t[1] for t in turn], axis=1)


def _covariance(
    network: CampaignNetwork,
    name: str,
    targets: tuple[str, ...],
    distance: np.ndarray,
    per_radian: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of the optical lengths, m^2, and its diagonal.

    Noise, the electronics' walk, the path's fluctuation.

    (m, m), or for a large campaign the variances (m,) of the shots' independent errors.
    """
    electronics = network.electronics[name]
    noise = (per_radian * network.phases.u_phase[electronics.shots]) ** 2
    for u in head_noise(network.campaign.mirror_of(name)).values():
        noise = noise + (per_radian * u) ** 2
    path = path_ppm(network) * PPM * distance
    eddies = (network.strength.eddies_ppm * PPM * distance) ** 2
    noise = noise + eddies
    if electronics.walk is not None:
        alone = np.array([Parameter(ParameterKind.REPEATS, name, t) not in network.layout.at for t in targets])
        independent = noise + per_radian**2 * network.states[name].own + np.where(alone, path**2, 0.0)
        return independent, noise + per_radian**2 * electronics.covariance + path**2
    covariance = np.diag(noise) + np.outer(per_radian, per_radian) * electronics.covariance
    same_target = np.array(targets)[:, None] == np.array(targets)
    covariance += same_target * np.outer(path, path)
    return covariance, np.diag(covariance).copy()


def _shared(
    network: CampaignNetwork, name: str, targets: tuple[str, ...], *, distance: np.ndarray, per_radian: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (m, w) of one ranger's shared errors, and derivatives.

    -1 for none; derivatives in m.
    """
    m = len(targets)
    if name not in network.states:
        return np.zeros((m, 0), dtype=int), np.zeros((m, 0))
    states, at = network.states[name], network.layout.at
    first = at[Parameter(ParameterKind.ELECTRONICS, name)]
    lines = np.array([at.get(Parameter(ParameterKind.REPEATS, name, t), -1) for t in targets])
    columns = np.concatenate([np.where(states.columns < 0, -1, first + states.columns), lines[:, None]], axis=1)
    slopes = np.concatenate([per_radian[:, None] * states.slopes, (PPM * distance * (lines >= 0))[:, None]], axis=1)
    return columns, slopes


def _nuisance(
    network: CampaignNetwork,
    parts: ShotParts,
    sights: "_Sights",
    air: PathAir,
    normals: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (m, q) of all parameters but points, with derivatives.

    Derivatives of the optical lengths.

    normals   columns (m, 2) of the faces' tilts, and slopes of dPc by them
    """
    distance, constant_count = sights.distance, air.slopes.shape[1]
    layout, targets, m = network.layout, parts.target, len(parts.target)
    n = 1.0 + parts.refractivity
    paths = np.array([[layout.at.get(Parameter(ParameterKind.PATH, parts.name, t), -1)] for t in targets])  # -1: none
    constants = [Parameter(ParameterKind.GLASS, t) for t in targets]
    has_residual = np.array([c in layout.at for c in constants])
    residuals = np.array([layout.at.get(c, -1) for c in constants])
    columns = [
        paths,
        np.full((m, 1), layout.at[Parameter(ParameterKind.ZERO, parts.name)]),
        parts.leakage_columns,
        np.broadcast_to(layout.air[:constant_count], (m, constant_count)),
        layout.air[air.columns],
        parts.lasting[0],
        normals[0],
        residuals[:, None],
        parts.head.columns,
        parts.shared[0],
    ]
    slopes = [
        PPM * distance[:, None] * (paths >= 0),
        -n[:, None],
        parts.leakage_slope,
        distance[:, None] * air.slopes,
        distance[:, None] * air.column_slopes,
        parts.lasting[1],
        -n[:, None] * normals[1],
        (-n * has_residual)[:, None],
        -n[:, None] * parts.head.slopes,
        parts.shared[1],
    ]
    return np.concatenate(columns, axis=1), np.concatenate(slopes, axis=1)


def air_parameters(network: CampaignNetwork, air: PathAir, x: np.ndarray) -> np.ndarray:
    """Change (m,) of the index by the air's parameters x.

    By its slopes.
    """
    values = x[network.layout.air]
    return np.asarray(
        air.slopes @ values[: air.slopes.shape[1]] + np.sum(values[air.columns] * air.column_slopes, axis=1)
    )


def _families(
    network: CampaignNetwork, name: str, index: np.ndarray, distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (m, f) of bins' common errors, and their derivatives.

    Errors beyond the model, -1 for none.
    """
    m = len(distance)
    columns, slopes = np.full((m, len(network.sortings)), -1), np.zeros((m, len(network.sortings)))
    for i, sorting in enumerate(network.sortings):
        bins = sorting.bins(name, network.electronics[name].shots)
        first = network.layout.at[Parameter(ParameterKind.FAMILY, sorting.family.name)]
        columns[:, i] = np.where(bins < 0, -1, first + bins)
        slopes[:, i] = np.where(bins < 0, 0.0, unit_of(sorting.family, index, distance))
    return columns, slopes


def _sight(
    network: CampaignNetwork,
    name: str,
    targets: tuple[str, ...],
    sights: _Sights,
    *,
    index: np.ndarray,
    optical: np.ndarray,
) -> ShotLines:
    """Lines of one ranger's shots, as errors of records change them."""
    times = network.campaign.shots.mjd_utc[network.electronics[name].shots]
    temperature, pressure, humidity = network.field.smoothed(times).mean(axis=1).T
    drier = humidity - np.where(humidity > 1.0, 1.0, 0.0)
    more, less = (network.field.refractivity_of(temperature, pressure, h) for h in (drier + 1.0, drier))
    return ShotLines(
        name=name,
        targets=targets,
        towards=sights.towards,
        index=index,
        distance=sights.distance,
        optical=optical,
        seconds=(times - network.middle_mjd) * SECONDS_PER_DAY,
        per_hpa=(index - 1.0) / pressure,
        per_percent=more - less,
        bodies=(network.places[name].body, tuple(network.places[t].body for t in targets)),
        modulation_hz=network.campaign.modulation_of(network.electronics[name].shots),
    )


def _contradicted(network: CampaignNetwork, sight: ShotLines) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (m, e) of errors of records without priors, and their derivatives."""
    m = len(sight.targets)
    columns, slopes = [np.zeros((m, 0), dtype=int)], [np.zeros((m, 0))]
    for key in network.allowance.errors:
        if key.group in WITHOUT_PRIOR:
            by = slopes_of(key, sight)
            at = network.layout.columns(parameter_of(key), by.shape[1])
            columns.append(np.broadcast_to(at, by.shape))
            slopes.append(by)
    return np.concatenate(columns, axis=1), np.concatenate(slopes, axis=1)


def _expansion(
    network: CampaignNetwork, name: str, targets: tuple[str, ...], sights: _Sights
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (m, 2 parts) of the telescope's motion, with derivatives.

    Derivatives of the distance by the motion at each shot.
    """
    knots, m = network.processes.telescope, len(targets)
    if knots is None:
        return np.zeros((m, 0), dtype=int), np.zeros((m, 0))
    shots = network.electronics[name].shots
    seconds = (network.campaign.shots.mjd_utc[shots] - network.middle_mjd) * SECONDS_PER_DAY
    at, share = knots.columns(seconds)
    by_part = knots.slopes(name, targets, sights.a, sights.b, sights.towards)
    slopes = by_part[:, :, None] * share[:, None]
    columns = network.processes.moving.T[at].transpose(0, 2, 1)
    columns = np.where((slopes == 0.0) | (at < 0)[:, None], -1, columns)
    return columns.reshape(m, -1), slopes.reshape(m, -1)


def other_ends(group: ShotGroup, row: int, column: int, *, x: np.ndarray) -> np.ndarray:
    """Other end of a shot relative to a point at rest, (3,) m, ground.

    The point's x is in `column`.

    A moving point is at rest, and the other end moves the opposite way: |B p + b - a| = |p - B'(a - b)|.
    """
    origin, target = int(group.origin[row]), int(group.target[row])
    opposite = x[(target if origin == column else origin) + np.arange(3)]
    if isinstance(group, Distances):
        return np.asarray(opposite)
    ends = (group.origin_turn[row], group.origin_shift[row]), (group.target_turn[row], group.target_shift[row])
    (turn, shift), (own_turn, own_shift) = ends[::-1] if origin == column else ends
    return np.asarray(own_turn.T @ (turn @ opposite + shift - own_shift))


def _obliquity(
    network: CampaignNetwork, targets: Sequence[str], towards: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Incidence and dPc at the estimated normals, with derivatives.

    Derivatives of dPc by each normal's two tilts.

    A shot on another reflector than a prism gets column -1, none, with a zero derivative.
    """
    m = len(targets)
    ranging = network.campaign.site.ranging
    ratio, bends = ranging.bk7_to_air_group_index_ratio, ranging.bk7_to_air_phase_index_ratio
    incidence, correction, slopes = np.zeros(m), np.zeros(m), np.zeros((m, 2))
    columns = np.full((m, 2), -1)
    at = np.array([k for k, t in enumerate(targets) if network.places[t].normal is not None], dtype=int)
    if not len(at):
        return incidence, correction, columns, slopes
    prisms = [network.places[targets[k]] for k in at]
    height = np.array([p.height for p in prisms])
    first = np.array([network.layout.at[Parameter(ParameterKind.NORMAL, p.group)] for p in prisms])
    columns[at] = first[:, None] + np.arange(2)
    across = np.array([p.across for p in prisms])
    normal = np.array([p.normal for p in prisms]) + np.einsum("mi,mij->mj", x[columns[at]], across)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    angle = np.arccos(np.clip(np.sum(normal * towards[at], axis=1), -1.0, 1.0))
    # No return from behind the face: such a shot counts as grazing, and fails on its range.
    cosine = np.cos(np.minimum(angle, 0.5 * np.pi))
    incidence[at] = angle
    correction[at] = obliquity_correction(height, ratio, cosine, phase=bends)
    by_angle = obliquity_slope(height, ratio, cosine, phase=bends)
    oblique = angle > 1e-6  # at normal incidence the correction is flat
    sine = np.where(oblique, np.sin(angle), 1.0)
    turned = -by_angle * oblique / sine
    slopes[at] = turned[:, None] * np.einsum("mij,mj->mi", across, towards[at])
    return incidence, correction, columns, slopes
