"""What a living site knows from one epoch to the next: one joint estimate, carried on, less sure with time.

Points are kept in the frames that carry them (reflector, alidade, ground), so that a telescope that only tracks leaves
them where they were. Between epochs they may move against their frame: each body (dish, feed arm, alidade) as a whole,
and each point by itself; what the numbers in `Loosening` say is added to the covariance, and nothing else forgets.

States that no shot of an epoch touches (velocities, the reference epoch's places) are updated through their
correlation: K = P_os P_ss^-1, x_o += K dx_s, P_oo += K (P_ss' - P_ss) K', P_os' = K P_ss'. Exact for Gaussians.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.frames.frame import Transform
from catseye.reduction.epoch.parameter import Parameter, ParameterKind, point_parameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loosening:
    """How much less sure the state gets from one epoch to the next; standard uncertainties, chosen.

    body_mm, body_rad             each body as a whole, at once: wind, and what an epoch's mean makes of vibration
    point_mm                      each point of it by itself, at once
    body_mm_per_degree, body_rad_per_degree, point_mm_per_degree   of elevation passed: gravity
    point_mm_per_root_hour        temperature
    ground_mm_per_root_hour       a monument with its ranger, a target on the ground
    zero_mm_per_root_hour         a ranger's zero
    leakage_volt_per_root_hour    each quadrature
    thermometer_c_per_root_hour   an offset
    profile_s                     s, in which the air's profile forgets
    path_s                        s, in which what lasts of a path's index forgets
    velocity_mm_per_s             each coordinate's at first, where velocities are kept
    acceleration_mm_per_s15       mm/s per root second: how velocities change
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


USUAL = Loosening(
    body_mm={"arm": 0.5, "dish": 0.1, "alidade": 0.1},
    body_rad={"arm": 1e-5, "dish": 3e-6, "alidade": 2e-6},
    point_mm={"arm": 0.1, "dish": 0.05, "alidade": 0.05},
)


@dataclass(frozen=True, eq=False)
class Carried:
    """A joint estimate at an instant.

    parameters   (n), as in the adjustment's layout; points in their frames
    x            (n,)
    covariance   (n, n)
    ticks        of the instant
    elevation    rad, of the telescope then
    """

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    ticks: int
    elevation: float

    @property
    def names(self) -> tuple[str, ...]:
        """What people call the parameters."""
        return tuple(str(parameter) for parameter in self.parameters)

    def columns(self, parameters: Sequence[Parameter]) -> NDArray[np.int64]:
        """Where some parameters stand.

        Raises KeyError for one that is not there.
        """
        at = {parameter: i for i, parameter in enumerate(self.parameters)}
        return np.array([at[parameter] for parameter in parameters], dtype=np.int64)

    def points(self, kind: ParameterKind = ParameterKind.POINT) -> dict[str, int]:
        """Where each point's x stands, of scan points and targets or of another kind with places."""
        return {p.of: i for i, p in enumerate(self.parameters) if p.kind is kind and p.part == "x"}


def turned(parameters: Sequence[Parameter], frames: Mapping[str, Transform]) -> tuple[Array, Array]:
    """Matrix (n, n) and shift (n,) that take parameters' points from their frames to the ground; others stay.

    parameters   the three of a point stand together
    frames       point: ground from its frame
    """
    matrix, shift = np.eye(len(parameters)), np.zeros(len(parameters))
    for i, (kind, of, part) in enumerate(parameters):
        if kind is ParameterKind.POINT and part == "x" and of in frames:
            matrix[i : i + 3, i : i + 3] = frames[of].rotation
            shift[i : i + 3] = frames[of].translation
    return matrix, shift


def to_ground(carried: Carried, frames: Mapping[str, Transform]) -> tuple[Array, Array]:
    """x (n,) and covariance (n, n) with points in the ground frame."""
    matrix, shift = turned(carried.parameters, frames)
    return matrix @ carried.x + shift, matrix @ carried.covariance @ matrix.T


def from_ground(
    parameters: tuple[Parameter, ...],
    x: Array,
    covariance: Array,
    *,
    frames: Mapping[str, Transform],
    ticks: int,
    elevation: float,
) -> Carried:
    """The state of points given in the ground frame."""
    matrix, shift = turned(parameters, frames)
    return Carried(parameters, matrix.T @ (x - shift), matrix.T @ covariance @ matrix, ticks, elevation)


