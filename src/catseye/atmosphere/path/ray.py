"""Bent ray between two points in smooth air: length, optical path, directions.

x runs along the chord from a to b, y are the two directions across it. The ray equation d/ds (n dr/ds) = grad n is,
with x as the variable and nothing neglected,

    y'' = (1 + y'²) (dn/dy - y' dn/dx) / n,        y(0) = y(d) = 0

and the two excesses are integrals of small quantities, not differences of large lengths:

    of length          integral of s' - 1,                    s' - 1 = y'²/(1 + sqrt(1 + y'²))
    of optical path    integral of (n_ray - n_chord) + n_ray (s' - 1)

Runge and Kutta's fourth-order steps with all rays at once; the first direction by Newton's method; steps are doubled
until the result converges. `bending` has the closed forms and the bound for any air.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from catseye.errors import ValidityError

FIRST_STEPS, MOST_STEPS = 32, 2048
ROUNDS = 12  # rounds of Newton's method
NUDGE = 1e-6  # step of a first slope, for its derivatives
STEEPEST = 0.3  # largest first slope against the chord
OVER = "over a mirage: no single ray found"
ROUGH = "air too rough: steps exhausted"
FOUND = "found"


class RayAir(NamedTuple):
    """Refractivity and its gradient at points (..., 3).

    refractivity   (...) phase index less one
    gradient       (..., 3) its gradient, 1/m
    group          (...) group index less one, for the optical path; None: the phase index
    """

    refractivity: Any
    gradient: Any
    group: Any = None


class BentRay(NamedTuple):
    """Rays between m pairs of points against their chords.

    length_excess    (m,) length of the ray less the chord, m; never below zero
    optical_excess   (m,) optical path along the ray less the integral of the index along the chord, m
    leaving          (m, 3) rad, the ray's direction at a less the chord's, across the chord; aim this much off b
    arriving         (m, 3) rad, the same of its direction at b
    sag              (m, 3) m, the ray less the chord at half the chord
    status           (m,) FOUND, OVER or ROUGH; numbers are nan unless FOUND
    """

    length_excess: np.ndarray
    optical_excess: np.ndarray
    leaving: np.ndarray
    arriving: np.ndarray
    sag: np.ndarray
    status: np.ndarray


def layered(index_of_height: Callable, group_of_height: Callable | None = None) -> Callable[[np.ndarray], RayAir]:
    """Refractivity of air in level layers, for `bent_ray`.

    index_of_height   function of heights in m, giving phase refractivity and its slope in 1/m
    group_of_height   function of heights in m, giving group refractivity; None: the optical path of the light itself

    The Earth's curvature is neglected: over 120 m it turns the plumb line by 4 arc seconds.
    Source: n = n(z), grad n = (0, 0, dn/dz).

    >>> layered(lambda z: (2.5e-4 + 1e-6 * z, 1e-6 + 0.0 * z))(np.zeros((2, 3))).gradient[0]
    array([0.e+00, 0.e+00, 1.e-06])
    """

    def air(points: np.ndarray) -> RayAir:
        value, slope = index_of_height(points[..., 2])
        gradient = np.zeros(points.shape)
        gradient[..., 2] = slope
        return RayAir(value, gradient, None if group_of_height is None else group_of_height(points[..., 2]))

    return air


def bent_ray(air: Callable[[np.ndarray], RayAir], a, b, *, tolerance=1e-12) -> BentRay:
    """Rays from each a to each b through smooth air.

    air         function of points (..., 3) in m, giving a RayAir; `layered` makes one from profiles of height
    a, b        (m, 3) or (3,) ends, m
    tolerance   m, above zero: change of the excesses on doubling the steps at convergence

    A ray not found or not converged has a status, its numbers are nan: over a mirage there are several rays, or none.
    With the group index the optical path is still along the light's ray: the modulation follows the light. Raises
    ValidityError for ends that are one point or not finite, or a tolerance not above zero.

    Source: derived at the top of this file from the ray equation d/ds(n dr/ds) = grad n.

    >>> air = layered(lambda z: (2.5e-4 - 1e-6 * z, -1e-6 + 0.0 * z))
    >>> ray = bent_ray(air, (0.0, 0.0, 0.0), (120.0, 0.0, 0.0))
    >>> [round(float(v), 4) for v in (ray.length_excess[0] * 1e6, ray.sag[0, 2] * 1e3, ray.leaving[0, 2] * 1e6)]
    [0.072, 1.7996, 59.985]
    """
    a, b = (np.atleast_2d(np.asarray(end, float)) for end in np.broadcast_arrays(a, b))
    frame, chord = _frames(a, b)
    if not tolerance > 0.0:
        raise ValidityError(f"tolerance {tolerance} m is not above zero")
    steps, start = FIRST_STEPS, np.zeros((len(a), 2))
    previous, start, hit = _shot_at(air, a, frame, chord, start, steps)
    settled = np.zeros(len(a), dtype=bool)
    while steps < MOST_STEPS and not np.all(settled | ~hit):
        steps *= 2
        state, start, hit = _shot_at(air, a, frame, chord, start, steps)
        settled = np.all(np.abs(state[:, 4:6] - previous[:, 4:6]) <= tolerance, axis=1)
        previous = state
    good = hit & settled
    status = np.where(good, FOUND, np.where(hit, ROUGH, OVER))
    return _as_ray(previous, start, frame, good, status)


def _frames(a, b):
    """Frames (m, 3, 3): x along the chord, y1, y2 across it; chord lengths (m,)."""
    along = b - a
    chord = np.linalg.norm(along, axis=-1)
    if not np.all(np.isfinite(chord) & (chord > 0.0)):
        first = int(np.flatnonzero(~(np.isfinite(chord) & (chord > 0.0)))[0])
        raise ValidityError(
            f"path {first} from {a[first]} to {b[first]} has zero length or a non-finite end; give two different points"
        )
    x = along / chord[:, None]
    least = np.eye(3)[np.argmin(np.abs(x), axis=-1)]
    y1 = np.cross(x, least)
    y1 /= np.linalg.norm(y1, axis=-1, keepdims=True)
    return np.stack([x, y1, np.cross(x, y1)], axis=1), chord


def _shot_at(air, a, frame, chord, start, steps):
    """Newton's method on the first slope: end states (m, 8), slopes (m, 2), hits.

    The derivatives are reused while each round removes nine tenths of the last miss.
    """
    jacobian, missed = None, np.full(len(a), np.inf)
    for _ in range(ROUNDS):
        end = _integrated(air, a, frame, chord, start, steps)
        miss = np.hypot(end[:, 0], end[:, 1])
        hit = miss <= 1e-14 * chord + 1e-13
        if np.all(hit):
            break
        if jacobian is None or np.any(miss[~hit] > 0.1 * missed[~hit]):
            jacobian = _derivatives(air, a, frame, chord, start, steps, end)
        missed = miss
        step = np.linalg.solve(jacobian, end[:, :2, None])[..., 0]
        start = np.where(hit[:, None], start, np.clip(start - step, -STEEPEST, STEEPEST))
    return end, start, hit


def _derivatives(air, a, frame, chord, start, steps, end):
    """Derivatives (m, 2, 2) of y at b by the first slope.

    The chord's values where b is a focus of rays from a.
    """
    columns = [
        (_integrated(air, a, frame, chord, start + NUDGE * unit, steps)[:, :2] - end[:, :2]) / NUDGE
        for unit in np.eye(2)
    ]
    jacobian = np.stack(columns, axis=-1)
    flat = ~(np.abs(np.linalg.det(jacobian)) > 1e-6 * chord**2)
    jacobian[flat] = chord[flat, None, None] * np.eye(2)
    return jacobian


def _integrated(air, a, frame, chord, start, steps):
    """States (m, 8) at b: y (2), y' (2), length excess, optical excess, middle y (2)."""
    state = np.zeros((len(a), 8))
    state[:, 2:4] = start
    h = chord / steps
    for k in range(steps):
        x = k * h
        k1 = _rates(air, a, frame, x, state)
        k2 = _rates(air, a, frame, x + 0.5 * h, state + 0.5 * h[:, None] * k1)
        k3 = _rates(air, a, frame, x + 0.5 * h, state + 0.5 * h[:, None] * k2)
        k4 = _rates(air, a, frame, x + h, state + h[:, None] * k3)
        state = state + h[:, None] / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if 2 * (k + 1) == steps:
            state[:, 6:8] = state[:, 0:2]
    return state


