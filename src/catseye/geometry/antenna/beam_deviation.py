"""Beam deviation from small displacements of feed, subreflector or receiver.

It is the tilt of the wavefront over the aperture.

All in the reflector frame: x to the right when looking along the beam, z along it, the paraboloid's vertex in the
origin and its focus F1 at z = f. By Fermat's principle a small displacement changes a ray's path by

    feed or receiver at a focus F moved by d      d . (F - Q) / |F - Q|, Q the last point of reflection before it
    a mirror's point P moved by d                 d . ((P - Q)/|P - Q| + (P - R)/|P - R|), Q and R the ray's neighbours

and the plane of best fit to these changes over the aperture, uniformly weighted, turns the beam by its slopes towards
x and y. The feed's taper is not included.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import skew

RINGS, SPOKES = 24, 64  # rings and spokes of the aperture: quadrature good to 1e-10


@dataclass(frozen=True, eq=False)
class ApertureNodes:
    """Quadrature nodes over a round aperture of a paraboloid.

    focal_length   m
    inside         (m, 2) m, x and y from the aperture's centre
    surface        (m, 3) m, points of the paraboloid
    weight         (m,)
    """

    focal_length: float
    inside: Array
    surface: Array
    weight: Array

    @property
    def focus(self) -> Array:
        """Position of the prime focus, (3,) m."""
        return np.array([0.0, 0.0, self.focal_length])

    def tilt(self, path_change: ArrayLike) -> Array:
        """Slopes (2, k) towards x and y of planes fitted to path changes (m, k)."""
        moment = self.weight @ self.inside[:, 0] ** 2  # the same along y; the terms of a plane are orthogonal on a disc
        return np.asarray((self.weight[:, None] * self.inside).T @ np.asarray(path_change, dtype=float) / moment)


def aperture(focal_length: float, centre: ArrayLike, radius: float) -> ApertureNodes:
    """Gauss-Legendre rings and even spokes over a round aperture.

    focal_length   m, of the paraboloid, above 0
    centre         (2,) m, x and y of its middle
    radius         m, above 0
    """
    if not (focal_length > 0.0 and radius > 0.0):
        raise ValidityError(f"focal length {focal_length} m and radius {radius} m of an aperture, expected above 0")
    nodes, weights = np.polynomial.legendre.leggauss(RINGS)
    rho, angle = 0.5 * radius * (nodes + 1.0), 2.0 * np.pi * np.arange(SPOKES) / SPOKES
    inside = (rho[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    xy = inside + np.asarray(centre, dtype=float)
    surface = np.column_stack([xy, np.sum(xy**2, axis=1) / (4.0 * focal_length)])
    return ApertureNodes(focal_length, inside, surface, np.repeat(weights * rho, SPOKES))


def prime_focus_tilt(of: ApertureNodes) -> Array:
    """Wavefront slopes (2, 3), rad/m, for a shift of a prime-focus feed.

    Source: the top of this file.
    """
    path = of.focus - of.surface
    return of.tilt(path / np.linalg.norm(path, axis=1)[:, None])


@dataclass(frozen=True)
class Gregorian:
    """Ellipsoidal subreflector that shares the prime focus F1 with the paraboloid.

    interfocal     m, from F1 to the receiver's focus F2, above 0
    eccentricity   of the ellipsoid, 0 to 1
    tilt           rad, of the line F1 to F2 against -z, above zero towards -y (away from the dish)

    The defaults are chosen, as no public source is known. They satisfy the condition of an offset pair: the rays of the
    aperture's rim meet F2 in a circular cone, of 14.99 degrees half-angle, and the subreflector is 7.6 by 7.9 m.
    """

    interfocal: float = 11.0
    eccentricity: float = 0.528
    tilt: float = float(np.radians(5.57))

    def second_focus(self, focus: Array) -> Array:
        """Second focus F2, (3,) m, from F1 (3,)."""
        return focus + self.interfocal * np.array([0.0, -np.sin(self.tilt), -np.cos(self.tilt)])

    def reflections(self, of: ApertureNodes) -> Array:
        """Reflection points (m, 3), m, of an aperture's rays on the ellipsoid.

        The rays have crossed in F1.

        |P - F1| + |P - F2| = 2a along the direction v from F1 at the angle q to F2 gives
        |P - F1| = (a^2 - c^2)/(a - c cos q), with c half the distance of the foci and a = c/e.
        """
        if not (self.interfocal > 0.0 and 0.0 < self.eccentricity < 1.0):
            raise ValidityError(
                f"interfocal distance {self.interfocal} m and eccentricity {self.eccentricity} of a subreflector, "
                "expected above 0 and within 0 to 1"
            )
        c = 0.5 * self.interfocal
        a = c / self.eccentricity
        v = of.focus - of.surface
        v = v / np.linalg.norm(v, axis=1)[:, None]
        axis = (self.second_focus(of.focus) - of.focus) / self.interfocal
        return np.asarray(of.focus + v * ((a * a - c * c) / (a - c * (v @ axis)))[:, None])


def subreflector_tilt(of: ApertureNodes, gregorian: Gregorian, pivot: ArrayLike) -> Array:
    """Wavefront slopes (2, 6) for subreflector shift (rad/m) and turn (rad/rad) about a pivot (3,) m."""
    p = gregorian.reflections(of)
    back, on = p - of.surface, p - gregorian.second_focus(of.focus)
    normal = back / np.linalg.norm(back, axis=1)[:, None] + on / np.linalg.norm(on, axis=1)[:, None]
    arm = p - np.asarray(pivot, dtype=float)
    turn = np.einsum("mi,mij->mj", normal, -skew(arm))  # n . (w x arm) = n . (-[arm]x w)
    return of.tilt(np.concatenate([normal, turn], axis=1))
