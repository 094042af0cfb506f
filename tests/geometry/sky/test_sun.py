import tomllib
import warnings

import erfa
import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.sky.sun import (
    LATEST_MJD,
    SUN_RATE,
    altitude_azimuth,
    refracted,
    sun_direction,
)
from repository import TESTS
from sun_scene import DEGREE, GREEN_BANK, apart, astropy_sun

ARCSECOND = DEGREE / 3600
TABLES = tomllib.loads((TESTS / "vectors" / "sun.toml").read_text(encoding="utf-8"))
AU = 149_597_870_700.0


def horizontal(altitude, azimuth):
    return np.stack([np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)], axis=-1)


def apparent_geocentric(tt_mjd):
    """Right ascension and declination, rad, from the Earth's centre: `sun_direction` taken back from 0 N, 0 E.

    Less the diurnal aberration, 0.32", and the parallax, 8.8"; turned by sidereal time, in which UT1 is UTC as there.
    """
    zero = 2_400_000.5
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # its dubious years
        utc = erfa.taiutc(*erfa.tttai(zero, tt_mjd))
        day = (utc[0] - zero) + utc[1]
        sidereal = erfa.gst06a(*erfa.utcut1(zero, day, 0.0), zero, tt_mjd)
    east, north, up = np.moveaxis(sun_direction(day, 0.0, 0.0), -1, 0)
    seen = np.stack([up, east - 7.292115e-5 * 6_378_137.0 / 299_792_458.0, north], axis=-1)  # earth-fixed axes
    seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
    distance = AU * np.linalg.norm(erfa.epv00(zero, tt_mjd)[0]["p"], axis=-1)
    x, y, z = np.moveaxis(distance[..., None] * seen + [6_378_137.0, 0.0, 0.0], -1, 0)
    return (np.arctan2(y, x) + sidereal) % (2 * np.pi), np.arctan2(z, np.hypot(x, y))


def test_meeus_example_25b_is_met():
    row = TABLES["printed"][0]
    ra, dec = apparent_geocentric(row["tt_mjd"])
    # 0.1": IAU 1980 nutation and FK5 there, IAU 2006 here, 0.05" apart in 1992.
    assert abs(ra - row["right_ascension_deg"] * DEGREE) < 0.1 * ARCSECOND
    assert abs(dec - row["declination_deg"] * DEGREE) < 0.1 * ARCSECOND


def test_the_nrel_spa_example_is_met_through_its_air():
    spa = TABLES["spa"]
    seen = sun_direction(spa["utc_mjd"], spa["latitude_deg"] * DEGREE, spa["longitude_deg"] * DEGREE, spa["height_m"])
    seen = refracted(seen, spa["pressure_hpa"], spa["temperature_c"])
    printed = horizontal((90 - spa["zenith_deg"]) * DEGREE, spa["azimuth_deg"] * DEGREE)
    assert apart(seen, printed) < 1.08 * ARCSECOND  # SPA's own uncertainty, 0.0003 degrees


def test_pymeeus_agrees_from_1972_to_2072():
    tt, ra, dec = np.array(TABLES["pymeeus"]["rows"]).T
    assert tt[0] < 42_200
    assert tt[-1] > 78_800
    own_ra, own_dec = apparent_geocentric(tt)
    # 0.3": its precession and nutation of 1976 and 1980 drift by 0.3" a century from those of 2006.
    assert np.max(apart(horizontal(own_dec, own_ra), horizontal(dec * DEGREE, ra * DEGREE))) < 0.3 * ARCSECOND


def test_pyephem_agrees_where_it_stands_on_the_ground():
    table = TABLES["pyephem"]
    utc, dut1, altitude, azimuth = np.array(table["rows"]).T
    place = (table["latitude_deg"] * DEGREE, table["longitude_deg"] * DEGREE, table["height_m"])
    own = sun_direction(utc, *place, ut1_minus_utc=dut1)
    # 0.7": XEphem rounds its aberration and its parallax.
    assert np.max(apart(own, horizontal(altitude * DEGREE, azimuth * DEGREE))) < 0.7 * ARCSECOND


def test_astropys_own_route_agrees_at_its_own_ut1():
    from astropy.time import Time
    from astropy.utils import iers

    mjd = np.linspace(41_700.3, 61_300.7, 60)
    with iers.conf.set_temp("auto_download", False), iers.conf.set_temp("auto_max_age", None):
        dut1 = np.asarray(Time(mjd, format="mjd", scale="utc").delta_ut1_utc)
    own = sun_direction(mjd, GREEN_BANK.latitude, GREEN_BANK.longitude, GREEN_BANK.height, ut1_minus_utc=dut1)
    assert np.max(apart(own, astropy_sun(mjd))) < 1.2 * ARCSECOND  # polar motion 0.6", its treatment of the Sun's light


def test_astropy_agrees_a_hundred_years_without_tables():
    mjd = np.linspace(41_317.1, 78_000.9, 80)
    own = sun_direction(mjd, GREEN_BANK.latitude, GREEN_BANK.longitude, GREEN_BANK.height)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its dubious years, and times before and after its tables
        assert np.max(apart(own, astropy_sun(mjd))) < 20 * ARCSECOND  # UT1 = UTC here: 13.5" at most


