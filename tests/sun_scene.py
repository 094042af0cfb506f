"""A ranger under the Sun, and a check of its beam that shares no formula with the guard.

The mount's turns come from scipy's rotations, the Sun from astropy, the axes' profiles from integrating their speeds.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.geometry.mirror.pointing import MirrorStation
from catseye.geometry.mirror.slew import Pace
from catseye.records.files.reading import read_record
from catseye.records.site.keep_out import KeepOut
from catseye.reduction.site.earth_rotation import FramePlace
from catseye.reduction.steering.guard import Guard
from repository import ROOT

DEGREE = np.pi / 180
LATITUDE_DEG, LONGITUDE_DEG, HEIGHT = 38.433, -79.84, 807.0
GREEN_BANK = FramePlace(LATITUDE_DEG * DEGREE, LONGITUDE_DEG * DEGREE, HEIGHT)
MORNING = 52889.65  # 2003-09-07, 15:36 UTC: the Sun 50 degrees high in the south-east
ALPHA, BETA, ZEROS = (-0.2492780, 9e-7, 5.31e-5), (-6.37e-4, 1.21e-4), (5931.0, 3062.0)
STATION = MirrorStation([29.503743, 115.941781, 0.148752], ALPHA, [-7.5e-5, 0.247425, -8.51e-4], BETA, ZEROS)
STOPS = (-18_069.0, 78_931.0)
PACE = Pace((10_000.0, 5_000.0), (20_000.0, 10_000.0))


def guard(**changes):
    """ZY101 under the Sun, no boxes, no margin."""
    given = {
        "name": "ZY101",
        "station": STATION,
        "pace": PACE,
        "azimuth_limits": STOPS,
        "place": GREEN_BANK,
        "margin_counts": (0.0, 0.0),
    }
    return Guard(**{**given, **changes})


def boxes():
    """Those of the example."""
    return read_record(ROOT / "examples" / "keep-out.toml", KeepOut).boxes()


def beam(counts):
    """Unit directions (..., 3), ground, at counts (..., 2): the mount's chain by scipy's (active) rotations."""
    theta = (counts[..., 0] - ZEROS[0]) * 2 * np.pi / 1e5
    phi = (counts[..., 1] - ZEROS[1]) * 4 * np.pi / 1e5
    u = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=-1)
    a1, a2, a3 = ALPHA
    # Axes turned by an angle: the coordinates turn back. The mount's axes begin as east, up, south.
    upright = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    mirror = (
        Rotation.from_rotvec([-BETA[0], 0, 0])
        * Rotation.from_rotvec([0, -BETA[1], 0])
        * Rotation.from_rotvec([-a3, 0, 0])
        * Rotation.from_rotvec([0, 0, -a2])
        * Rotation.from_rotvec([0, -a1, 0])
        * upright
    )
    return mirror.inv().apply(u.reshape(-1, 3)).reshape(u.shape)


def astropy_sun(mjd):
    """The Sun (n, 3) by astropy's own route: ICRS to AltAz, with polar motion and its Earth rotation tables.

    The installed tables, whatever the day it is run and whatever table another test had set.
    """
    import astropy.units as u
    from astropy.coordinates import AltAz, EarthLocation, get_body
    from astropy.time import Time
    from astropy.utils import iers

    with (
        iers.conf.set_temp("auto_download", False),
        iers.conf.set_temp("auto_max_age", None),
        iers.conf.set_temp("iers_degraded_accuracy", "ignore"),
        iers.earth_orientation_table.set(iers.IERS_Auto.open()),
    ):
        place = EarthLocation.from_geodetic(LONGITUDE_DEG * u.deg, LATITUDE_DEG * u.deg, HEIGHT * u.m)
        time = Time(mjd, format="mjd", scale="utc")
        seen = get_body("sun", time, place, ephemeris="builtin").transform_to(AltAz(obstime=time, location=place))
        alt, az = seen.alt.rad, seen.az.rad
    return np.stack([np.cos(alt) * np.sin(az), np.cos(alt) * np.cos(az), np.sin(alt)], axis=-1)


def apart(a, b):
    """Angle (...), rad, between unit vectors."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def profile(start, end, looks):
    """Times (n, looks + 6), s, and counts (n, looks + 6, 2) of axes that speed up, run, slow down: by their speeds."""
    way = np.abs(end - start)
    v, a = np.array(PACE.velocity), np.array(PACE.acceleration)
    last = np.where(way > v**2 / a, way / v + v / a, 2 * np.sqrt(way / a))
    up = np.minimum(v / a, last / 2)
    even = np.linspace(0, 1, looks) * np.max(last, axis=-1, keepdims=True)
    # With its corners among the looks the speed is straight between them, and trapezoids give its integral exactly.
    time = np.sort(np.concatenate([even, up, last - up, last], axis=-1), axis=-1)
    t = np.minimum(time[:, :, None], last[:, None])
    speed = np.minimum(np.minimum(a * t, v), a * (last[:, None] - t))
    steps = 0.5 * (speed[:, 1:] + speed[:, :-1]) * np.diff(t, axis=1)
    done = np.concatenate([np.zeros((len(way), 1, 2)), np.cumsum(steps, axis=1)], axis=1)
    full = np.where(done[:, -1:] > 0, done[:, -1:], 1)
    return time, start[:, None] + (end - start)[:, None] * done / full


def random_counts(rng, n, near=None):
    """Counts (n, 2) between the stops; half of them about some counts (2,) where these are given."""
    c = np.stack([rng.uniform(*STOPS, n), ZEROS[1] + rng.uniform(-25_000, 25_000, n)], axis=-1)
    if near is not None:
        c[::2] = near + rng.normal(0, 1, (len(c[::2]), 2)) * [4000, 2000]
        c[:, 0] = np.clip(c[:, 0], *STOPS)
    return c
