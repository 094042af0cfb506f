"""A star's place against astropy, against a printed apparent place with sidereal time by hand, and at the limits."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.sky.star import POLARIS, Star, star_place
from monument_scene import ARCSECOND, HEIGHT, LATITUDE, LONGITUDE

PHI, LAM = np.radians(LATITUDE), np.radians(LONGITUDE)
THETA_PERSEI = Star(
    "theta Persei",
    np.radians((2 + 44 / 60 + 11.986 / 3600) * 15),
    np.radians(49 + 13 / 60 + 42.48 / 3600),
    0.03425 * 15 * np.cos(np.radians(49.2284)) * ARCSECOND,
    -0.0895 * ARCSECOND,
)


def test_polaris_is_where_astropy_has_it():
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time
    from astropy.utils import iers

    table = iers.IERS_B.open()
    with iers.conf.set_temp("auto_download", False), iers.earth_orientation_table.set(table):
        mjd = np.array([54_000.1, 55_217.37, 57_204.9])
        when = Time(mjd, format="mjd", scale="utc")
        ut1 = table.ut1_utc(when).to_value(u.s)
        poles = np.column_stack([v.to_value(u.rad) for v in table.pm_xy(when)])
        place = EarthLocation.from_geodetic(LONGITUDE, LATITUDE, HEIGHT, ellipsoid="GRS80")
        for k, one in enumerate(when):
            sky = SkyCoord(
                POLARIS.right_ascension * u.rad,
                POLARIS.declination * u.rad,
                distance=1000 / 7.54 * u.pc,
                pm_ra_cosdec=44.48 * u.mas / u.yr,
                pm_dec=-11.85 * u.mas / u.yr,
                radial_velocity=-16.42 * u.km / u.s,
                obstime=Time(2000.0, format="jyear", scale="tdb"),
            ).apply_space_motion(one)
            seen = sky.transform_to(AltAz(obstime=one, location=place))
            azimuth, zenith = star_place(
                POLARIS, mjd[k], PHI, longitude=LAM, height=HEIGHT, ut1_utc=ut1[k], pole=tuple(poles[k])
            )
            # Both rest on ERFA; the ways through it differ, by parallax and light deflection at finite distance.
            assert azimuth == pytest.approx(seen.az.rad, abs=5e-3 * ARCSECOND)
            assert zenith == pytest.approx(seen.zen.rad, abs=5e-3 * ARCSECOND)


def test_theta_persei_by_its_printed_apparent_place():
    # Meeus, Astronomical algorithms, example 23.a: 2028 November 13.19 TD, apparent 2h46m14.390s, +49°21'07.45".
    # Sidereal time by his eq. 12.4 with nutation +14.861" at obliquity 23.436°; UT1 = UTC = TD - 69.184 s here.
    jd = 2_462_088.69 - 69.184 / 86_400
    t = (jd - 2_451_545.0) / 36_525
    mean = 280.46061837 + 360.98564736629 * (jd - 2_451_545.0) + 0.000387933 * t**2 - t**3 / 38_710_000
    apparent = mean + 14.861 / 3600 * np.cos(np.radians(23.436))
    hour = np.radians(apparent + LONGITUDE) - np.radians((2 + 46 / 60 + 14.390 / 3600) * 15)
    dec = np.radians(49 + 21 / 60 + 7.45 / 3600)
    east = -np.cos(dec) * np.sin(hour)
    north = np.cos(PHI) * np.sin(dec) - np.sin(PHI) * np.cos(dec) * np.cos(hour)
    up = np.sin(PHI) * np.sin(dec) + np.cos(PHI) * np.cos(dec) * np.cos(hour)
    azimuth, zenith = star_place(THETA_PERSEI, jd - 2_400_000.5, PHI, longitude=LAM)
    # What the printed place lacks is the diurnal aberration, 0.25".
    across = np.remainder(azimuth - np.arctan2(east, north) + np.pi, 2 * np.pi) - np.pi
    off = np.array([across * np.hypot(east, north), zenith - np.arctan2(np.hypot(east, north), up)])
    assert np.hypot(*off) / ARCSECOND < 0.5


def test_polaris_moves_in_azimuth_by_a_fifth_of_a_second_a_second_at_most():
    mjd = 61_280.0 + np.arange(0, 1, 1 / 288)
    moved = (
        star_place(POLARIS, mjd, PHI, longitude=LAM, ut1_utc=0.9)[0] - star_place(POLARIS, mjd, PHI, longitude=LAM)[0]
    ) / 0.9
    moved = np.remainder(moved + np.pi, 2 * np.pi) - np.pi
    assert np.abs(moved).max() / ARCSECOND == pytest.approx(0.21, abs=0.03)


def test_times_and_stars_that_cannot_be_meant_are_refused():
    with pytest.raises(ValidityError, match="1972 to 2100"):
        star_place(POLARIS, 2_461_280.5, PHI, longitude=LAM)
    with pytest.raises(ValidityError, match="degrees"):
        Star("Polaris", 37.95, 89.26)
    late = star_place(POLARIS, 85_000.0, PHI, longitude=LAM)[1]  # no leap seconds are known there: no warning either
    assert np.isfinite(late)