def test_two_places_see_the_sun_apart_by_their_distance():
    # Spherical places are enough: a vector of 6378 km at one astronomical unit is 8.79", known to 1 % here.
    mjd, radius = 52_889.65, 6_378_137.0
    seen, at = [], []
    for latitude, longitude in ((0.0, -1.4), (1.2, -1.4), (0.3, 0.0), (-0.8, -2.6)):
        cl, sl, cp, sp = np.cos(longitude), np.sin(longitude), np.cos(latitude), np.sin(latitude)
        axes = np.array([[-sl, cl, 0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])
        seen.append(sun_direction(mjd, latitude, longitude) @ axes)
        at.append(radius * axes[2])
    distance = AU * np.linalg.norm(erfa.epv00(2_400_000.5, mjd)[0]["p"])
    for i in range(1, 4):
        base = at[i] - at[0]
        expected = -(base - (base @ seen[0]) * seen[0]) / distance
        assert np.linalg.norm(expected) > 3 * ARCSECOND
        # 0.7": diurnal aberration, 0.32" at each place at most.
        assert np.linalg.norm(seen[i] - seen[0] - expected) < 0.7 * ARCSECOND


def test_days_beyond_the_theory_are_refused():
    # erfa warns from 2100-01-01 on; warnings are errors here.
    assert np.linalg.norm(sun_direction(LATEST_MJD, 0.67, -1.39)) == pytest.approx(1.0)
    for late in (LATEST_MJD + 0.6, 88_119.58):
        with pytest.raises(ValidityError, match="mjd"):
            sun_direction(late, 0.67, -1.39)


def test_ut1_turns_the_sky_westward():
    early, late = (sun_direction(52_889.65, 0.67, -1.39, ut1_minus_utc=s) for s in (-0.5, 0.5))
    pole = np.array([0, np.cos(0.67), np.sin(0.67)])
    turn = np.cross(early, late) @ pole
    sine = np.linalg.norm(np.cross(pole, early)) ** 2
    assert turn / sine == pytest.approx(-15.04 * ARCSECOND, rel=1e-2)  # clockwise about the north pole, 15.04" a second


def test_the_sun_never_moves_faster_than_its_stated_rate():
    mjd = 52_889.0 + np.arange(0, 366, 0.01)[::7]
    track = sun_direction(mjd, 0.67, -1.39)
    rate = apart(track[1:], track[:-1]) / (np.diff(mjd) * 86400)
    assert np.max(rate) < SUN_RATE
    assert np.max(rate) > 0.98 * SUN_RATE


def test_refraction_is_that_of_the_almanacs():
    apparent = np.array([0.0, 1.0, 5.0, 10.0, 20.0, 45.0])
    # Bennett's formula, R of the apparent altitude, 1010 mb and 10 C, [MEEUS98] eq. 16.3: an independent fit.
    minutes = 1.0 / np.tan((apparent + 7.31 / (apparent + 4.4)) * DEGREE)
    raised = refracted(horizontal((apparent - minutes / 60) * DEGREE, np.ones(6)), 1010, 10)
    found = altitude_azimuth(raised)
    assert np.max(np.abs(found[0] / DEGREE - apparent)) < 0.1 / 60  # 0.1', what Meeus states of their agreement
    assert np.max(np.abs(found[1] - 1)) < 1e-12


def test_refraction_agrees_with_erfas_two_terms_high_up():
    import erfa

    a, b = erfa.refco(900.0, 5.0, 0.0, 0.55)
    altitude = np.linspace(20, 89, 50) * DEGREE
    up = altitude_azimuth(refracted(horizontal(altitude, np.zeros(50)), 900, 5))[0]
    tangent = np.tan(np.pi / 2 - up)
    assert np.max(np.abs(up - altitude - (a * tangent + b * tangent**3))) < 7 * ARCSECOND  # 4 %


def test_refraction_without_air_is_zero_and_the_zenith_is_fixed():
    d = horizontal(np.array([-1.5, -0.02, 0.5, np.pi / 2]), np.array([0.0, 2.0, 4.0, 0.0]))
    assert np.max(np.abs(refracted(d, 0, 10) - d)) < 1e-15
    assert refracted([0, 0, 1], 1010, 10).tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((2_452_889.5, 0.67, -1.39, 0), "mjd = 2452889.5 is outside 41317 to 88069"),
        ((41_316.9, 0.67, -1.39, 0), "mjd"),
        ((np.nan, 0.67, -1.39, 0), "mjd = nan"),
        ((52_889.0, 38.4, -1.39, 0), "latitude = 38.4 is outside"),
        ((52_889.0, 0.67, -79.84, 0), "longitude"),
        ((52_889.0, 0.67, -1.39, 807_000), "height"),
    ],
)
def test_a_wrong_unit_is_refused(arguments, said):
    with pytest.raises(ValidityError, match=said):
        sun_direction(*arguments)


def test_batches_broadcast():
    seen = sun_direction(np.array([[52_889.1], [52_889.6]]), np.array([0.1, 0.5, 0.9]), -1.39)
    assert seen.shape == (2, 3, 3)
    assert seen[1, 2] == pytest.approx(sun_direction(52_889.6, 0.9, -1.39), abs=1e-15)
