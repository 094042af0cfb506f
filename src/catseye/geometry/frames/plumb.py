"""Plumb line against the ground frame's z, and its effect on mounts.

Mounts are levelled and oriented by it.

A level and a theodolite refer to the local plumb line. Away from the origin the line leans outwards by the
curvature of the earth, d/R (3.9" at 120 m), and everywhere by the deflection of the vertical, xi to the north and eta
to the east. North turns too: meridians converge, by x tan(phi)/R at x east of the origin (3.1" at 120 m), and the
astronomic meridian differs from NAD83's by eta tan(phi), Laplace's equation. All of it is one rotation.

Signs by hand. Let v = (tx, ty, 1) be the zenith of a level at the point, in ground axes: tx = x/N + eta and
ty = y/M + xi; the curvature's part points outwards. A level shows the rise of the mount's axes above its horizon,
x^.v and z^.v. With alpha1 the axes lie along x0 = (cos a1, sin a1, 0) and z0 = (sin a1, -cos a1, 0), and by eq. 2.5
their third components are sin a2 and -cos a2 sin a3. So against the level alpha2' = x^.v, alpha3' = -z^.v, and against
the ground frame

    alpha2 = alpha2' - t.x0        alpha3 = alpha3' + t.z0

A mount that points at the pintle from a distance r has z0 = -outwards: levelled perfectly, alpha3 = -r/R.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.frames.local_frame import LocalFrame, horizon, radii

Floats = NDArray[np.float64]


def astronomic(frame: LocalFrame, points: ArrayLike) -> tuple[Floats, Floats]:
    """Astronomic latitude and longitude (rad) at points.

    frame    ground frame, with its deflection of the vertical
    points   (..., 3), m, ground

    Source: [TORGE12], the deflection of the vertical: Phi = phi + xi, Lambda = lambda + eta / cos phi.
    """
    latitude, longitude, _ = frame.geodetic(points)
    return latitude + frame.xi, longitude + frame.eta / np.cos(latitude)


def plumb_from_ground(frame: LocalFrame, points: ArrayLike) -> Floats:
    """Matrix (..., 3, 3) to astronomic east, north and zenith at points.

    frame    ground frame
    points   (..., 3), m, ground

    Azimuths in these axes are those of stars, zenith angles those of a level. Exact.

    Source: [TORGE12] (Laplace's equation is its first order, eta tan phi for a level sight).

    >>> from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE
    >>> frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, 775.0)
    >>> zenith = plumb_from_ground(frame, [0.0, -120.0, 0.0])[2]
    >>> (np.degrees(zenith[:2]) * 3600.0).round(2).tolist()  # leans outwards, here to the south
    [0.0, -3.89]
    """
    return horizon(*astronomic(frame, points)) @ frame.geocentric_from_ground


def lean(frame: LocalFrame, points: ArrayLike) -> Floats:
    """Lean of the plumb line from the frame's z, (..., 2) rad, east and north.

    frame    ground frame; where its z is the plumb line at the origin, the deflection is already included
    points   (..., 3), m, ground

    Curvature x/(N + h), y/(M + h), outwards, and the deflection; first order, good to 1e-9 rad within 300 m. For
    display and checks; the corrections use `plumb_from_ground`.

    >>> from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE
    >>> frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, 775.0, xi=1e-5)
    >>> lean(frame, [120.0, 0.0, 0.0]).round(7).tolist()
    [1.88e-05, 1e-05]
    """
    p = np.asarray(points, dtype=float)
    meridian, across = radii(frame.latitude)
    east = p[..., 0] / (across + frame.height) + (0.0 if frame.plumb else frame.eta)
    north = p[..., 1] / (meridian + frame.height) + (0.0 if frame.plumb else frame.xi)
    return np.stack([east, north], axis=-1)


def mount_angles(gamma_matrix: ArrayLike) -> Floats:
    """Angles alpha1, alpha2, alpha3 (..., 3), rad, of a mount's matrix.

    gamma_matrix   (..., 3, 3), from `geometry.mirror.mount.gamma`; alpha2 within ±pi/2

    Source: [PARKER04] eq. 2.5, elements 11, 12, 13, 23, 33. Exact.

    >>> from catseye.geometry.mirror.mount import gamma
    >>> mount_angles(gamma(1.008848, -0.000024, 0.000145)).round(9).tolist()
    [1.008848, -2.4e-05, 0.000145]
    """
    g = np.asarray(gamma_matrix, dtype=float)
    if g.shape[-2:] != (3, 3):
        raise ValidityError(f"mount's matrix has shape {g.shape}, expected (..., 3, 3)")
    return np.stack(
        [
            np.arctan2(g[..., 0, 1], g[..., 0, 0]),
            np.arctan2(g[..., 0, 2], np.hypot(g[..., 0, 0], g[..., 0, 1])),
            np.arctan2(-g[..., 2, 2], g[..., 1, 2]),
        ],
        axis=-1,
    )


def azimuth(vectors: ArrayLike) -> Floats:
    """Azimuth (...), rad in [0, 2 pi), clockwise from north, of vectors (..., 3) in east, north, up.

    >>> round(float(np.degrees(azimuth([-1.0, 0.0, 5.0]))), 9)
    270.0
    """
    v = np.asarray(vectors, dtype=float)
    return np.mod(np.arctan2(v[..., 0], v[..., 1]), 2.0 * np.pi)


def zenith_angle(vectors: ArrayLike) -> Floats:
    """Angle from the third axis (...), rad in [0, pi], of vectors (..., 3).

    >>> round(float(np.degrees(zenith_angle([0.0, 1.0, 1.0]))), 9)
    45.0
    """
    v = np.asarray(vectors, dtype=float)
    return np.arctan2(np.hypot(v[..., 0], v[..., 1]), v[..., 2])


def axis_lean_error(zenith: ArrayLike, lean_right: ArrayLike) -> Floats:
    """Theodolite reading error from a leaning vertical axis, rad.

    The mean of both faces has it too.

    zenith       (...), rad, of the sight
    lean_right   (...), rad, by which the top of the axis leans to the right of the line of sight

    By hand: axis v' = v + i r, r to the right. In the circle's plane the forward axis stays h, the axis to the right
    becomes r - i v. The sight sin z h + cos z v has components sin z and -i cos z there: it reads i cot z too low.
    A sight above the horizon with the axis leaning right reads too low, below the horizon too high.

    Source: [PARKER04] section 2.5 warns of it; first order, exact to 1e-8 rad for leans below 20" and z above 5°.

    >>> float(axis_lean_error(np.pi / 4, 1e-5).round(9))
    -1e-05
    """
    return -np.asarray(lean_right, dtype=float) / np.tan(np.asarray(zenith, dtype=float))
