"""Hollow cube corner of three mirrors; ranges end at their corner."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.optics.retroreflector.corner_polarization import hollow_corner, sector_jones, sector_shares
from catseye.optics.retroreflector.interface import RIGHT, Sectors, incidences, refuse_shares, refuse_sizes
from catseye.optics.retroreflector.prism import clear_share


@dataclass(frozen=True)
class HollowCube:
    """Hollow cube corner.

    Axes from its corner, z along the cube's diagonal out of the opening.

    aperture      m, radius of the clear, round opening
    height        m, from the opening to the corner; sqrt 2 of the aperture for an inscribed round
    reflectance   of each mirror, unpolarized, at the 55 deg at which light meets it

    Source: [YODER58] for the aperture; range constant 0 by definition, as [PARKER04] section 5.6 has it.

    >>> cube = HollowCube(aperture=0.0254, height=0.0359, reflectance=0.97)
    >>> cube.range_constant, round(float(np.degrees(cube.acceptance)), 1), round(float(cube.return_share(0.0)), 3)
    (0.0, 35.3, 0.913)
    """

    aperture: float
    height: float
    reflectance: float = 1.0

    def __post_init__(self) -> None:
        refuse_sizes(aperture=self.aperture, height=self.height)
        refuse_shares(reflectance=self.reflectance)

    @property
    def fiducial(self) -> tuple[float, float, float]:
        """Fiducial point: the corner, which is the origin."""
        return (0.0, 0.0, 0.0)

    @property
    def range_constant(self) -> float:
        """Range constant: 0, as the path is in air."""
        return 0.0

    @property
    def acceptance(self) -> float:
        """Incidence at which no light both enters and leaves the opening."""
        return float(np.arctan(self.aperture / self.height))

    def range_change(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Range change: 0; NaN where the opening looks away."""
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        return np.where(angle < RIGHT, 0.0, np.nan)

    def clear_area(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Clear area across the beam, m^2, as `prism.clear_share`.

        The same at every azimuth.
        """
        angle, _ = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        share = clear_share(np.minimum(angle, RIGHT), aperture=self.aperture, height=self.height, index=1.0)
        return np.pi * self.aperture**2 * share

    def return_share(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Returned share: clear area over the opening's, times three mirrors."""
        return self.clear_area(incidence, azimuth) / (np.pi * self.aperture**2) * self.reflectance**3

    def sectors(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Sectors:
        """Six sectors of mirrors that reflect s and p equally.

        `corner_polarization.hollow_corner` has real metal.

        Raises ValidityError where no light is left that meets all three mirrors.
        """
        corner = hollow_corner(complex("inf"))
        shares = sector_shares(corner, incidence, azimuth, aperture=self.aperture, height=self.height)
        return Sectors(shares, self.reflectance**1.5 * sector_jones(corner, incidence, azimuth))
