"""Filter state of a live site, predicted between epochs.

One joint estimate of growing uncertainty. Points are stored in the frames of their bodies (reflector, alidade, ground),
so that a telescope that only tracks leaves them unchanged. Between epochs each body (dish, feed arm, alidade) may move
as a whole against its frame, and each point by itself: `ProcessNoise` is added to the covariance, and is the only loss
of information.

States that no shot of an epoch observes (velocities, the reference epoch's positions) are updated through their
correlation: K = P_os P_ss^-1, x_o += K dx_s, P_oo += K (P_ss' - P_ss) K', P_os' = K P_ss'. Exact for Gaussians.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.frames.frame import Transform
from catseye.reduction.epoch.parameter import Parameter, ParameterKind, point_parameters


@dataclass(frozen=True)
class ProcessNoise:
    """Process noise between epochs; standard uncertainties, chosen.

    body_mm, body_rad             each body as a whole, per epoch: wind, and the mean of vibration over an epoch
    point_mm                      each point of it by itself, per epoch
    body_mm_per_degree, body_rad_per_degree, point_mm_per_degree   of elevation passed: gravity
    point_mm_per_root_hour        temperature
    ground_mm_per_root_hour       a monument with its ranger, a target on the ground
    zero_mm_per_root_hour         a ranger's zero
    leakage_volt_per_root_hour    each quadrature
    thermometer_c_per_root_hour   an offset
    profile_s                     s, correlation time of the air's profile
    path_s                        s, correlation time of the persistent part of a path's index
    velocity_mm_per_s             each coordinate's initial u, if velocities are estimated
    acceleration_mm_per_s15       mm/s per root second: random walk of velocities
    """

    body_mm: Mapping[str, float]
    body_rad: Mapping[str, float]
    point_mm: Mapping[str, float]
    body_mm_per_degree: float = 2.0
    body_rad_per_degree: float = 5e-5
    point_mm_per_degree: float = 0.5
    point_mm_per_root_hour: float = 0.3
    ground_mm_per_root_hour: float = 0.02
    zero_mm_per_root_hour: float = 0.01
    leakage_volt_per_root_hour: float = 1e-4
    thermometer_c_per_root_hour: float = 0.05
    profile_s: float = 1800.0
    path_s: float = 1800.0
    velocity_mm_per_s: float = 0.02
    acceleration_mm_per_s15: float = 0.002


DEFAULT_NOISE = ProcessNoise(
    body_mm={"arm": 0.5, "dish": 0.1, "alidade": 0.1},
    body_rad={"arm": 1e-5, "dish": 3e-6, "alidade": 2e-6},
    point_mm={"arm": 0.1, "dish": 0.05, "alidade": 0.05},
)


@dataclass(frozen=True, eq=False)
class Carried:
    """Filter state: a joint estimate at an instant.

    parameters   (n), as in the adjustment's layout; points in their bodies' frames
    x            (n,)
    covariance   (n, n)
    ticks        of the instant
    elevation    rad, of the telescope at that instant
    """

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    ticks: int
    elevation: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters for people."""
        return tuple(str(parameter) for parameter in self.parameters)

    def columns(self, parameters: Sequence[Parameter]) -> NDArray[np.int64]:
        """Indices of some parameters.

        Raises KeyError for one that is missing.
        """
        at = {parameter: i for i, parameter in enumerate(self.parameters)}
        return np.array([at[parameter] for parameter in parameters], dtype=np.int64)

    def points(self, kind: ParameterKind = ParameterKind.POINT) -> dict[str, int]:
        """Index of each point's x among positions of a kind."""
        return {p.of: i for i, p in enumerate(self.parameters) if p.kind is kind and p.part == "x"}


def ground_matrix(parameters: Sequence[Parameter], frames: Mapping[str, Transform]) -> tuple[Array, Array]:
    """Matrix (n, n) and shift (n,) to ground; other parameters unchanged.

    parameters   the three of a point are consecutive
    frames       point: ground from its frame
    """
    matrix, shift = np.eye(len(parameters)), np.zeros(len(parameters))
    for i, (kind, of, part) in enumerate(parameters):
        if kind is ParameterKind.POINT and part == "x" and of in frames:
            matrix[i : i + 3, i : i + 3] = frames[of].rotation
            shift[i : i + 3] = frames[of].translation
    return matrix, shift


def to_ground(state: Carried, frames: Mapping[str, Transform]) -> tuple[Array, Array]:
    """State x (n,), covariance (n, n), points in the ground frame."""
    matrix, shift = ground_matrix(state.parameters, frames)
    return matrix @ state.x + shift, matrix @ state.covariance @ matrix.T


