"""Direction of the Sun from a place on the ground: unit vector in x east, y north, z up.

    UTC --leap seconds--> TAI --> TT --> Earth's place and velocity, Sun's place one light time earlier
                                          less the observer's own place (parallax, 8.8") --> direction in space
                                          aberration (20.5") --> direction as a moving observer sees it
                                          precession and nutation --> true equator and equinox of date
    UTC --UT1 - UTC--> UT1 --> sidereal time --> axes that turn with the Earth --> east, north, up

Neglected, with sizes: motion of the pole, at most 0.6"; TDB less TT, 2 ms; the bending of light by the
Sun itself, which does not move its middle.

z is the normal of the ellipsoid. Where the ground frame's z is the plumb line, the whole sky is turned by the
deflection of the vertical, some 10" and up to 60" in mountains. And the axes belong to one place: the normal turns by
4" over 120 m, so that all rangers of a site take the direction at the origin of the frame.

Source: [PARKER04] section 2.7, eq. 2.47.
"""

import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI, ZERO_CELSIUS_K
from catseye.errors import ValidityError

EARLIEST_MJD, LATEST_MJD = 41_317.0, 88_069.0  # 1972, when leap seconds begin, to 2100, the end of the theory
MJD_ZERO = 2_400_000.5  # JD
EARTH_RATE = 7.292_115e-5  # rad/s
SUN_RATE = 7.3e-5  # rad/s: bound of the Sun's motion in the ground frame
LOWEST = (np.sqrt(10.3) - 5.11) * DEGREE  # -1.9 degrees: the refraction is greatest, and constant below