def _rates(air, a, frame, x, state):
    """Derivatives by x of the state."""
    chord_point = a + x[:, None] * frame[:, 0]
    local = air(chord_point + np.einsum("mi,mij->mj", state[:, 0:2], frame[:, 1:]))
    straight = air(chord_point)
    gradient = np.einsum("mij,mj->mi", frame, np.asarray(local.gradient, float))
    slope = state[:, 2:4]
    square = np.sum(slope**2, axis=1)
    index = 1.0 + np.asarray(local.refractivity, float)
    counted = local.refractivity if local.group is None else local.group
    on_chord = straight.refractivity if straight.group is None else straight.group
    longer = square / (1.0 + np.sqrt(1.0 + square))
    rates = np.zeros(state.shape)
    rates[:, 0:2] = slope
    rates[:, 2:4] = ((1.0 + square) / index)[:, None] * (gradient[:, 1:] - slope * gradient[:, :1])
    rates[:, 4] = longer
    rates[:, 5] = (counted - on_chord) + (1.0 + counted) * longer
    return rates


def _as_ray(end, start, frame, good, status) -> BentRay:
    def across(two):
        return np.where(good[:, None], np.einsum("mi,mij->mj", two, frame[:, 1:]), np.nan)

    def angle(slope):
        size = np.linalg.norm(slope, axis=1)
        return slope * (np.arctan(size) / np.where(size > 0.0, size, 1.0))[:, None]

    return BentRay(
        np.where(good, end[:, 4], np.nan),
        np.where(good, end[:, 5], np.nan),
        across(angle(start)),
        across(angle(end[:, 2:4])),
        across(end[:, 6:8]),
        status,
    )
