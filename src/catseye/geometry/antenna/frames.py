"""Nominal frames: reflector, elevation, alidade, ground, and reflector-mounted frames.

    ground <- alidade <- elevation <- reflector <- prime_focus <- subreflector (its six degrees of freedom: that file)
                                                <- feed_arm

A rigid telescope on a perfect track. Gravity, temperature and track move the real one by millimetres and more:
`deformation` models that, and the rangers measure the remainder.
One posture is a `Transform`; many at once, along a path in time, are `Transforms`.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.geometry.frames.frame import Transform, Transforms
from catseye.geometry.frames.rotation import rx, rz

ELEVATION_AXIS_HEIGHT = 48.260  # m above the alidade's origin, [PARKER04] eq. 2.42
REFLECTOR_TO_ELEVATION = (0.0, -54.839108, 4.999990)  # m, the vertex in the elevation frame, [PARKER04] eq. 2.43
FOCAL_LENGTH = 60.0  # m, of the parent paraboloid
FEED_ARM_FOOT = (0.0, -8.0, 10.0)  # m, reflector frame; chosen: no public source says where the arm begins


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
    """Transform of reflector points into the ground frame, nominal posture.

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


def reflector_from_prime_focus(*, focal_length: float = FOCAL_LENGTH) -> Transform:
    """Transform of prime-focus points into the reflector frame.

    A translation along the paraboloid's axis.

    focal_length    m, of the parent paraboloid

    That the two frames are parallel is our choice: the drawing (C35102M081B) is not public. Exact for a rigid
    telescope.

    Source: [PARKER04] section 2.6 names the frame.

    >>> reflector_from_prime_focus().points([0.0, 0.0, 0.0]).tolist()
    [0.0, 0.0, 60.0]
    """
    return Transform("reflector", "prime_focus", np.eye(3), np.array([0.0, 0.0, focal_length]))


def reflector_from_feed_arm(*, foot: ArrayLike = FEED_ARM_FOOT) -> Transform:
    """Transform of feed-arm points into the reflector frame.

    Parallel axes, the origin at the foot of the arm.

    foot    (3,), m, reflector frame

    Source: our choice of frame for the rangers of [PARKER04] section 2.6.1, which bend with the arm.

    >>> reflector_from_feed_arm().points([0.0, 8.0, -10.0]).tolist()
    [0.0, 0.0, 0.0]
    """
    return Transform("reflector", "feed_arm", np.eye(3), np.asarray(foot, dtype=float))


def ground_from_alidade_at(azimuth: ArrayLike) -> Transforms:
    """`ground_from_alidade` for azimuths (...), rad.

    Source: [PARKER04] eq. 2.40.
    """
    return Transforms("ground", "alidade", rz(azimuth), np.zeros(3))


def alidade_from_elevation_at(elevation: ArrayLike, *, elevation_axis_height: float) -> Transforms:
    """`alidade_from_elevation` for elevations (...), rad.

    Source: [PARKER04] eq. 2.41 and 2.42.
    """
    turn = rx(np.pi / 2 - np.asarray(elevation, dtype=float))
    return Transforms("alidade", "elevation", turn, np.array([0.0, 0.0, elevation_axis_height]))


def ground_from_reflector_at(
    azimuth: ArrayLike,
    elevation: ArrayLike,
    *,
    elevation_axis_height: float = ELEVATION_AXIS_HEIGHT,
    reflector_to_elevation: ArrayLike = REFLECTOR_TO_ELEVATION,
) -> Transforms:
    """`ground_from_reflector` for azimuths and elevations (...), rad, that broadcast.

    Source: [PARKER04] eq. 2.44.
    """
    return (
        ground_from_alidade_at(azimuth)
        @ alidade_from_elevation_at(elevation, elevation_axis_height=elevation_axis_height)
        @ elevation_from_reflector(reflector_to_elevation=reflector_to_elevation)
    )
