"""True beam of a displaced dish and feed, by ray tracing.

By the law of reflection at the paraboloid, and nothing of the reduction: the final direction of the light is the
beam. All in the reflector frame at rest: x to the right when looking along the beam, z along it, the vertex the origin.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.geometry.frames.rotation import from_vector
from catseye.records.site.site import ParaboloidRecord

RINGS, SPOKES = 20, 50


@dataclass(frozen=True, eq=False)
class TracedDish:
    """Paraboloid with the points of its rays.

    focal_length   m
    xy             (n, 2) m, of the points
    weight         (n,) with sum 1: the plane of best fit to paths over a disc, uniformly weighted, tilts by the mean of
                   their slopes weighted with R^2 - r^2 (integrate x times the path by parts)
    """

    focal_length: float
    xy: Array
    weight: Array

    @classmethod
    def of(cls, record: ParaboloidRecord) -> "TracedDish":
        """Rays over a site's paraboloid and aperture."""
        radius = record.aperture_radius_mm * MILLIMETRE
        nodes, weights = np.polynomial.legendre.leggauss(RINGS)
        r, angle = 0.5 * radius * (nodes + 1.0), 2.0 * np.pi * (np.arange(SPOKES) + 0.3) / SPOKES
        xy = (r[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
        weight = np.repeat(weights * r * (radius**2 - r**2), SPOKES)
        middle = np.array(record.aperture_centre_mm) * MILLIMETRE
        return cls(record.focal_length_mm * MILLIMETRE, xy + middle, weight / weight.sum())

    @property
    def focus(self) -> Array:
        """Position of the feed at rest, (3,) m."""
        return np.array([0.0, 0.0, self.focal_length])

    def beam(self, turn: Array, shift: Array, feed: Array) -> Array:
        """Direction (3,) of the beam, a unit vector.

        turn, shift   (3,) rad and m: the dish, turned about its vertex, then shifted
        feed          (3,) m, present position
        """
        back = from_vector(np.asarray(turn, dtype=float))
        feed_in_dish = back.T @ (np.asarray(feed, dtype=float) - shift)  # the feed in the dish's frame
        points = np.column_stack([self.xy, np.sum(self.xy**2, axis=1) / (4.0 * self.focal_length)])
        normals = np.column_stack([-self.xy, np.full(len(self.xy), 2.0 * self.focal_length)])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        ways = points - feed_in_dish
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        out = ways - 2.0 * np.sum(ways * normals, axis=1)[:, None] * normals
        mean = back @ (self.weight @ out)
        return np.asarray(mean / np.linalg.norm(mean))

    def offset(self, dish: Array, arm: Array) -> Array:
        """Beam offset (3,): azimuth times cos E, rad, elevation, rad, feed distance, m.

        The feed further from the dish along the beam is positive.

        dish   (6,) shift and turn of the dish, m and rad, about the vertex
        arm    (6,) of the feed's support, about the focus

        Azimuth rises towards x, elevation along -y, away from the dish.
        """
        x, y, _ = self.beam(dish[3:], dish[:3], self.focus + arm[:3])
        slip = arm[:3] - dish[:3] - np.cross(dish[3:], self.focus)
        return np.array([x, -y, slip[2]])