def with_unseen(before: Carried, seen: Carried) -> Carried:
    """The state after an epoch: what it saw as it found it, everything else through its correlation.

    before   the prior, all states
    seen     the answer for some or all of them, perhaps with states that were not carried before
    """
    own, now = set(before.parameters), set(seen.parameters)
    shared = [parameter for parameter in seen.parameters if parameter in own]
    outside = [parameter for parameter in before.parameters if parameter not in now]
    if not outside:
        return seen
    s, o, at = before.columns(shared), before.columns(outside), seen.columns(shared)
    prior, after = before.covariance[np.ix_(s, s)], seen.covariance[np.ix_(at, at)]
    gain = np.linalg.solve(prior, before.covariance[np.ix_(s, o)]).T
    x = before.x[o] + gain @ (seen.x[at] - before.x[s])
    own_covariance = before.covariance[np.ix_(o, o)] + gain @ (after - prior) @ gain.T
    cross = gain @ seen.covariance[at]  # new states correlate with the shared ones alone
    whole = np.block([[seen.covariance, cross.T], [cross, 0.5 * (own_covariance + own_covariance.T)]])
    return Carried((*seen.parameters, *outside), np.concatenate([seen.x, x]), whole, seen.ticks, seen.elevation)


def without(carried: Carried, parameters: set[Parameter]) -> Carried:
    """The state without some parameters: a marginal."""
    at = np.array([i for i, parameter in enumerate(carried.parameters) if parameter not in parameters], dtype=int)
    kept = tuple(carried.parameters[i] for i in at)
    return replace(carried, parameters=kept, x=carried.x[at], covariance=carried.covariance[np.ix_(at, at)])


def widened(carried: Carried, pulls: Mapping[Parameter, float]) -> Carried:
    """The state, less sure by what some parameters' priors may be off by.

    pulls   parameter: its prior's doubt over the prior's variance

    Source: consider parameters, [SCHMIDT66]: P + R R', a column P_ob d / s^2 of R for each.
    """
    at = {parameter: i for i, parameter in enumerate(carried.parameters)}
    columns = [(at[parameter], pull) for parameter, pull in pulls.items() if parameter in at]
    if not columns:
        return carried
    reach = np.stack([pull * carried.covariance[:, i] for i, pull in columns], axis=1)
    return replace(carried, covariance=carried.covariance + reach @ reach.T)


def with_reference(carried: Carried, points: Sequence[str]) -> Carried:
    """The state with a copy of some points as they are now, to which later epochs compare; fully correlated."""
    copies = point_parameters(ParameterKind.REFERENCE_PLACE, points)
    bare = without(carried, set(copies))
    at = bare.columns(point_parameters(ParameterKind.POINT, points))
    pick = np.concatenate([np.arange(len(bare.x)), at])
    return replace(
        bare, parameters=(*bare.parameters, *copies), x=bare.x[pick], covariance=bare.covariance[np.ix_(pick, pick)]
    )


def with_velocities(carried: Carried, points: Sequence[str], rule: Loosening) -> Carried:
    """The state with a velocity of zero for points that have none yet."""
    known = set(carried.parameters)
    new = [v for v in point_parameters(ParameterKind.VELOCITY, points) if v not in known]
    n = len(carried.x)
    covariance = np.zeros((n + len(new), n + len(new)))
    covariance[:n, :n] = carried.covariance
    covariance[n:, n:] = (rule.velocity_mm_per_s * MILLIMETRE) ** 2 * np.eye(len(new))
    x = np.concatenate([carried.x, np.zeros(len(new))])
    return replace(carried, parameters=(*carried.parameters, *new), x=x, covariance=covariance)


