"""Local ground frame on NAD83, and West Virginia's state plane.

The ellipsoid is GRS 80.

x east, y north, z up at the origin. z is the ellipsoid's normal there ("all of the metrology work uses the NAD83
directions"), or the plumb line on request. Heights: h above the ellipsoid, H elevation (NAVD88), N geoid height,
h = H + N. Metric state plane is EPSG:32151; EPSG:26854, the same zone, is in US survey feet and is refused by size.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import from_vector

SEMI_MAJOR = 6_378_137.0  # m, GRS 80
FLATTENING = 1.0 / 298.257222101  # GRS 80
E2 = FLATTENING * (2.0 - FLATTENING)  # first eccentricity squared
STATE_PLANE = "EPSG:32151"  # NAD83 / West Virginia South, metres
EASTINGS, NORTHINGS = (4.0e5, 8.2e5), (0.0, 3.0e5)  # m, of the zone; feet lie outside
MOST_DEFLECTION = 1e-3  # rad, 3.4': a larger value is in degrees or arcseconds
PINTLE_LATITUDE = (38.0 + 25.0 / 60.0 + 59.236 / 3600.0) * DEGREE  # NAD83
PINTLE_LONGITUDE = -(79.0 + 50.0 / 60.0 + 23.406 / 3600.0) * DEGREE  # east positive

Floats = NDArray[np.float64]


class Grid(NamedTuple):
    """Grid scale and convergence at a place.

    Grid length = scale * length on the ellipsoid, grid azimuth = azimuth - convergence (rad).
    """

    scale: Floats
    convergence: Floats


class Radii(NamedTuple):
    """Radii of the ellipsoid, m: meridian and prime vertical."""

    meridian: Floats
    prime_vertical: Floats


@dataclass(frozen=True)
class LocalFrame:
    """Ground frame: position of its origin, directions of its axes.

    latitude, longitude   rad, NAD83, of the vertical through the origin; east positive
    height                m, of the origin (z = 0) above the ellipsoid
    xi, eta               rad, deflection of the vertical, the same all over the site: the zenith that a level shows
                          lies xi north and eta east of the ellipsoid's normal; xi = Phi - phi, eta = (Lambda - lambda)
                          cos phi
    geoid_height          m, N at the origin; over the site N falls by xi to the north, by eta to the east
    plumb                 z is the plumb line at the origin: axes turned by xi and eta about x and y alone, azimuths
                          stay NAD83's; else z is the ellipsoid's normal

    Raises ValidityError for implausible values.

    Source: [PARKER04] section 2.1; [SNYDER87] (ellipsoid and projection). Exact to the rounding of coordinates of 6e6
    m: there and back 5e-10 m rms, 3e-9 m at most; by the state plane 7e-9 m.

    >>> frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, 775.0)
    >>> frame.from_geodetic(PINTLE_LATITUDE, PINTLE_LONGITUDE, 776.0).round(6).tolist()
    [0.0, 0.0, 1.0]
    """

    latitude: float
    longitude: float
    height: float
    xi: float = 0.0
    eta: float = 0.0
    geoid_height: float = 0.0
    plumb: bool = False

    def __post_init__(self) -> None:
        limits = {
            "latitude": 0.5 * np.pi,
            "longitude": 2.0 * np.pi,
            "height": 1e4,
            "xi": MOST_DEFLECTION,
            "eta": MOST_DEFLECTION,
            "geoid_height": 150.0,
        }
        for name, limit in limits.items():
            value = getattr(self, name)
            if not abs(value) <= limit:
                raise ValidityError(f"frame's {name} {value:.9g} is outside ±{limit:.5g} (rad and m)")

    @property
    def geocentric_from_ground(self) -> Floats:
        """Axes (3, 3) of the frame in geocentric ones, one a column."""
        axes = horizon(self.latitude, self.longitude).T
        return axes @ from_vector([-self.xi, self.eta, 0.0]) if self.plumb else axes

    @property
    def _origin(self) -> Floats:
        return _geocentric(self.latitude, self.longitude, self.height)

    def from_geodetic(self, latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike) -> Floats:
        """Points (..., 3), m, in the ground frame from geodetic coordinates.

        latitude, longitude   rad, NAD83, east positive
        height                m, above the ellipsoid
        """
        return (_geocentric(latitude, longitude, height) - self._origin) @ self.geocentric_from_ground

    def geodetic(self, points: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Latitude, longitude (rad, NAD83, east positive), ellipsoidal height (m) of points.

        points   (..., 3), m, ground
        """
        local = _triples(points)
        x, y, z = np.moveaxis(local @ self.geocentric_from_ground.T + self._origin, -1, 0)
        longitude, latitude, height = _cart().transform(x, y, z, radians=True, direction="INVERSE", errcheck=True)
        # PROJ's inverse is good to 3e-8 m; one step of Newton's method brings it to the rounding.
        off = (local - self.from_geodetic(latitude, longitude, height)) @ self.geocentric_from_ground.T
        east, north, up = np.moveaxis(np.einsum("...ij,...j->...i", horizon(latitude, longitude), off), -1, 0)
        meridian, across = radii(latitude)
        return (
            latitude + north / (meridian + height),
            longitude + east / ((across + height) * np.cos(latitude)),
            height + up,
        )

    def geoid(self, latitude: ArrayLike, longitude: ArrayLike) -> Floats:
        """Geoid height N, m, for a plane geoid.

        The plane is square to the plumb line.

        latitude, longitude   rad

        The zenith leans north by xi: the level surface, square to it, falls by xi a metre to the north.
        """
        meridian, across = radii(self.latitude)
        north = (meridian + self.height) * (np.asarray(latitude, dtype=float) - self.latitude)
        east = (across + self.height) * np.cos(self.latitude) * (np.asarray(longitude, dtype=float) - self.longitude)
        return self.geoid_height - self.xi * north - self.eta * east

    def from_state_plane(self, coordinates: ArrayLike) -> Floats:
        """Points (..., 3), m, in the ground frame from state plane coordinates.

        coordinates   (..., 3), m: easting, northing (West Virginia South, NAD83, metres) and elevation (NAVD88)

        Raises ValidityError for coordinates outside the zone, such as feet.
        """
        plane = _triples(coordinates)
        for name, values, (low, high) in zip(("easting", "northing"), (plane[..., 0], plane[..., 1]),
                                             (EASTINGS, NORTHINGS), strict=True):  # fmt: skip
            outside = ~((values >= low) & (values <= high))
            if outside.any():
                raise ValidityError(
                    f"{name} {values[outside].flat[0]:.9g} m is outside the zone West Virginia South, {low:g} to "
                    f"{high:g} m (EPSG:26854 is in US survey feet: multiply by 1200/3937)"
                )
        longitude, latitude = _zone()(plane[..., 0], plane[..., 1], inverse=True, radians=True, errcheck=True)
        return self.from_geodetic(latitude, longitude, plane[..., 2] + self.geoid(latitude, longitude))

    def state_plane(self, points: ArrayLike) -> Floats:
        """State plane easting, northing and elevation (..., 3), m, of points.

        West Virginia South, NAD83; NAVD88.

        points   (..., 3), m, ground
        """
        latitude, longitude, height = self.geodetic(points)
        easting, northing = _zone()(longitude, latitude, radians=True, errcheck=True)
        return np.stack([easting, northing, height - self.geoid(latitude, longitude)], axis=-1)