def sun_direction(
    mjd: ArrayLike,
    latitude: ArrayLike,
    longitude: ArrayLike,
    height: ArrayLike = 0.0,
    *,
    ut1_minus_utc: ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """Unit vector (..., 3) to the Sun's middle without air: x east, y north, z up.

    mjd              (...), UTC, 41317 to 88069 (1972 to 2099)
    latitude         (...), rad, geodetic, -pi/2 to pi/2
    longitude        (...), rad, east positive
    height           (...), m above the ellipsoid, -1000 to 100 000
    ut1_minus_utc    (...), s, -1 to 1; at 0 the error is up to 13.5" in hour angle

    Raises ValidityError outside these. Leap seconds are those in erfa; a later one does not change the hour angle
    (UT1 - UTC compensates) and moves the Sun among the stars by 0.04".

    Source: [SOFA23], its astrometry and time cookbooks: pnm06a, gst06a, epv00, ab. Within 0.3" of the library PyMeeus
    (VSOP87) from 1972 to 2072, 0.7" of PyEphem and 1.2" of astropy's own route at equal UT1 - UTC.

    >>> noon = sun_direction(52892.72, np.radians(38.433), np.radians(-79.840), 807.0)
    >>> [round(float(np.degrees(a)), 2) for a in altitude_azimuth(noon)]
    [56.47, 180.19]
    """
    import erfa

    day = _checked(mjd, EARLIEST_MJD, LATEST_MJD, "mjd", "UTC as Modified Julian Day")
    phi = _checked(latitude, -0.5 * np.pi, 0.5 * np.pi, "latitude", "rad")
    lam = _checked(longitude, -TWO_PI, TWO_PI, "longitude", "rad")
    h = _checked(height, -1e3, 1e5, "height", "m")
    dut1 = _checked(ut1_minus_utc, -1.0, 1.0, "ut1_minus_utc", "s")
    tt, ut1 = _clocks(day, dut1)
    true_from_space = erfa.pnm06a(MJD_ZERO, tt)
    sidereal = erfa.gst06a(MJD_ZERO, ut1, MJD_ZERO, tt)
    place = np.stack(np.broadcast_arrays(*np.moveaxis(erfa.gd2gc(1, lam, phi, h), -1, 0)), axis=-1)
    observer = _turned(place, sidereal)
    velocity = EARTH_RATE * np.stack([-observer[..., 1], observer[..., 0], np.zeros_like(observer[..., 0])], axis=-1)
    space_from_true = np.swapaxes(true_from_space, -1, -2)
    apparent = _seen_from(tt, _applied(space_from_true, observer), _applied(space_from_true, velocity))
    earth_fixed = _turned(_applied(true_from_space, apparent), -sidereal)
    return _east_north_up(earth_fixed, phi, lam)


def refracted(direction: ArrayLike, pressure_hpa: ArrayLike, temperature_c: ArrayLike) -> NDArray[np.float64]:
    """Apparent direction (..., 3) of a star or the Sun through the air.

    It is raised towards the zenith.

    direction        (..., 3), unit, x east, y north, z up, without air
    pressure_hpa     (...), at the observer, 0 to 1200; 0 is no air
    temperature_c    (...), at the observer, -80 to 60

    Visible light; at 780 nm it is 1 % less. Below an altitude of -1.9 degrees it is constant, 45'.

    Source: [MEEUS98] eq. 16.4 (Saemundsson) with its factor for pressure and temperature, within 6" of his eq. 16.3.
    Above 20 degrees it is within 7" (4 %) of erfa.refco; that two-term model does not reach the horizon, where it
    matters most here, and where the layers of the air change any formula by some minutes of arc.

    >>> float(np.degrees(np.arcsin(refracted([0.0, 1.0, 0.0], 1010.0, 10.0)[2])).round(3))
    0.483
    """
    pressure = _checked(pressure_hpa, 0.0, 1200.0, "pressure_hpa", "hPa")
    temperature = _checked(temperature_c, -80.0, 60.0, "temperature_c", "C")
    east, north, up = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    level = np.hypot(east, north)
    altitude = np.arctan2(up, level)
    degrees = np.maximum(altitude, LOWEST) / DEGREE
    minutes = 1.02 / np.tan((degrees + 10.3 / (degrees + 5.11)) * DEGREE) + 0.0019279  # keeps the zenith fixed
    air = pressure / 1010.0 * (ZERO_CELSIUS_K + 10.0) / (ZERO_CELSIUS_K + temperature)
    raised = np.minimum(altitude + minutes / 60.0 * DEGREE * air, np.maximum(altitude, 0.5 * np.pi))
    shrink = np.cos(raised) / np.where(level > 0.0, level, 1.0)
    return np.stack(np.broadcast_arrays(east * shrink, north * shrink, np.sin(raised)), axis=-1)


def altitude_azimuth(direction: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Altitude (...) and azimuth (...) in [0, 2 pi) clockwise from north, rad.

    direction    (..., 3), any length, x east, y north, z up

    >>> [float(np.degrees(a).round(9)) for a in altitude_azimuth([1.0, 0.0, 1.0])]
    [45.0, 90.0]
    """
    east, north, up = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    return np.arctan2(up, np.hypot(east, north)), np.arctan2(east, north) % TWO_PI


def _clocks(utc: NDArray[np.float64], dut1: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """TT and UT1 as Modified Julian Days, to a microsecond (0.015 milliseconds of arc)."""
    import erfa

    with warnings.catch_warnings():
        # "dubious year": before 1960, and where a leap second might be announced that erfa does not know yet.
        warnings.simplefilter("ignore", erfa.ErfaWarning)
        tai = erfa.utctai(MJD_ZERO, utc)
        ut1 = erfa.utcut1(MJD_ZERO, utc, dut1)
    tt = erfa.taitt(*tai)
    return (tt[0] - MJD_ZERO) + tt[1], (ut1[0] - MJD_ZERO) + ut1[1]


def _sun_vector(tt: NDArray[np.float64], off: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vector to the Sun one light time ago, m, and the Earth's velocity, m/s.

    off   (..., 3), m, observer from the Earth's centre
    """
    import erfa

    about_sun, about_all = erfa.epv00(MJD_ZERO, tt)
    to_sun = -about_sun["p"] * erfa.DAU - off
    # The Sun's own speed about the solar system's centre is 15 m/s, 0.01" in all: one step of the light time is enough.
    sun_velocity = (about_all["v"] - about_sun["v"]) * erfa.DAU / SECONDS_PER_DAY
    light_time = np.linalg.norm(to_sun, axis=-1, keepdims=True) / SPEED_OF_LIGHT
    return to_sun - sun_velocity * light_time, about_all["v"] * erfa.DAU / SECONDS_PER_DAY


def _seen_from(tt: NDArray[np.float64], off: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vector (..., 3) to the Sun in space axes for a moving observer."""
    import erfa

    to_sun, earth_velocity = _sun_vector(tt, off)
    distance = np.linalg.norm(to_sun, axis=-1)
    beta = (earth_velocity + velocity) / SPEED_OF_LIGHT
    slow = np.sqrt(1.0 - np.sum(beta**2, axis=-1))
    return erfa.ab(to_sun / distance[..., None], beta, distance / erfa.DAU, slow)


def _east_north_up(v: NDArray[np.float64], phi: NDArray[np.float64], lam: NDArray[np.float64]) -> NDArray[np.float64]:
    """Earth-fixed vectors (..., 3) along east, north and normal at latitude phi, longitude lam."""
    x, y, z = np.moveaxis(_turned(v, -lam), -1, 0)
    parts = (y, np.cos(phi) * z - np.sin(phi) * x, np.cos(phi) * x + np.sin(phi) * z)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _turned(v: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3) turned about z by an angle (...), right-handed."""
    x, y, z = np.moveaxis(v, -1, 0)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack(np.broadcast_arrays(c * x - s * y, s * x + c * y, z), axis=-1)


def _applied(matrix: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("...ij,...j->...i", matrix, v)


def _checked(value: ArrayLike, low: float, high: float, name: str, unit: str) -> NDArray[np.float64]:
    """Float value, refused outside its range or if not a number."""
    array = np.asarray(value, dtype=float)
    bad = ~((array >= low) & (array <= high))
    if np.any(bad):
        first = float(array[bad].flat[0]) if array.ndim else float(array)
        raise ValidityError(f"{name} = {first:.10g} is outside {low:.10g} to {high:.10g} ({unit}): check its unit")
    return array