def carried_on(
    carried: Carried,
    ticks: int,
    seconds: float,
    *,
    elevation: float,
    bodies: Mapping[str, str],
    rule: Loosening,
    profile_sigma: float,
    path_sigma_ppm: float = 0.0,
) -> Carried:
    """The state at a later instant, loosened.

    seconds         since the state's instant; below zero counts as zero
    elevation       rad, of the telescope then
    bodies          point: "dish", "arm", "alidade"; others stand on the ground
    profile_sigma   prior uncertainty of the air's profile, to which it returns
    path_sigma_ppm  the same of what lasts of a path's index

    Source: random walks, and constant velocity where velocities are carried: x += v t, with white acceleration q:
    q t^3/3, q t^2/2, q t.
    """
    t, degrees = max(seconds, 0.0), abs(elevation - carried.elevation) / DEGREE
    x, p = carried.x.copy(), carried.covariance.copy()
    at = {parameter: i for i, parameter in enumerate(carried.parameters)}
    first = carried.points()
    points = [name for name in first if name in bodies]
    p = _with_velocity(x, p, at, points, t, rule)
    for body in ("dish", "arm", "alidade"):
        mine = [n for n in points if bodies[n] == body]
        if mine:
            _loosen_body(x, p, np.array([first[n] for n in mine]), body, t, degrees, rule)
    hours = t / 3600.0
    for parameter, i in at.items():
        kind = parameter.kind
        if kind is ParameterKind.FIXED_POINT:  # the ranger settles with its monument
            step = (rule.ground_mm_per_root_hour * MILLIMETRE) ** 2 * hours
            ranger = parameter._replace(kind=ParameterKind.POINT)
            both = np.array([i, at[ranger]]) if ranger in at else np.array([i])
            p[np.ix_(both, both)] += step
        elif kind is ParameterKind.ZERO:
            p[i, i] += (rule.zero_mm_per_root_hour * MILLIMETRE) ** 2 * hours
        elif kind is ParameterKind.LEAKAGE:
            p[i, i] += rule.leakage_volt_per_root_hour**2 * hours
        elif kind is ParameterKind.PROFILE:
            _return(x, p, i, np.exp(-t / rule.profile_s), profile_sigma)
        elif kind is ParameterKind.PATH:
            _return(x, p, i, np.exp(-t / rule.path_s), path_sigma_ppm)
        elif kind is ParameterKind.THERMOMETER:
            p[i, i] += rule.thermometer_c_per_root_hour**2 * hours
    return replace(carried, x=x, covariance=p, ticks=ticks, elevation=elevation)


def _return(x: Array, p: Array, i: int, kept: float, sigma: float) -> None:
    """Let a parameter go back to zero and its prior, a Gauss-Markov process; in place."""
    x[i] *= kept
    p[i] *= kept
    p[:, i] *= kept
    p[i, i] += (1.0 - kept**2) * sigma**2


def _with_velocity(
    x: Array, p: Array, at: Mapping[Parameter, int], points: Sequence[str], t: float, rule: Loosening
) -> Array:
    """Covariance with places moved on by their velocities; x is moved in place."""
    moving = [n for n in points if Parameter(ParameterKind.VELOCITY, n, "x") in at]
    if not moving:
        return p
    place = np.array([at[p] for p in point_parameters(ParameterKind.POINT, moving)])
    speed = np.array([at[v] for v in point_parameters(ParameterKind.VELOCITY, moving)])
    x[place] += t * x[speed]
    p = p.copy()
    p[place] += t * p[speed]
    p[:, place] += t * p[:, speed]
    q = (rule.acceleration_mm_per_s15 * MILLIMETRE) ** 2
    p[place, place] += q * t**3 / 3.0
    p[place, speed] += q * t**2 / 2.0
    p[speed, place] += q * t**2 / 2.0
    p[speed, speed] += q * t
    return p


def _loosen_body(
    x: Array, p: Array, first: NDArray[np.int64], body: str, t: float, degrees: float, rule: Loosening
) -> None:
    """Let a body shift and turn about its middle, and each of its points move; p in place."""
    columns = (first[:, None] + np.arange(3)).ravel()
    arm = x[columns].reshape(-1, 3)
    arm = arm - arm.mean(axis=0)
    shift = np.hypot(rule.body_mm[body], rule.body_mm_per_degree * degrees) * MILLIMETRE
    turn = np.hypot(rule.body_rad[body], rule.body_rad_per_degree * degrees)
    by_turn = np.zeros((len(first), 3, 3))  # rotation x arm, a column an axis
    by_turn[:, 0, 1], by_turn[:, 0, 2] = arm[:, 2], -arm[:, 1]
    by_turn[:, 1, 0], by_turn[:, 1, 2] = -arm[:, 2], arm[:, 0]
    by_turn[:, 2, 0], by_turn[:, 2, 1] = arm[:, 1], -arm[:, 0]
    rigid = np.concatenate([np.tile(shift * np.eye(3), (len(first), 1)), turn * by_turn.reshape(-1, 3)], axis=1)
    own = (rule.point_mm[body] ** 2 + (rule.point_mm_per_degree * degrees) ** 2) * MILLIMETRE**2
    own += (rule.point_mm_per_root_hour * MILLIMETRE) ** 2 * t / 3600.0
    p[np.ix_(columns, columns)] += rigid @ rigid.T + own * np.eye(len(columns))