def from_ground(
    parameters: tuple[Parameter, ...],
    x: Array,
    covariance: Array,
    *,
    frames: Mapping[str, Transform],
    ticks: int,
    elevation: float,
) -> Carried:
    """State from points in the ground frame."""
    matrix, shift = ground_matrix(parameters, frames)
    return Carried(parameters, matrix.T @ (x - shift), matrix.T @ covariance @ matrix, ticks, elevation)


def update_correlated(before: Carried, estimate: Carried) -> Carried:
    """State after an epoch, unobserved parameters updated through their correlation.

    before     the prior, all states
    estimate   the estimate of some or all of them, perhaps with states that were not in the prior
    """
    prior_parameters, estimated_parameters = set(before.parameters), set(estimate.parameters)
    shared = [parameter for parameter in estimate.parameters if parameter in prior_parameters]
    outside = [parameter for parameter in before.parameters if parameter not in estimated_parameters]
    if not outside:
        return estimate
    s, o, at = before.columns(shared), before.columns(outside), estimate.columns(shared)
    prior, after = before.covariance[np.ix_(s, s)], estimate.covariance[np.ix_(at, at)]
    gain = np.linalg.solve(prior, before.covariance[np.ix_(s, o)]).T
    x = before.x[o] + gain @ (estimate.x[at] - before.x[s])
    outside_covariance = before.covariance[np.ix_(o, o)] + gain @ (after - prior) @ gain.T
    cross = gain @ estimate.covariance[at]  # new states correlate with the shared ones alone
    joint = np.block([[estimate.covariance, cross.T], [cross, 0.5 * (outside_covariance + outside_covariance.T)]])
    return Carried(
        (*estimate.parameters, *outside), np.concatenate([estimate.x, x]), joint, estimate.ticks, estimate.elevation
    )


def marginal(state: Carried, parameters: set[Parameter]) -> Carried:
    """The state without some parameters: a marginal."""
    at = np.array([i for i, parameter in enumerate(state.parameters) if parameter not in parameters], dtype=int)
    remaining = tuple(state.parameters[i] for i in at)
    return replace(state, parameters=remaining, x=state.x[at], covariance=state.covariance[np.ix_(at, at)])


def inflated(state: Carried, pulls: Mapping[Parameter, float]) -> Carried:
    """The state, covariance inflated by possible errors of priors.

    pulls   parameter: its prior's possible error over the prior's variance

    Source: consider parameters, [SCHMIDT66]: P + R R', a column P_ob d / s^2 of R for each.
    """
    at = {parameter: i for i, parameter in enumerate(state.parameters)}
    columns = [(at[parameter], pull) for parameter, pull in pulls.items() if parameter in at]
    if not columns:
        return state
    reach = np.stack([pull * state.covariance[:, i] for i, pull in columns], axis=1)
    return replace(state, covariance=state.covariance + reach @ reach.T)


def with_reference(state: Carried, points: Sequence[str]) -> Carried:
    """The state with copies of some points as reference positions."""
    copies = point_parameters(ParameterKind.REFERENCE_PLACE, points)
    bare = marginal(state, set(copies))
    at = bare.columns(point_parameters(ParameterKind.POINT, points))
    pick = np.concatenate([np.arange(len(bare.x)), at])
    return replace(
        bare, parameters=(*bare.parameters, *copies), x=bare.x[pick], covariance=bare.covariance[np.ix_(pick, pick)]
    )


def with_velocities(state: Carried, points: Sequence[str], noise: ProcessNoise) -> Carried:
    """The state with zero velocities for points without any."""
    present = set(state.parameters)
    new = [v for v in point_parameters(ParameterKind.VELOCITY, points) if v not in present]
    n = len(state.x)
    covariance = np.zeros((n + len(new), n + len(new)))
    covariance[:n, :n] = state.covariance
    covariance[n:, n:] = (noise.velocity_mm_per_s * MILLIMETRE) ** 2 * np.eye(len(new))
    x = np.concatenate([state.x, np.zeros(len(new))])
    return replace(state, parameters=(*state.parameters, *new), x=x, covariance=covariance)


