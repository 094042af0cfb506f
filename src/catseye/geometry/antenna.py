"""The telescope's nominal frames: reflector, elevation, alidade, ground.

A rigid telescope on a perfect track. Gravity, temperature and track move the real one by millimetres, which is what
the rangers are there to find.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.geometry.frame import Transform
from catseye.geometry.rotation import rx, rz

ELEVATION_AXIS_HEIGHT = 48.260  # m above the alidade's origin, [PARKER04] eq. 2.42
REFLECTOR_TO_ELEVATION = (0.0, -54.839108, 4.999990)  # m, the vertex in the elevation frame, [PARKER04] eq. 2.43


def ground_from_alidade(azimuth: float) -> Transform:
    """Transform of alidade points into the ground frame.

    azimuth    rad, any, astronomical: clockwise from north

    Source: [PARKER04] eq. 2.40. Exact for a perfect track.

    >>> ground_from_alidade(np.pi / 2).points([0.0, 1.0, 0.0]).round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    return Transform("ground", "alidade", rz(azimuth), np.zeros(3))


def alidade_from_elevation(elevation: float, *, elevation_axis_height: float) -> Transform:
    """Transform of elevation-structure points into the alidade frame.

    elevation                rad, 0 to pi/2 in use; at pi/2 the two frames are parallel
    elevation_axis_height    m, of the elevation axis above the alidade's origin

    Source: [PARKER04] eq. 2.41 and 2.42. Exact for a rigid telescope.

    >>> alidade_from_elevation(0.0, elevation_axis_height=48.260).points([0.0, 0.0, 1.0]).round(12).tolist()
    [0.0, 1.0, 48.26]
    """
    return Transform("alidade", "elevation", rx(np.pi / 2 - elevation), np.array([0.0, 0.0, elevation_axis_height]))


def elevation_from_reflector(*, reflector_to_elevation: ArrayLike) -> Transform:
    """Transform of reflector points into the elevation frame, a translation.

    reflector_to_elevation    (3,), m, the vertex of the parent paraboloid in the elevation frame

    Source: [PARKER04] eq. 2.43. Exact for a rigid telescope.

    >>> elevation_from_reflector(reflector_to_elevation=(0.0, -54.8, 5.0)).points([0.0, 0.0, 60.0]).tolist()
    [0.0, -54.8, 65.0]
    """
    return Transform("elevation", "reflector", np.eye(3), np.asarray(reflector_to_elevation, dtype=float))


def ground_from_reflector(
    azimuth: float,
    elevation: float,
    *,
    elevation_axis_height: float = ELEVATION_AXIS_HEIGHT,
    reflector_to_elevation: ArrayLike = REFLECTOR_TO_ELEVATION,
) -> Transform:
    """Transform of reflector points into the ground frame at a nominal posture.

    azimuth                   rad, any, clockwise from north
    elevation                 rad, 0 to pi/2 in use
    elevation_axis_height     m, of the elevation axis above the alidade's origin
    reflector_to_elevation    (3,), m, the vertex of the parent paraboloid in the elevation frame

    Source: [PARKER04] eq. 2.44, whose print omits the plus signs between X_r and its offset. Nominal: the real
    telescope is some millimetres away.

    >>> ground_from_reflector(np.pi / 2, np.pi / 4).points([0.0, 0.0, 60.0]).round(6).tolist()
    [7.184829, 0.0, 132.999039]
    """
    return (
        ground_from_alidade(azimuth)
        @ alidade_from_elevation(elevation, elevation_axis_height=elevation_axis_height)
        @ elevation_from_reflector(reflector_to_elevation=reflector_to_elevation)
    )
