"""Axes of a telescope that follows a star: against astropy, differences, and the laws of the sky."""

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.geometry.sky.star import Star
from catseye.reduction.site.earth_rotation import FramePlace
from catseye.reduction.steering.sky_path import star_axes

GREEN_BANK = FramePlace(38.433121 * DEGREE, -79.839835 * DEGREE, 806.4)
CRAB = Star("Crab", 83.6331 * DEGREE, 22.0145 * DEGREE)
BEGIN = 52889.375  # 2003-09-07, 9 h UTC


def test_azimuth_and_elevation_are_astropy_s():
    from astropy import units
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    azimuth, elevation = star_axes(CRAB, BEGIN, 600.0, GREEN_BANK)
    seconds = np.array([0.0, 151.3, 600.0])
    location = EarthLocation.from_geodetic(-79.839835, 38.433121, 806.4)
    times = Time(BEGIN + seconds / 86_400.0, format="mjd", scale="utc")
    seen = SkyCoord(83.6331 * units.deg, 22.0145 * units.deg).transform_to(AltAz(obstime=times, location=location))
    # 1": polar motion, which star_place is not told here, is below 0.6"
    np.testing.assert_allclose(azimuth.at(seconds)[0] % (2 * np.pi), seen.az.rad, atol=ARCSECOND)
    np.testing.assert_allclose(elevation.at(seconds)[0], seen.alt.rad, atol=ARCSECOND)


def test_air_raises_the_star_and_leaves_its_azimuth():
    aired = FramePlace(GREEN_BANK.latitude, GREEN_BANK.longitude, 806.4, 1010.0)
    (azimuth, elevation), (same, higher) = (star_axes(CRAB, BEGIN, 10.0, place) for place in (GREEN_BANK, aired))
    lifted = higher.at(5.0)[0] - elevation.at(5.0)[0]
    assert lifted == pytest.approx(61.2 * ARCSECOND / np.tan(elevation.at(5.0)[0]), rel=0.02)  # 1.02': Meeus 16.4
    assert same.at(5.0)[0] == pytest.approx(azimuth.at(5.0)[0], abs=1e-12)


def test_rates_are_those_of_the_sphere():
    azimuth, elevation = star_axes(CRAB, BEGIN, 100.0, GREEN_BANK)
    a, e = azimuth.at(50.0), elevation.at(50.0)
    sidereal, latitude = 7.292116e-5, GREEN_BANK.latitude
    assert e[1] == pytest.approx(sidereal * np.cos(latitude) * np.sin(a[0]), rel=1e-3)  # a rising star: a east
    assert a[1] == pytest.approx(
        sidereal * (np.sin(latitude) - np.cos(latitude) * np.cos(a[0]) * np.tan(e[0])), rel=1e-3
    )
    assert 0.0 < abs(a[1]) <= azimuth.peak
    assert 0.0 < abs(a[2]) <= azimuth.acceleration * (1.0 + 1e-9)


def test_a_star_that_is_down_is_refused():
    with pytest.raises(InputError, match=r"is at elevation -\d+\.\d+ deg 0 s after the start"):
        star_axes(CRAB, BEGIN + 0.5, 10.0, GREEN_BANK)
