"""Cube corner in the back of a servo mirror, seen from afar.

The notes (section 2.4) shoot "the retroreflector built into the back side of the mirror" half a turn of elevation from
autocollimation: then the back looks where the face looked. The target is the face, on which the scan point lies.
The range ends at the cube's own point, nearer by the thickness of the plate, less the depth of the point in the glass:

    to the face = measured + P_c + z,   z = setback of the cube's origin + z of its fiducial

For a prism of height h set flush in the back of a plate n h thick the sum is 0: its glass looks as thick as the plate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.optics.retroreflector.hollow_cube import HollowCube
from catseye.optics.retroreflector.interface import RIGHT, Sectors, incidences
from catseye.optics.retroreflector.solid_prism import SolidPrism


@dataclass(frozen=True)
class BackMirrorCube:
    """Cube behind a mirror, in axes of the reflecting face.

    Origin in the face, z out of the back, x and y with the cube's.

    cube      whose z is the mirror's
    setback   (x, y, z) m, of the cube's origin (a prism's face, a hollow cube's corner) from the face's origin, where
              the mirror's two axes meet; z above 0 is behind the face, towards a ranger that sees the back

    Source: [PARKER04] section 2.4, eq. 2.24, for the arrangement; the constant is geometry, exact.

    >>> glass = SolidPrism(height=0.0127, aperture=0.0085, group=1.527077, phase=1.510811)
    >>> back = BackMirrorCube(glass, setback=(0.0, 0.0, 0.020))
    >>> round(back.range_constant * 1e3, 4)  # 20 mm of plate less n h of glass
    0.6061
    """

    cube: HollowCube | SolidPrism
    setback: tuple[float, float, float]

    def __post_init__(self) -> None:
        if len(self.setback) != 3 or not np.all(np.isfinite(self.setback)):
            raise ValidityError(f"setback = {self.setback} m is not three finite numbers")

    @property
    def fiducial(self) -> tuple[float, float, float]:
        """Reflecting face where the axes meet: the origin."""
        return (0.0, 0.0, 0.0)

    @property
    def point(self) -> tuple[float, float, float]:
        """Fiducial point of the cube, in these axes."""
        x, y, z = (float(a + b) for a, b in zip(self.setback, self.cube.fiducial, strict=True))
        return (x, y, z)

    @property
    def range_constant(self) -> float:
        """Constant from the measured length to the mirror's face."""
        return self.cube.range_constant + self.point[2]

    @property
    def acceptance(self) -> float:
        """Acceptance of the cube behind the mirror."""
        return self.cube.acceptance

    def range_change(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Range change of cube and lever.

        The lever from the face's origin to its point: z (cos I - 1) + sin I (x cos a + y sin a).
        """
        angle, turn = np.broadcast_arrays(incidences(incidence), np.asarray(azimuth, dtype=float))
        x, y, z = self.point
        lever = -2.0 * z * np.sin(0.5 * angle) ** 2 + np.sin(angle) * (x * np.cos(turn) + y * np.sin(turn))
        return np.where(angle < RIGHT, self.cube.range_change(angle, turn) + lever, np.nan)

    def clear_area(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Clear area of the cube behind the mirror."""
        return self.cube.clear_area(incidence, azimuth)

    def return_share(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array:
        """Returned share of the cube behind the mirror."""
        return self.cube.return_share(incidence, azimuth)

    def sectors(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Sectors:
        """Sectors of the cube behind the mirror."""
        return self.cube.sectors(incidence, azimuth)