def horizon(latitude: ArrayLike, longitude: ArrayLike) -> Floats:
    """Matrix (..., 3, 3) from geocentric vectors to east, north, up.

    latitude, longitude   rad; of the ellipsoid's normal, or of the plumb line (astronomic)

    Source: [SNYDER87], directions on the ellipsoid. Exact.

    >>> horizon(0.0, 0.0).tolist()
    [[-0.0, 1.0, 0.0], [-0.0, -0.0, 1.0], [1.0, 0.0, 0.0]]
    """
    phi, lam = np.broadcast_arrays(np.asarray(latitude, dtype=float), np.asarray(longitude, dtype=float))
    sp, cp, sl, cl = np.sin(phi), np.cos(phi), np.sin(lam), np.cos(lam)
    rows = [[-sl, cl, np.zeros_like(sl)], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def grid(latitude: ArrayLike, longitude: ArrayLike) -> Grid:
    """Scale factor and convergence (rad) of the South state plane.

    latitude, longitude   rad, NAD83, east positive

    East of the central meridian, 81° W, grid north lies east of true north and the convergence is above zero.

    Source: [STEM89] (zone 4702, sign of the convergence); computed by PROJ's derivatives, good to 1e-10.

    >>> scale, convergence = grid(PINTLE_LATITUDE, PINTLE_LONGITUDE)
    >>> round(float(scale), 9), round(float(np.degrees(convergence)), 6)
    (0.999935066, 0.717209)
    """
    phi, lam = np.broadcast_arrays(np.asarray(latitude, dtype=float), np.asarray(longitude, dtype=float))
    factors = _zone().get_factors(lam, phi, radians=True, errcheck=True)
    # The projection is conformal: the scale is one in all directions, and the parallel's is the better conditioned.
    return Grid(np.asarray(factors.parallel_scale), np.radians(factors.meridian_convergence))


def radii(latitude: ArrayLike) -> Radii:
    """Radii of curvature of the ellipsoid.

    latitude   rad

    Source: [SNYDER87] eqs. 4-18, 4-20. Exact.

    >>> [round(float(r), 3) for r in radii(0.0)]
    [6335439.327, 6378137.0]
    """
    w2 = 1.0 - E2 * np.sin(np.asarray(latitude, dtype=float)) ** 2
    return Radii(SEMI_MAJOR * (1.0 - E2) / w2**1.5, SEMI_MAJOR / np.sqrt(w2))


def elevation_factor(latitude: ArrayLike, height: ArrayLike) -> Floats:
    """Elevation factor: length on the ellipsoid over length at a height.

    Times the grid's scale it is the combined factor.

    latitude   rad
    height     m, above the ellipsoid

    R/(R + h) with the mean radius R = sqrt(M N); between directions the factor R differs by 0.4 %, the factor
    by 5e-7 at 775 m.

    Source: [STEM89].

    >>> round(float(elevation_factor(PINTLE_LATITUDE, 775.0)), 9)
    0.999878413
    """
    meridian, across = radii(latitude)
    mean = np.sqrt(meridian * across)
    return mean / (mean + np.asarray(height, dtype=float))


def _geocentric(latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike) -> Floats:
    phi, lam, h = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (latitude, longitude, height)))
    if not np.all(np.abs(phi) <= 0.5 * np.pi):
        raise ValidityError(f"latitude {phi[~(np.abs(phi) <= 0.5 * np.pi)].flat[0]:.9g} is outside ±pi/2 rad")
    return np.stack(_cart().transform(lam, phi, h, radians=True, errcheck=True), axis=-1)


def _triples(points: ArrayLike) -> Floats:
    array = np.asarray(points, dtype=float)
    if array.shape[-1:] != (3,):
        raise ValidityError(f"points have shape {array.shape}, expected (..., 3)")
    return array


@lru_cache(maxsize=1)
def _cart() -> Any:
    """PROJ transformation, geodetic to geocentric, longitude first."""
    from pyproj import Transformer

    return Transformer.from_pipeline("+proj=cart +ellps=GRS80")


@lru_cache(maxsize=1)
def _zone() -> Any:
    """PROJ projection of the state plane zone, longitude first."""
    from pyproj import Proj

    return Proj(STATE_PLANE)
