"""Simple solids in the way of a beam; first hit.

A box, a sphere, a cone or a dish.

A path is a segment, start (..., 3) to end (..., 3) in metres in the solid's own frame; places on it are shares, 0 at
its start and 1 at its end. `first_hit` gives the share at which the path is first in the solid (0 if it begins
there), infinity where it is clear. Intersections are exact; a path that only touches may count or not.

`grown` makes a solid larger, for a beam that is not a line: exactly for a sphere, by at least the margin for all
others.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import rz


@dataclass(frozen=True, eq=False)
class SolidBox:
    """Box turned about z.

    centre   (3,) m
    size     (3,) m, above 0: full lengths along its axes
    turn     rad: of its x axis from the frame's, by the right hand about z

    >>> SolidBox((5.0, 0.0, 0.0), (2.0, 2.0, 2.0)).first_hit([0.0, 0.0, 0.0], [10.0, 0.0, 0.0]).item()
    0.4
    """

    centre: ArrayLike
    size: ArrayLike
    turn: float = 0.0

    def __post_init__(self) -> None:
        _vector("centre", self.centre)
        if np.any(_vector("size", self.size) <= 0.0):
            raise ValidityError(f"size {np.asarray(self.size).tolist()} m of a box is not above 0")

    def first_hit(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Share (...) of the path at first entry; inf if clear.

        Source: the slabs between opposite faces: inside is where all three are. Exact.
        """
        to_box = rz(self.turn)
        p = (np.asarray(start, dtype=float) - np.asarray(self.centre, dtype=float)) @ to_box.T
        d = (np.asarray(end, dtype=float) - np.asarray(start, dtype=float)) @ to_box.T
        half = 0.5 * np.asarray(self.size, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = (-half - p) / d, (half - p) / d
        low, high = np.minimum(near, far), np.maximum(near, far)
        along = d == 0.0  # between two faces always, or never
        inside = np.abs(p) <= half
        low = np.where(along, np.where(inside, -np.inf, np.inf), low)
        high = np.where(along, np.where(inside, np.inf, -np.inf), high)
        return _first(low.max(axis=-1), high.min(axis=-1))

    def grown(self, margin: float) -> "SolidBox":
        """Box with every face moved out."""
        return replace(self, size=np.asarray(self.size, dtype=float) + 2.0 * margin)


@dataclass(frozen=True, eq=False)
class SolidSphere:
    """Sphere as an obstacle to beams.

    centre   (3,) m
    radius   m, above 0

    >>> SolidSphere((5.0, 0.0, 0.0), 1.0).first_hit([0.0, 0.0, 0.0], [10.0, 0.0, 0.0]).item()
    0.4
    """

    centre: ArrayLike
    radius: float

    def __post_init__(self) -> None:
        _vector("centre", self.centre)
        _positive("radius", self.radius)

    def first_hit(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Share (...) of the path at first entry; infinite if clear.

        Source: the quadratic of a line and a sphere. Exact.
        """
        p = np.asarray(start, dtype=float) - np.asarray(self.centre, dtype=float)
        d = np.asarray(end, dtype=float) - np.asarray(start, dtype=float)
        low, high = _between_roots(_dot(d, d), _dot(p, d), _dot(p, p) - self.radius**2)
        return _first(low, high)

    def grown(self, margin: float) -> "SolidSphere":
        """Sphere with a larger radius."""
        return replace(self, radius=self.radius + margin)


@dataclass(frozen=True, eq=False)
class SolidCone:
    """Cone, cylinder or frustum between two flat ends square to its axis.

    start, end                (3,) m, centres of its ends, apart
    start_radius, end_radius  m, 0 or more, not both 0; equal: a cylinder

    >>> tower = SolidCone((5.0, 0.0, -1.0), (5.0, 0.0, 9.0), 1.0, 1.0)
    >>> tower.first_hit([0.0, 0.0, 0.0], [[10.0, 0.0, 0.0], [10.0, 0.0, 30.0]]).tolist()
    [0.4, inf]
    """

    start: ArrayLike
    end: ArrayLike
    start_radius: float
    end_radius: float

    def __post_init__(self) -> None:
        if not np.linalg.norm(_vector("end", self.end) - _vector("start", self.start)) > 0.0:
            raise ValidityError(f"start and end of a cone are the same point {np.asarray(self.start).tolist()}")
        _positive("larger radius", max(self.start_radius, self.end_radius))
        if min(self.start_radius, self.end_radius) < 0.0:
            raise ValidityError(f"radius {min(self.start_radius, self.end_radius)} m of a cone is below 0")

    def first_hit(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Share (...) of the path at first entry; infinite if clear.

        Source: the solid is where the height is between its ends and rho <= r(height): a slab, and the inside of a
        quadratic, which between the ends has one nappe and is one stretch of a line. Exact.
        """
        foot = np.asarray(self.start, dtype=float)
        axis = np.asarray(self.end, dtype=float) - foot
        height = float(np.linalg.norm(axis))
        axis = axis / height
        p = np.asarray(start, dtype=float) - foot
        d = np.asarray(end, dtype=float) - np.asarray(start, dtype=float)
        p_up, d_up = p @ axis, d @ axis
        p_out, d_out = p - p_up[..., None] * axis, d - d_up[..., None] * axis
        slope = (self.end_radius - self.start_radius) / height
        r, d_r = self.start_radius + slope * p_up, slope * d_up
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([-p_up / d_up, (height - p_up) / d_up], axis=-1)
        level, inside = d_up == 0.0, (p_up >= 0.0) & (p_up <= height)
        low = np.where(level, np.where(inside, -np.inf, np.inf), ends.min(axis=-1))
        high = np.where(level, np.where(inside, np.inf, -np.inf), ends.max(axis=-1))
        a, b, c = _dot(d_out, d_out) - d_r**2, _dot(p_out, d_out) - r * d_r, _dot(p_out, p_out) - r**2
        return _first_below(a, b, c, np.maximum(low, 0.0), np.minimum(high, 1.0))

    def grown(self, margin: float) -> "SolidCone":
        """Cone with ends and side moved out by a margin."""
        foot, top = np.asarray(self.start, dtype=float), np.asarray(self.end, dtype=float)
        height = float(np.linalg.norm(top - foot))
        slope = (self.end_radius - self.start_radius) / height
        out = margin * (np.hypot(1.0, slope) + abs(slope))  # square to the side, less the effect of the longer ends
        step = margin * (top - foot) / height
        return SolidCone(foot - step, top + step, self.start_radius + out, self.end_radius + out)


@dataclass(frozen=True, eq=False)
class Dish:
    """Thin piece of a paraboloid z = (x^2 + y^2)/4f within a round aperture.

    focal_length      m, above 0
    aperture_centre   (2,) m, x and y
    aperture_radius   m, above 0
    below, above      m, 0 or more: thickness to either side of the surface, along z

    >>> Dish(60.0, (0.0, 54.0), 50.0).first_hit([0.0, 54.0, 100.0], [0.0, 54.0, -75.7]).item().__round__(9)
    0.5
    """

    focal_length: float
    aperture_centre: ArrayLike
    aperture_radius: float
    below: float = 0.0
    above: float = 0.0

    def __post_init__(self) -> None:
        _positive("focal length", self.focal_length)
        _positive("aperture radius", self.aperture_radius)
        if np.shape(self.aperture_centre) != (2,) or not np.all(np.isfinite(np.asarray(self.aperture_centre))):
            raise ValidityError(f"aperture centre {self.aperture_centre!r} of a dish is not two finite numbers")
        if min(self.below, self.above) < 0.0:
            raise ValidityError(f"thickness {min(self.below, self.above)} m of a dish is below 0")

    def first_hit(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Share (...) of the path at first entry; infinite if clear.

        Source: with g = z - (x^2 + y^2)/4f the dish is -below <= g <= above within the aperture's cylinder; g along a
        line is a quadratic that opens downwards. A path enters the layer at the cylinder's edge or at a root. Exact.
        """
        p = np.asarray(start, dtype=float)
        d = np.asarray(end, dtype=float) - p
        flat, along = p[..., :2] - np.asarray(self.aperture_centre, dtype=float), d[..., :2]
        low, high = _between_roots(_dot(along, along), _dot(flat, along), _dot(flat, flat) - self.aperture_radius**2)
        low, high = np.maximum(low, 0.0), np.minimum(high, 1.0)
        a = -_dot(along, along) / (4.0 * self.focal_length)
        b = 0.5 * d[..., 2] - _dot(p[..., :2], along) / (4.0 * self.focal_length)
        c = p[..., 2] - _dot(p[..., :2], p[..., :2]) / (4.0 * self.focal_length)
        begin = np.where(low <= high, low, 0.0)
        height = (a * begin + 2.0 * b) * begin + c
        inside = (height >= -self.below) & (height <= self.above)
        crossings = np.stack([*_roots(a, b, c - self.above), *_roots(a, b, c + self.below)], axis=-1)
        valid = (crossings >= low[..., None]) & (crossings <= high[..., None])
        root = np.where(valid, crossings, np.inf).min(axis=-1)
        return np.where(low > high, np.inf, np.where(inside, low, root))

    def grown(self, margin: float) -> "Dish":
        """Dish thicker by at least the margin on both sides, and wider by it."""
        edge = float(np.hypot(*np.asarray(self.aperture_centre, dtype=float))) + self.aperture_radius + margin
        along_z = margin * float(np.hypot(1.0, edge / (2.0 * self.focal_length)))  # where it is steepest
        return replace(
            self,
            aperture_radius=self.aperture_radius + margin,
            below=self.below + along_z + margin**2 / (4.0 * self.focal_length),
            above=self.above + along_z + margin**2 / (4.0 * self.focal_length),
        )


Solid = SolidBox | SolidSphere | SolidCone | Dish


def _first(low: Array, high: Array) -> Array:
    """Beginning of an interval low..high within 0..1, infinite if empty."""
    begin = np.maximum(low, 0.0)
    return np.where((begin <= high) & (begin <= 1.0), begin, np.inf)


def _roots(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Both ordered roots of a t^2 + 2 b t + c, at full precision; NaN if none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - a * c)
        q = -(b + np.where(b >= 0.0, root, -root))
        first, second = q / a, c / q
        first = np.where(a == 0.0, second, first)  # a straight line has one
        second = np.where(q == 0.0, first, second)
    return np.fmin(first, second), np.fmax(first, second)


def _between_roots(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Interval where a t^2 + 2 b t + c <= 0, a >= 0; (inf, -inf) if none.

    All where a = b = 0 >= c.
    """
    low, high = _roots(a, b, c)
    still = (a == 0.0) & (b == 0.0)
    low = np.where(still, np.where(c <= 0.0, -np.inf, np.inf), low)
    high = np.where(still, np.where(c <= 0.0, np.inf, -np.inf), high)
    missing = np.isnan(low) | np.isnan(high)
    return np.where(missing, np.inf, low), np.where(missing, -np.inf, high)


def _first_below(a: Array, b: Array, c: Array, low: Array, high: Array) -> Array:
    """First share in low..high at which a t^2 + 2 b t + c <= 0; infinite if none."""
    begin = np.where(low <= high, low, 0.0)
    inside = (a * begin + 2.0 * b) * begin + c <= 0.0
    roots = np.stack(_roots(a, b, c), axis=-1)
    valid = (roots >= low[..., None]) & (roots <= high[..., None])
    entered = np.where(valid, roots, np.inf).min(axis=-1)
    return np.where(low > high, np.inf, np.where(inside, low, entered))


def _dot(u: Array, v: Array) -> Array:
    return np.asarray(np.sum(u * v, axis=-1))


def _vector(what: str, value: ArrayLike) -> Array:
    array = np.asarray(value, dtype=float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValidityError(f"{what} {array.tolist()} is not three finite numbers")
    return array


def _positive(what: str, value: float) -> None:
    if not 0.0 < value < np.inf:
        raise ValidityError(f"{what} {value} m is not above 0 and finite")