def predict(
    state: Carried,
    ticks: int,
    seconds: float,
    *,
    elevation: float,
    bodies: Mapping[str, str],
    noise: ProcessNoise,
    profile_sigma: float,
    path_sigma_ppm: float = 0.0,
) -> Carried:
    """The state predicted for a later instant, with process noise.

    seconds         since the state's instant; below zero counts as zero
    elevation       rad, of the telescope then
    bodies          point: "dish", "arm", "alidade"; others are on the ground
    profile_sigma   prior uncertainty of the air's profile, to which it returns
    path_sigma_ppm  the same for the persistent part of a path's index

    Source: random walks, and constant velocity where velocities are estimated: x += v t, with white acceleration q:
    q t^3/3, q t^2/2, q t.
    """
    t, degrees = max(seconds, 0.0), abs(elevation - state.elevation) / DEGREE
    x, p = state.x.copy(), state.covariance.copy()
    at = {parameter: i for i, parameter in enumerate(state.parameters)}
    first = state.points()
    points = [name for name in first if name in bodies]
    p = _with_velocity(x, p, at, points, t, noise)
    for body in ("dish", "arm", "alidade"):
        members = [n for n in points if bodies[n] == body]
        if members:
            _add_body_noise(x, p, np.array([first[n] for n in members]), body, t, degrees, noise)
    hours = t / 3600.0
    for parameter, i in at.items():
        kind = parameter.kind
        if kind is ParameterKind.FIXED_POINT:  # a ranger moves with its monument
            step = (noise.ground_mm_per_root_hour * MILLIMETRE) ** 2 * hours
            ranger = parameter._replace(kind=ParameterKind.POINT)
            columns = np.array([i, at[ranger]]) if ranger in at else np.array([i])
            p[np.ix_(columns, columns)] += step
        elif kind is ParameterKind.ZERO:
            p[i, i] += (noise.zero_mm_per_root_hour * MILLIMETRE) ** 2 * hours
        elif kind is ParameterKind.LEAKAGE:
            p[i, i] += noise.leakage_volt_per_root_hour**2 * hours
        elif kind is ParameterKind.PROFILE:
            _return(x, p, i, np.exp(-t / noise.profile_s), profile_sigma)
        elif kind is ParameterKind.PATH:
            _return(x, p, i, np.exp(-t / noise.path_s), path_sigma_ppm)
        elif kind is ParameterKind.THERMOMETER:
            p[i, i] += noise.thermometer_c_per_root_hour**2 * hours
    return replace(state, x=x, covariance=p, ticks=ticks, elevation=elevation)


def _return(x: Array, p: Array, i: int, factor: float, sigma: float) -> None:
    """Decay a parameter to its prior (Gauss-Markov process), in place."""
    x[i] *= factor
    p[i] *= factor
    p[:, i] *= factor
    p[i, i] += (1.0 - factor**2) * sigma**2


def _with_velocity(
    x: Array, p: Array, at: Mapping[Parameter, int], points: Sequence[str], t: float, noise: ProcessNoise
) -> Array:
    """Covariance with points moved by velocities; x in place."""
    moving = [n for n in points if Parameter(ParameterKind.VELOCITY, n, "x") in at]
    if not moving:
        return p
    place = np.array([at[p] for p in point_parameters(ParameterKind.POINT, moving)])
    speed = np.array([at[v] for v in point_parameters(ParameterKind.VELOCITY, moving)])
    x[place] += t * x[speed]
    p = p.copy()
    p[place] += t * p[speed]
    p[:, place] += t * p[:, speed]
    q = (noise.acceleration_mm_per_s15 * MILLIMETRE) ** 2
    p[place, place] += q * t**3 / 3.0
    p[place, speed] += q * t**2 / 2.0
    p[speed, place] += q * t**2 / 2.0
    p[speed, speed] += q * t
    return p


def _add_body_noise(
    x: Array, p: Array, first: NDArray[np.int64], body: str, t: float, degrees: float, noise: ProcessNoise
) -> None:
    """Add process noise of a body and its points, in place."""
    columns = (first[:, None] + np.arange(3)).ravel()
    arm = x[columns].reshape(-1, 3)
    arm = arm - arm.mean(axis=0)
    shift = np.hypot(noise.body_mm[body], noise.body_mm_per_degree * degrees) * MILLIMETRE
    turn = np.hypot(noise.body_rad[body], noise.body_rad_per_degree * degrees)
    by_turn = np.zeros((len(first), 3, 3))  # rotation x arm, a column an axis
    by_turn[:, 0, 1], by_turn[:, 0, 2] = arm[:, 2], -arm[:, 1]
    by_turn[:, 1, 0], by_turn[:, 1, 2] = -arm[:, 2], arm[:, 0]
    by_turn[:, 2, 0], by_turn[:, 2, 1] = arm[:, 1], -arm[:, 0]
    rigid = np.concatenate([np.tile(shift * np.eye(3), (len(first), 1)), turn * by_turn.reshape(-1, 3)], axis=1)
    variance = (noise.point_mm[body] ** 2 + (noise.point_mm_per_degree * degrees) ** 2) * MILLIMETRE**2
    variance += (noise.point_mm_per_root_hour * MILLIMETRE) ** 2 * t / 3600.0
    p[np.ix_(columns, columns)] += rigid @ rigid.T + variance * np.eye(len(columns))
