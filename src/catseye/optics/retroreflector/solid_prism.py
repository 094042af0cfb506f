"""Solid prism: delayed by group index, refracted by phase index.

Total reflection confines the light.

Inside, the light meets the three faces under angles whose cosines are its components along the three edges; a
reflection only changes a component's sign, so that every ray has the same three angles, in any order. An uncoated
face transmits light where such a cosine exceeds sqrt(1 - 1/n^2). With the ranger's azimuth a from the nearest edge the
largest is

    sqrt(2/3) cos a sin r + cos r / sqrt 3 = A cos(r - r0),    A^2 = 1/3 + 2/3 cos^2 a,    tan r0 = sqrt 2 cos a

so total reflection ends at r = r0 - arccos(sqrt(1 - 1/n^2) / A): for BK 7 at an incidence of 20.3 deg on the side of an
edge (fused silica 16.5 deg), 24.6 deg at 30 deg from it, and never within 6 deg of the middle between two edges.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.corner_polarization import sector_jones, sector_shares, solid_corner
from catseye.optics.retroreflector.interface import (
    RIGHT,
    Sectors,
    fresnel,
    incidences,
    refuse_indices,
    refuse_shares,
    refuse_sizes,
)

SIXTH = np.pi / 3.0


@dataclass(frozen=True)
class SolidPrism:
    """Solid cube-corner prism.

    Axes from the middle of its face, z out of the face, an edge at azimuth 0.

    height, aperture     m, face to corner; radius of the clear, round face
    group                group index of the glass over that of the air: the memo's n
    phase                phase index over that of the air; equal to `group` it is appendix B's prism, which refracts
                         by the group index too, for campaigns that were reduced so
    face_reflectance     of a coated face, each passage; None for bare glass
    corner_reflectance   of metal on the three faces, each; None for bare glass that reflects totally

    Source: [GOLDMAN00] eqs. 3.8-3.10; `prism.oblique_change` for what it is at an angle.

    >>> glass = SolidPrism(height=0.0384, aperture=0.0254, group=1.527077, phase=1.510811)
    >>> round(glass.range_constant * 1e3, 4), round(glass.fiducial[2] * 1e3, 4)
    (-33.4937, -25.1461)
    >>> round(float(np.degrees(glass.acceptance)), 2), round(float(glass.return_share(0.0)), 3)
    (20.32, 0.919)
    """

    height: float
    aperture: float
    group: float
    phase: float
    face_reflectance: float | None = None
    corner_reflectance: float | None = None

    def __post_init__(self) -> None:
        refuse_sizes(height=self.height, aperture=self.aperture)
        refuse_indices(self.phase, self.group)
        refuse_shares(face_reflectance=self.face_reflectance, corner_reflectance=self.corner_reflectance)

    @property
    def fiducial(self) -> tuple[float, float, float]:
        """Fiducial point T, height / n below the face."""
        return (0.0, 0.0, -float(prism.reference_depth(self.height, self.group)))

    @property
    def range_constant(self) -> float:
        """The range constant -(n - 1/n) height, m."""
        return float(prism.range_constant(self.height, self.group))

    @property
    def acceptance(self) -> float:
        """Incidence at which light begins to leak, or no clear face is left.

        The former for an uncoated corner, the latter for a coated one.
        """
        bent = self.phase * np.sin(np.arctan(self.aperture / self.height))
        clear = float(np.arcsin(bent)) if bent < 1.0 else RIGHT
        return clear if self.corner_reflectance is not None else min(clear, float(self.total_reflection_limit(0.0)))

    def total_reflection_limit(self, azimuth: ArrayLike) -> Array:
        """Incidence, rad, up to which all bare faces reflect totally.

        A right angle where they always do.

        azimuth   rad, of the direction to the ranger, from an edge

        Source: [YODER58] for the effect; derived at the top of this file, exact.
        """
        turned = np.mod(np.asarray(azimuth, dtype=float) + SIXTH, 2.0 * SIXTH) - SIXTH  # from the nearest edge
        size = np.sqrt((1.0 + 2.0 * np.cos(turned) ** 2) / 3.0)
        critical = np.sqrt(1.0 - self.phase**-2) / size
        inside = np.arctan(np.sqrt(2.0) * np.cos(turned)) - np.arccos(np.minimum(critical, 1.0))
        outside = self.phase * np.sin(np.maximum(inside, 0.0))  # 0 where even normal incidence is not confined
        return np.where((critical >= 1.0) | (outside >= 1.0), RIGHT, np.arcsin(np.minimum(outside, 1.0)))

    def range_change(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Range change, m, by `prism.oblique_change`; the same at every azimuth.

        NaN where the face looks away.
        """
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        return prism.oblique_change(self.height, angle, group=self.group, phase=self.phase)

    def clear_area(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Clear area across the beam, m^2, as `prism.clear_share`.

        The same at every azimuth.
        """
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        share = prism.clear_share(
            np.minimum(angle, RIGHT), aperture=self.aperture, height=self.height, index=self.phase
        )
        return np.pi * self.aperture**2 * share

    def return_share(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Returned share of unpolarized light: clear area, faces, three reflections.

        Two passages of the face.

        The effect of polarization within the six sectors is in `sectors`; it does not change the sum where reflection
        is total.
        """
        angle, turn = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        bare = np.mean(fresnel(np.cos(np.minimum(angle, RIGHT)), self.phase), axis=0)
        reflected = bare if self.face_reflectance is None else self.face_reflectance
        area = self.clear_area(angle, turn) / (np.pi * self.aperture**2)
        return area * (1.0 - reflected) ** 2 * self._corner(np.minimum(angle, RIGHT), turn)

    def sectors(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Sectors:
        """Six sectors; coatings reflect s and p equally.

        See `corner_polarization.Corner` for real films.

        Raises ValidityError where no light meets all three faces.
        """
        outside = 1.0 if self.corner_reflectance is None else complex("inf")
        corner = solid_corner(self.phase, outside, bare_face=self.face_reflectance is None)
        shares = sector_shares(corner, incidence, azimuth, aperture=self.aperture, height=self.height)
        metal = 1.0 if self.corner_reflectance is None else self.corner_reflectance**1.5
        transmitted = 1.0 if self.face_reflectance is None else 1.0 - self.face_reflectance
        return Sectors(shares, metal * transmitted * sector_jones(corner, incidence, azimuth))

    def _corner(self, incidence: Array, azimuth: Array) -> Array:
        """Product of the three faces' reflectances."""
        if self.corner_reflectance is not None:
            return np.full(incidence.shape, self.corner_reflectance**3)
        sine = np.sin(incidence) / self.phase
        edges = 2.0 * SIXTH * np.arange(3).reshape((3,) + (1,) * incidence.ndim)
        cosines = np.sqrt(2.0 / 3.0) * sine * np.cos(azimuth - edges) + np.sqrt((1.0 - sine**2) / 3.0)
        return np.prod(np.mean(fresnel(np.abs(cosines), 1.0 / self.phase), axis=0), axis=0)
