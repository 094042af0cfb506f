"""A monument with a theodolite, a level and a tube of water on it, made from vectors: nothing of catseye is used.

PROJ carries coordinates between the ground and the earth's centre, scipy turns, and readings are what instruments of
these shapes would show.
"""

from functools import lru_cache

import numpy as np
from pyproj import Transformer
from scipy.spatial.transform import Rotation

ARCSECOND = np.pi / 648_000
LATITUDE = 38 + 25 / 60 + 59.236 / 3600  # degrees
LONGITUDE = -(79 + 50 / 60 + 23.406 / 3600)
HEIGHT = 806.42 - 31.0


@lru_cache(maxsize=8)
def topocentric(latitude=LATITUDE, longitude=LONGITUDE, height=HEIGHT):
    """PROJ's own way from longitude, latitude (degrees) and height to east, north, up."""
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=GRS80 "
        f"+step +proj=topocentric +ellps=GRS80 +lat_0={latitude!r} +lon_0={longitude!r} +h_0={height!r}"
    )


def horizon(latitude, longitude):
    """(3, 3) geocentric components of east, north, up, one a column; degrees."""
    return Rotation.from_euler("ZX", [longitude + 90.0, 90.0 - latitude], degrees=True).as_matrix()


def plumb_axes(point, xi=0.0, eta=0.0):
    """(3, 3) ground components of astronomic east, north, zenith at a ground point (m), one a column; rad."""
    longitude, latitude, _ = topocentric().transform(*point, direction="INVERSE")
    astronomic = horizon(latitude + np.degrees(xi), longitude + np.degrees(eta / np.cos(np.radians(latitude))))
    return horizon(LATITUDE, LONGITUDE).T @ astronomic


def mount_axes(azimuth, alpha2=0.0, alpha3=0.0):
    """(3, 3) ground components of x^, y^, z^, one a column: built level, then turned about z^ and about the new x^."""
    level = np.column_stack(
        [[-np.cos(azimuth), np.sin(azimuth), 0.0], [0.0, 0.0, 1.0], [np.sin(azimuth), np.cos(azimuth), 0.0]]
    )
    return level @ Rotation.from_euler("ZX", [alpha2, alpha3]).as_matrix()


def slope(direction, plumb):
    """How far a ground direction rises above the horizon of a plumb line's axes, rad."""
    return np.arcsin(direction @ plumb[:, 2] / np.linalg.norm(direction))


def circle(sight, plumb, lean=(0.0, 0.0)):
    """Reading of a levelled circle whose zero is astronomic north, and the zenith angle, rad.

    lean   rad, of the top of its vertical axis to the east and to the north
    """
    axes = plumb @ Rotation.from_rotvec([-lean[1], lean[0], 0.0]).as_matrix()
    east, north, up = axes.T @ sight
    return np.arctan2(east, north), np.arctan2(np.hypot(east, north), up)


def water(first, last, *, zeros, vessel_from, depth, densities, filling=0.1):
    """Readings of both vessels, m, of water that stands as its weight has it.

    first, last   heights of the feet; the tube hangs to `depth` below the water; densities of both drops
    """
    bottom = filling - depth
    surface = np.array([filling, bottom + depth * densities[0] / densities[1]])
    of_vessel = np.array(zeros if vessel_from == 1 else zeros[::-1])
    return surface - np.array([first, last]) - of_vessel
