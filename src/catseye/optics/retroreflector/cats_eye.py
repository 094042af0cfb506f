"""Cat's-eye of two concentric half-balls of glass, or one ball.

The large half is silvered; with one ball both radii are equal.

Its reference point is the common centre. Seen from anywhere, the ray through the centre meets the same glass.

A ray at the height y off the centre (in the air, across the beam) keeps its distance y/n_p from the centre within the
glass, since both spheres are about it. With sin t = y/R1, sin r = y/(n_p R1) and sin w = y/(n_p R2) it turns by t - r
at the small sphere, by pi - 2w at the mirror, by t - r again:

    deviation  e = 2 (t - r - w),   0 near the axis where R2 = R1/(n_p - 1);   above 0 the light comes back converging
    group path, one way, from the plane through the centre   n_g (R1 cos r + R2 cos w) - R1 cos t

Exact. A sphere focuses its outer rays short. The memo's ball, R2 = 3.799", is 1.3 mm shorter than the paraxial focus,
3.852": rays near the axis come back diverging, those at 10 mm straight, those farther out converging.

Source: [PARKER04] chapter 6, figure 6.2.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.optics.retroreflector.interface import (
    RIGHT,
    Sectors,
    fresnel,
    incidences,
    refuse_indices,
    refuse_shares,
    refuse_sizes,
)

NODES = 200  # over ray heights; the integrands are smooth: 1e-12 of their size


def range_constant(r1: ArrayLike, r2: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Range constant of a cat's-eye's glass, m, negative.

    It is added to the measured length.

    r1    m, radius of the small ball, through which the light enters
    r2    m, radius of the silvered large ball
    n     group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.14, exact for the ray through the centre. The memo's table prints about -173.6 mm where
    its own radii and index give -173.715 mm.

    >>> round(float(range_constant(1.969 * 0.0254, 3.799 * 0.0254, 1.527077)), 6)
    -0.173715
    """
    small, large = np.asarray(r1, dtype=float), np.asarray(r2, dtype=float)
    return -(np.asarray(n, dtype=float) * (small + large) - small)


def focal_radius(r1: ArrayLike, phase: ArrayLike) -> Array:
    """Mirror radius at the paraxial focus of the small ball, m.

    r1      m
    phase   phase index of the glass over that of the air, above 1

    Source: [SNYDER75], the paraxial cat's-eye; R1 / (n - 1). At n = 2 one ball is its own mirror.

    >>> round(float(focal_radius(0.05, 2.0)), 6)
    0.05
    """
    return np.asarray(r1, dtype=float) / (np.asarray(phase, dtype=float) - 1.0)


