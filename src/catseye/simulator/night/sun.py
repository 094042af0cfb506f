"""Elevation of the Sun over the site."""

import numpy as np

from catseye.constants import DEGREE
from catseye.simulator.night.world import SITE_LATITUDE_DEG

SITE_LONGITUDE_DEG = -79.839835
J2000_MJD = 51_544.5


def sine_of_sun(mjd_utc, *, latitude_deg: float = SITE_LATITUDE_DEG, longitude_deg: float = SITE_LONGITUDE_DEG):
    """Sine of the Sun's elevation at times (...), 0 at night.

    Without refraction.

    Source: [MEEUS98] eqs. 12.4 (sidereal time), 13.6 (altitude) and ch. 25, low accuracy. Good to 0.01 degree.

    >>> round(float(np.degrees(np.arcsin(sine_of_sun(52892.72)))), 2)
    56.47
    """
    day = np.asarray(mjd_utc, dtype=float) - J2000_MJD
    anomaly = (357.52911 + 0.98560028 * day) * DEGREE
    centre = 1.914602 * np.sin(anomaly) + 0.019993 * np.sin(2.0 * anomaly)
    ecliptic = (280.46646 + 0.98564736 * day + centre) * DEGREE
    tilt = (23.43929 - 3.563e-7 * day) * DEGREE
    declination = np.arcsin(np.sin(tilt) * np.sin(ecliptic))
    ascension = np.arctan2(np.cos(tilt) * np.sin(ecliptic), np.cos(ecliptic))
    hour_angle = (280.46061837 + 360.98564736629 * day + longitude_deg) * DEGREE - ascension
    latitude = latitude_deg * DEGREE
    sine = np.sin(latitude) * np.sin(declination) + np.cos(latitude) * np.cos(declination) * np.cos(hour_angle)
    return np.maximum(sine, 0.0)
