import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.sky.sun import altitude_azimuth, sun_direction
from catseye.records.site.site import Location
from catseye.reduction.site.earth_rotation import FramePlace, RotationStatus, _directly, place_of, rotation_at, sun_at
from sun_scene import GREEN_BANK, MORNING, apart, astropy_sun

ARCSECOND = np.pi / 648_000


def test_astropys_interpolation_of_the_same_tables_agrees():
    from astropy.utils import iers

    with iers.conf.set_temp("auto_download", False):
        table = iers.IERS_A.open(iers.IERS_A_FILE)
        mjd = np.random.default_rng(1).uniform(41_690, 61_300, 2000)
        theirs = table.ut1_utc(2_400_000.5, mjd).to_value("s")
    assert np.max(np.abs(rotation_at(mjd).ut1_minus_utc - theirs)) < 1e-9


def test_before_the_newer_table_begins_the_older_one_counts():
    from astropy.utils import iers

    mjd = np.arange(41_318.0, 41_684.0)
    older = iers.IERS_B.open()
    theirs = np.interp(mjd, older["MJD"].value, older["UT1_UTC"].value)
    whole = np.abs(rotation_at(mjd).ut1_minus_utc - theirs)
    assert np.max(whole) < 1e-9


def test_the_bulletins_printed_values_are_met():
    # IERS bulletins: 1998-12-31 to 1999-01-01 over a leap second; 2003-09-07.
    before, after = rotation_at([51_178.0, 51_179.0]).ut1_minus_utc
    assert before == pytest.approx(-0.2823, abs=2e-3)
    assert after - before == pytest.approx(1.0, abs=2e-3)


def test_a_leap_second_makes_no_step_in_the_suns_path():
    mjd = 51_179.0 + np.array([-2, -1, 0, 1, 2]) / 86_400
    track = sun_at(mjd, GREEN_BANK).direction
    step = apart(track[1:], track[:-1])
    assert np.max(step) / np.min(step) < 1.01


def test_outside_the_tables_ut1_utc_is_zero_with_a_status():
    far = rotation_at([41_400.0, 75_000.0])
    assert far.ut1_minus_utc[1] == 0.0
    assert far.code.tolist() == [0, 2]
    assert far.status == RotationStatus.UNKNOWN
    assert "13.5" in str(far.status)
    assert rotation_at(41_400.0).status == RotationStatus.MEASURED


def test_the_worst_of_many_is_reported():
    assert sun_at([52_889.0, 80_000.0], GREEN_BANK).status == RotationStatus.UNKNOWN
    assert sun_at(52_889.0, GREEN_BANK).status == RotationStatus.MEASURED


def test_inside_the_tables_astropy_agrees_within_five_arc_seconds():
    mjd = np.linspace(41_700, 61_300, 50)
    assert np.max(apart(sun_at(mjd, GREEN_BANK).direction, astropy_sun(mjd))) < 1.2 * ARCSECOND  # 5" are asked for


def test_many_times_are_interpolated_within_two_milliseconds_of_arc():
    mjd = MORNING + np.random.default_rng(2).uniform(0, 1, 3000)
    exact = _directly(mjd, GREEN_BANK)
    assert np.max(np.abs(sun_at(mjd, GREEN_BANK).direction - exact)) < 1e-8  # the cubic's remainder, 5e-9
    grid = mjd.reshape(30, 100)
    assert sun_at(grid, GREEN_BANK).direction.shape == (30, 100, 3)


def test_scattered_times_are_not_interpolated():
    mjd = np.linspace(45_000, 60_000, 100)
    assert np.array_equal(sun_at(mjd, GREEN_BANK).direction, _directly(mjd, GREEN_BANK))


def test_a_site_record_and_its_air():
    site = Location(latitude_deg=38.433, longitude_deg=280.16, elevation_of_z0_m=807.0)
    bare = sun_at(MORNING, place_of(site, pressure_hpa=0.0)).direction
    assert bare == pytest.approx(sun_at(MORNING, GREEN_BANK).direction, abs=1e-12)
    standard = FramePlace(GREEN_BANK.latitude, GREEN_BANK.longitude, 807.0, 919.99)
    assert sun_at(MORNING, site).direction == pytest.approx(sun_at(MORNING, standard).direction, abs=1e-8)
    air = sun_at(MORNING, FramePlace(GREEN_BANK.latitude, GREEN_BANK.longitude, 807.0, 920.0, 20.0)).direction
    raised = altitude_azimuth(air)[0] - altitude_azimuth(bare)[0]
    # 58" cot(50.3 degrees) at 1010 hPa and 10 C, times 920/1010 * 283/293; formulas differ by 5 % there, 2".
    assert raised == pytest.approx(58.0 / np.tan(50.3 * np.pi / 180) * 0.8797 * ARCSECOND, rel=0.06)


def test_ut1_is_used_and_with_its_sign():
    seen = sun_at(52_892.0, GREEN_BANK).direction
    place = (GREEN_BANK.latitude, GREEN_BANK.longitude, GREEN_BANK.height)
    assert apart(seen, sun_direction(52_892.0, *place, ut1_minus_utc=-0.3518)) < 0.01 * ARCSECOND
    assert apart(seen, sun_direction(52_892.0, *place)) > 4 * ARCSECOND


def test_no_number_is_refused():
    with pytest.raises(ValidityError, match="mjd"):
        rotation_at([52_889.0, np.nan])