@cache
def _nodes() -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Legendre on -1 to 1, cached."""
    return np.polynomial.legendre.leggauss(NODES)


@dataclass(frozen=True)
class BallCatsEye:
    """Cat's-eye of two half-balls.

    Axes from the common centre, z out of the small ball's pole.

    r1, r2               m, radius of the small ball, which the light enters, and of the large, silvered one
    aperture             m, below r1: used radius across the beam, by a stop or by the beam
    group, phase         indices of the glass over those of the air
    face_reflectance     of a coated small ball, each passage; None for bare glass
    mirror_reflectance   of the silvered ball, from within

    Source: [GOLDMAN00] eq. 3.14 for the constant; the rest is derived at the top of this file, exact.

    >>> ball = BallCatsEye(r1=1.969 * 0.0254, r2=3.799 * 0.0254, aperture=0.010, group=1.527077, phase=1.510811)
    >>> round(ball.range_constant * 1e3, 3), round(float(ball.path_change(0.005)) * 1e6, 2)
    (-173.715, 3.52)
    >>> round(float(np.degrees(ball.acceptance)), 1)
    78.5
    """

    r1: float
    r2: float
    aperture: float
    group: float
    phase: float
    face_reflectance: float | None = None
    mirror_reflectance: float = 1.0

    def __post_init__(self) -> None:
        refuse_sizes(r1=self.r1, r2=self.r2, aperture=self.aperture)
        refuse_indices(self.phase, self.group)
        refuse_shares(face_reflectance=self.face_reflectance, mirror_reflectance=self.mirror_reflectance)
        if not self.aperture < min(self.r1, self.phase * self.r2):
            raise ValidityError(f"aperture = {self.aperture:g} m is not below the ball's radius {self.r1:g} m")

    @property
    def fiducial(self) -> tuple[float, float, float]:
        """Common centre of the balls: the origin."""
        return (0.0, 0.0, 0.0)

    @property
    def range_constant(self) -> float:
        """Range constant of the ray through the centre, at any incidence.

        `mean_path_change` gives the effect of a beam.
        """
        return float(range_constant(self.r1, self.r2, self.group))

    @property
    def acceptance(self) -> float:
        """Incidence at which the common plane begins to cut the aperture.

        arccos(aperture / R1).
        """
        return float(np.arccos(self.aperture / self.r1))

    def range_change(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Range change: 0, the same from everywhere; NaN from behind."""
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        return np.where(angle < RIGHT, 0.0, np.nan)

    def clear_area(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Clear area across the beam, m^2.

        The aperture's circle within the foreshortened circle of the common plane.

        A ray and the one it comes back as must both pass the small half-ball: |x| sin I < z cos I, an ellipse of the
        semi-axes R1 cos I and R1. It cuts the circle at x = sqrt(R1^2 - aperture^2) cot I.
        """
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        a, c = self.aperture, np.maximum(np.cos(angle), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.sqrt(self.r1**2 - a**2) * c / np.sin(angle)
        at = np.where(np.isnan(at), np.where(np.isnan(angle), np.nan, np.inf), at)
        inner = np.minimum(at, a)
        end = np.where(c > 0.0, self.r1 * c, 1.0)  # of the ellipse
        share = np.minimum(inner / end, 1.0)
        circle = inner * np.sqrt(a**2 - inner**2) + a**2 * np.arcsin(inner / a)
        ellipse = self.r1 * end * (0.5 * np.pi - np.arcsin(share) - share * np.sqrt(1.0 - share**2))
        return 2.0 * np.where(at >= a, 0.5 * np.pi * a**2, circle + np.where(c > 0.0, ellipse, 0.0))

    def return_share(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Returned share: clear area, two passages of the ball, and the mirror.

        Unpolarized and as on the axis: bare BK 7 loses 0.1 % more at an aperture of 0.3 R1.
        """
        bare = float(fresnel(1.0, self.phase)[0])
        reflected = bare if self.face_reflectance is None else self.face_reflectance
        share = self.clear_area(incidence, azimuth) / (np.pi * self.aperture**2)
        return share * (1.0 - reflected) ** 2 * self.mirror_reflectance

    def sectors(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Sectors:
        """Single sector: a mirror, which preserves polarization at any incidence.

        As on the axis.

        Raises ValidityError from behind.
        """
        area = self.clear_area(incidence, azimuth)
        if not np.all(area > 0.0):
            dark = np.broadcast_to(incidence, np.shape(area))[~(area > 0.0)].flat[0]
            raise ValidityError(f"incidence {dark:.4g} rad: no part of the ball returns light")
        amplitude = np.sqrt(self.return_share(incidence, azimuth) / area * np.pi) * self.aperture
        jones = (-amplitude[..., None, None, None] * np.eye(2)).astype(np.complex128)
        return Sectors(np.ones((*np.shape(amplitude), 1)), jones)

    def deviation(self, height: ArrayLike) -> Array:
        """Convergence angle of a returned ray, rad; below 0 diverging.

        height   m, of the ray off the centre, 0 to r1
        """
        outer, inner, back = self._sines(height)
        return 2.0 * (np.arcsin(outer) - np.arcsin(inner) - np.arcsin(back))

    def path_change(self, height: ArrayLike) -> Array:
        """Length correction of a ray beyond the range constant, m.

        height   m, of the ray off the centre, 0 to r1; counted to the plane across the returned ray
        """

        def short(sine: Array) -> Array:  # 1 - cos, without its cancellation
            return sine**2 / (1.0 + np.sqrt(1.0 - sine**2))

        outer, inner, back = self._sines(height)
        return self.group * (self.r1 * short(inner) + self.r2 * short(back)) - self.r1 * short(outer)

    def mean_path_change(self, beam_radius: float, offset: float = 0.0) -> float:
        """Mean `path_change` over a Gaussian beam within the aperture, m.

        It is added to the measured length.

        beam_radius   m, above 0, at 1/e^2 of the intensity
        offset        m, of the beam's axis from the centre

        A ranger that loses rays returned too far off averages less of the beam: see `collected_share`.
        """
        height, weight = self._beam(beam_radius, offset)
        return float(np.sum(weight * self.path_change(height)) / np.sum(weight))

    def blur(self, beam_radius: float) -> float:
        """Root mean square deviation of a beam's rays in the aperture, rad.

        beam_radius   m, above 0, at 1/e^2 of the intensity
        """
        height, weight = self._beam(beam_radius, 0.0)
        return float(np.sqrt(np.sum(weight * self.deviation(height) ** 2) / np.sum(weight)))

    def best_radius(self, beam_radius: float) -> float:
        """Mirror radius R2 for the least blur of a Gaussian beam, m.

        Group index and all else as they are.

        beam_radius   m, above 0, at 1/e^2 of the intensity
        """
        from scipy.optimize import minimize_scalar

        focus = float(focal_radius(self.r1, self.phase))
        shortest = max(0.6 * focus, 1.001 * self.aperture / self.phase)

        def blur(r2: float) -> float:
            return replace(self, r2=r2).blur(beam_radius) * 1e6

        return float(minimize_scalar(blur, bounds=(shortest, 1.02 * focus), method="bounded").x)

    def collected_share(self, distance: float, *, beam_radius: float, receiver: float) -> float:
        """Geometrical share of a beam on the aperture returned to a receiver.

        The receiver is centred.

        distance      m, above 0
        beam_radius   m, above 0, of the beam at the ball, at 1/e^2
        receiver      m, above 0: radius

        Geometrical: diffraction at the ball's zones is neglected, and glass and mirror are in `return_share`.
        """
        refuse_sizes(distance=distance, receiver=receiver)
        height, weight = self._beam(beam_radius, 0.0, 20 * NODES)  # the edge of the receiver is sharp
        off = np.abs(distance * np.tan(self.deviation(height)) - height)
        return float(np.sum(weight[off <= receiver]) / np.sum(weight))

    def _sines(self, height: ArrayLike) -> tuple[Array, Array, Array]:
        """Sines of the angles t, r, w; NaN where a ray misses."""
        y = np.asarray(height, dtype=float)
        if np.any(y < 0.0):
            raise ValidityError(f"ray height {float(np.min(y)):g} m is below 0")
        y = np.where(y <= min(self.r1, self.phase * self.r2), y, np.nan)
        return y / self.r1, y / (self.phase * self.r1), y / (self.phase * self.r2)

    def _beam(self, beam_radius: float, offset: float, nodes: int = NODES) -> tuple[Array, Array]:
        """Ray heights over the aperture and their power in a Gaussian beam."""
        refuse_sizes(beam_radius=beam_radius)
        x, w = _nodes()
        edges = np.linspace(0.0, self.aperture, nodes // NODES + 1)
        half = 0.5 * np.diff(edges)
        y = ((edges[:-1] + half)[:, None] + half[:, None] * x).ravel()
        from scipy.special import i0e

        squared = beam_radius**2
        around = i0e(4.0 * y * abs(offset) / squared) * np.exp(-2.0 * (y - abs(offset)) ** 2 / squared)
        return y, around * y * (half[:, None] * w).ravel()
