"""Exact rays in three dimensions through planes and spheres.

Batches of rays, with a status for each.

Light bends with the phase index and is delayed with the group index: at a surface Snell's law in vectors takes the
ratio of phase indices, along a leg the optical path grows by the group index times its length. Nothing is paraxial and
no formula of the retroreflector files is used, so that they can be checked against it.

Paths are of light that goes from a plane across its direction through a chosen point to the retroreflector and back to
the same plane: `half_path` is the apparent distance beyond that point, one way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError

AWAY = 1e-12  # m: a ray that starts on a surface does not hit it again immediately


@dataclass(frozen=True)
class Plane:
    """Flat surface by point and normal.

    point    (3,) m, on it
    normal   (3,) unit vector, either way
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def distance(self, position: Array, direction: Array) -> Array:
        """Distance (r,), m, along the rays to the surface.

        NaN where they run along it or it lies behind.
        """
        towards = direction @ np.asarray(self.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            travel = -((position - np.asarray(self.point)) @ np.asarray(self.normal)) / towards
        return np.where(np.isfinite(travel) & (travel > AWAY), travel, np.nan)

    def normals(self, position: Array) -> Array:
        """Unit normals (r, 3) at points on the surface."""
        return np.broadcast_to(np.asarray(self.normal), position.shape)


@dataclass(frozen=True)
class SphericalSurface:
    """Spherical surface by centre and radius.

    centre   (3,) m
    radius   m, above 0
    far      rays meet its far side rather than its near one
    """

    centre: tuple[float, float, float]
    radius: float
    far: bool = False

    def distance(self, position: Array, direction: Array) -> Array:
        """Distance (r,), m, along the rays; NaN on a miss or behind."""
        from_centre = position - np.asarray(self.centre)
        middle = -np.sum(from_centre * direction, axis=-1)
        off = from_centre + middle[..., None] * direction  # the point nearest to the centre
        square = self.radius**2 - np.sum(off**2, axis=-1)
        half = np.sqrt(np.where(square >= 0.0, square, np.nan))
        travel = middle + half if self.far else middle - half
        return np.where(travel > AWAY, travel, np.nan)

    def normals(self, position: Array) -> Array:
        """Unit normals (r, 3) at points on the surface."""
        return (position - np.asarray(self.centre)) / self.radius


Surface = Plane | SphericalSurface


@dataclass(frozen=True, eq=False)
class Rays:
    """Batch of rays; NaN after a miss or unwanted total reflection.

    position    (r, 3) m
    direction   (r, 3) unit vectors
    path        (r,) m: optical path behind them, by the group index
    """

    position: Array
    direction: Array
    path: Array

    def to(self, surface: Surface, group: float) -> "Rays":
        """Propagate to a surface through a medium of group index `group`."""
        travel = surface.distance(self.position, self.direction)
        return replace(self, position=self.position + travel[:, None] * self.direction, path=self.path + group * travel)

    def refracted(self, surface: Surface, ratio: float) -> "Rays":
        """Refract at the current surface; `ratio` is the phase index before over after."""
        normal = surface.normals(self.position)
        cosine = np.sum(self.direction * normal, axis=-1, keepdims=True)
        square = 1.0 - ratio**2 * (1.0 - cosine**2)
        cosine_after = np.copysign(np.sqrt(np.where(square >= 0.0, square, np.nan)), cosine)
        return replace(self, direction=ratio * self.direction + (cosine_after - ratio * cosine) * normal)

    def reflected(self, surface: Surface) -> "Rays":
        """Reflect at the current surface."""
        normal = surface.normals(self.position)
        along = np.sum(self.direction * normal, axis=-1, keepdims=True)
        return replace(self, direction=self.direction - 2.0 * along * normal)

    def reflected_in(self, planes: Sequence[Plane], group: float) -> "Rays":
        """Reflect at the first plane on each ray, through group index `group`."""
        travels = np.array([plane.distance(self.position, self.direction) for plane in planes])
        first = np.argmin(np.where(np.isnan(travels), np.inf, travels), axis=0)
        travel = np.take_along_axis(travels, first[None], axis=0)[0]
        normal = np.array([plane.normal for plane in planes])[first]
        along = np.sum(self.direction * normal, axis=-1, keepdims=True)
        return Rays(
            self.position + travel[:, None] * self.direction,
            self.direction - 2.0 * along * normal,
            self.path + group * travel,
        )


def corner(apex: ArrayLike, azimuth: float = 0.0, errors: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[Plane, ...]:
    """Faces of a cube corner open to +z; normals point inwards.

    apex      (3,) m
    azimuth   rad: of the first edge, seen along z; the others follow at 120 deg
    errors    rad, three: excess of the angles between faces 2 and 3, 3 and 1, 1 and 2 over a right angle

    Source: geometry. Faces at an angle a have normals at pi - a: exact for errors as the square root of the normals'
    Gram matrix, which turns the three least.
    """
    around = azimuth + np.arange(3) * 2.0 * np.pi / 3.0
    edges = np.stack([np.cos(around), np.sin(around), np.full(3, np.sqrt(0.5))], axis=-1) * np.sqrt(2.0 / 3.0)
    cosines = np.sin(np.asarray(errors, dtype=float))  # cos(pi - (pi/2 + e)) = sin e
    gram = np.eye(3)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        gram[i, j] = gram[j, i] = cosines[k]
    values, vectors = np.linalg.eigh(gram)
    normals = (vectors * np.sqrt(values)) @ vectors.T @ edges
    point = tuple(np.asarray(apex, dtype=float))
    return tuple(Plane(point, tuple(normal / np.linalg.norm(normal))) for normal in normals)


def beam(to_ranger: ArrayLike, offsets: ArrayLike, start: float = 1.0) -> Rays:
    """Parallel rays from a distant ranger.

    to_ranger   (3,) unit vector from the retroreflector
    offsets     (r, 3) m: points that the rays would pass through, undisturbed
    start       m: distance of the plane where they begin from the origin, before the retroreflector
    """
    towards = np.asarray(to_ranger, dtype=float)
    if abs(float(towards @ towards) - 1.0) > 1e-9:
        raise ValidityError(
            f"direction to the ranger has the length {np.linalg.norm(towards):g} (expected a unit vector)"
        )
    points = np.atleast_2d(np.asarray(offsets, dtype=float))
    position = points + (start - points @ towards)[:, None] * towards
    return Rays(position, np.broadcast_to(-towards, points.shape), np.zeros(len(points)))


def half_path(rays: Rays, to_ranger: ArrayLike, point: ArrayLike, *, start: float = 1.0) -> Array:
    """Apparent distance of returned rays beyond a point, (r,) m, one way.

    rays        from `beam`, out in the air again; each is propagated to the plane across its own direction
    to_ranger   (3,) as given to `beam`
    point       (3,) m
    start       m, as given to `beam`

    Source: definition. For a wave that returns exactly the way it came it is half the group path from a plane through
    the point and back to it, which must equal minus the range constant of a retroreflector.
    """
    towards, at = np.asarray(to_ranger, dtype=float), np.asarray(point, dtype=float)
    out = start - towards @ at
    back = np.sum((at - rays.position) * rays.direction, axis=-1)  # to the plane across the ray through the point
    return 0.5 * (rays.path - out + back)


def through_prism(
    rays: Rays,
    *,
    height: float,
    phase: float,
    group: float,
    azimuth: float = 0.0,
    errors: Sequence[float] = (0.0, 0.0, 0.0),
) -> Rays:
    """Trace a solid cube corner and out again: three reflections.

    Face at z = 0, corner at z = -height.

    height         m
    phase, group   index of the glass over that of the air; 1, 1 for a hollow corner behind its clear face
    azimuth        rad, of the first edge
    errors         rad, of the three dihedral angles: see `corner`
    """
    face = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    faces = corner((0.0, 0.0, -height), azimuth, errors)
    inside = rays.to(face, 1.0).refracted(face, 1.0 / phase)
    for _ in range(3):
        inside = inside.reflected_in(faces, group)
    return inside.to(face, group).refracted(face, phase)
