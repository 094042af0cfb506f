"""How the axes turn: against astropy, against the drives' limits, and rates against differences of angles."""

import warnings

import erfa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.simulator.twin.motion import FASTEST, AxisMotion, read_table

LATITUDE, MJD = 38.433121 * DEGREE, 60_000.1
SIDEREAL = 2 * np.pi * 1.00273781191135448 / 86_400.0  # rad of hour angle a second of UT1; IAU 2000


def angles(motion, seconds):
    motion = AxisMotion.parse(motion) if isinstance(motion, str) else motion
    return motion.angles(np.asarray(seconds, dtype=float), latitude=LATITUDE, start_mjd=MJD)


@given(
    azimuth=st.floats(0, 360),
    elevation=st.floats(8, 80),
    hours=st.floats(-1.0, 12.0),
)
def test_a_track_is_the_turn_of_the_hour_angle(azimuth, elevation, hours):
    hour, declination = erfa.ae2hd(azimuth * DEGREE, elevation * DEGREE, LATITUDE)
    if abs(declination - LATITUDE) < 0.02:
        return  # refused near the zenith
    a, e = erfa.hd2ae(hour + SIDEREAL * hours * 3600.0, declination, LATITUDE)
    found = angles(f"track {azimuth!r} {elevation!r}", [hours * 3600.0])
    if e > 5.0 * DEGREE:
        # one turn of trigonometry against another: rounding of 12 h of hour angle near the horizon
        assert found.elevation[0] == pytest.approx(e, abs=1e-12)
        assert np.cos(e) * np.sin(found.azimuth[0] - a) == pytest.approx(0.0, abs=1e-12)
        assert np.cos(found.azimuth[0] - a) > 0
    else:
        assert found.elevation[0] == pytest.approx(5.0 * DEGREE)
        assert found.elevation_rate[0] == 0.0


def test_a_track_is_astropys_sky_on_a_date():
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time
    from astropy.utils import iers

    with iers.conf.set_temp("auto_download", False), warnings.catch_warnings():
        place = EarthLocation.from_geodetic(-79.839835 * u.deg, 38.433121 * u.deg, 806 * u.m)
        start = Time(MJD, format="mjd", scale="utc")
        there = SkyCoord(alt=40 * u.deg, az=145 * u.deg, frame=AltAz(obstime=start, location=place)).icrs
        seconds = np.array([600.0, 3600.0, 7200.0])
        seen = there.transform_to(AltAz(obstime=start + seconds * u.s, location=place))
    found = angles("track 145 40", seconds)
    # what a turn about the pole leaves out: diurnal aberration, 0.25" = 1.2e-6 rad at most; polar motion, 1e-6
    assert np.abs(found.elevation - seen.alt.rad).max() < 2.5e-6
    assert np.abs((found.azimuth - seen.az.rad) * np.cos(found.elevation)).max() < 2.5e-6
    assert np.abs(found.elevation[0] - 40 * DEGREE) > 1e-2  # it moved


@pytest.mark.parametrize(
    "motion",
    ["track 145 40", "track 350 50", "track 100 85", "slew 10 30 40 50", "slew 40 50 39.9 5", "scan 10 30 2 20"],
)
def test_rates_are_the_angles_derivatives(motion):
    step = 1e-3
    t = np.linspace(0.0, 90.0, 9001) + 0.3137
    before, now, after = angles(motion, t - step), angles(motion, t), angles(motion, t + step)
    for axis in (0, 1):
        # 0.2 deg/s^2 of jump in acceleration inside a step of 1 ms: 0.25 * 3.5e-3 * 1e-3
        difference = (after[axis] - before[axis]) / (2 * step)
        assert np.abs(difference - now[axis + 2]).max() < 2e-6
        assert np.abs(now[axis + 2]).max() <= FASTEST[axis] * (1 + 1e-12)


def test_a_slew_keeps_to_the_drives_and_arrives():
    t = np.arange(0.0, 80.0, 0.01)
    a = angles("slew 10 30 40 50", t)
    assert (a.azimuth[0], a.elevation[0]) == pytest.approx((10 * DEGREE, 30 * DEGREE))
    assert (a.azimuth[-1], a.elevation[-1]) == pytest.approx((40 * DEGREE, 50 * DEGREE), abs=1e-12)
    assert a.azimuth_rate.max() == pytest.approx(35.2 / 60 * DEGREE)
    assert a.elevation_rate.max() == pytest.approx(17.6 / 60 * DEGREE)
    assert np.abs(np.diff(a.azimuth_rate)).max() <= 0.2 * DEGREE * 0.01 * (1 + 1e-9)
    # 30 degrees at 35.2 a minute, and one rise of 35.2 / 60 / 0.2 s
    moving = t[a.azimuth_rate > 0]
    assert moving[-1] == pytest.approx(30 / (35.2 / 60) + 35.2 / 60 / 0.2, abs=0.02)


def test_a_scan_goes_to_and_fro_at_its_rate():
    t = np.arange(0.0, 60.0, 0.01)
    a = angles("scan 10 30 2 20", t)
    inside = np.abs(a.azimuth / DEGREE - 10.0) < 0.999
    assert np.abs(a.azimuth_rate[inside]) == pytest.approx(20 / 60 * DEGREE)
    beyond = (20 / 60) ** 2 / (2 * 0.2)  # v^2 / 2a to stop
    assert (a.azimuth.max() / DEGREE, a.azimuth.min() / DEGREE) == pytest.approx((11 + beyond, 9 - beyond), abs=1e-4)
    assert np.all(a.elevation == 30 * DEGREE)
    assert a.azimuth[0] == pytest.approx(10 * DEGREE)


@settings(deadline=None)
@given(azimuth=st.floats(-180, 360), elevation=st.floats(8, 80))
def test_azimuth_counts_on_without_jumps_through_two_days(azimuth, elevation):
    try:
        a = angles(f"track {azimuth!r} {elevation!r}", np.arange(0.0, 172_800.0, 20.0))
    except InputError:
        return
    assert a.azimuth[0] == pytest.approx(azimuth * DEGREE, abs=1e-9)
    assert np.abs(np.diff(a.azimuth)).max() < 20 * FASTEST[0]
    assert np.abs(np.diff(a.azimuth) - 20 * a.azimuth_rate[1:]).max() < 0.06  # the rate is that of the angle
    assert a.elevation.min() > 4.999 * DEGREE


def test_a_table_passes_its_postures_and_stands_outside(tmp_path):
    file = tmp_path / "way.csv"
    file.write_text("mjd,azimuth_deg,elevation_deg\n60000.1,10,30\n60000.101,11,31\n60000.103,15,30\n", "utf-8")
    motion = AxisMotion.parse(f"table {file}")
    at = np.array([-50.0, 0.0, 86.4, 259.2, 900.0])
    a = angles(motion, at)
    assert a.azimuth / DEGREE == pytest.approx([10, 10, 11, 15, 15], abs=1e-6)  # an MJD is good to 0.6 us
    assert a.elevation / DEGREE == pytest.approx([30, 30, 31, 30, 30], abs=1e-6)
    assert a.azimuth_rate[[0, -1]].tolist() == [0.0, 0.0]
    ends = angles(motion, np.array([0.01, 259.19]))
    assert np.abs([*ends.azimuth_rate, *ends.elevation_rate]).max() < 1e-6  # it starts and stops without a jerk
    t = np.linspace(1.0, 258.0, 500)
    difference = (angles(motion, t + 1e-3).azimuth - angles(motion, t - 1e-3).azimuth) / 2e-3
    assert np.abs(difference - angles(motion, t).azimuth_rate).max() < 1e-8


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fixed 10", "expected fixed AZ EL"),
        ("orbit 10 20", "expected fixed AZ EL"),
        ("fixed ten 20", "expected fixed AZ EL"),
        ("fixed nan 20", "expected fixed AZ EL"),
        ("fixed 10 4.9", "elevation 4.9 is outside 5 to 95"),
        ("track 10 89.5", "elevation 89.5 is outside 5 to 89"),
        ("slew 10 30 20 96", "elevation 96 is outside"),
        ("scan 10 30 0 10", "both above 0"),
        ("scan 10 30 2 40", "0 to 35.2"),
        ("table /no/such/file.csv", "cannot be read"),
        ("", "expected fixed AZ EL"),
    ],
)
def test_invalid_motions_are_refused(text, said):
    with pytest.raises(InputError, match=said):
        AxisMotion.parse(text)


def test_a_track_through_the_zenith_is_refused():
    with pytest.raises(InputError, match="from the zenith"):
        angles(f"track {_through_the_zenith()!r} 60.0", [0.0])


def _through_the_zenith():
    """Azimuth at 60 degrees of elevation of an object whose declination is the latitude."""
    s = np.sin(LATITUDE)
    return float(np.degrees(np.arccos((s - s * np.sin(60 * DEGREE)) / (np.cos(LATITUDE) * np.cos(60 * DEGREE)))))


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("60000,1,30\n", "1 postures"),
        ("60000,1,30\n60000,2,30\n", "line 3: mjd 60000.0 is not after"),
        ("60000,1,30\n60001,2\n", "line 3: '60001,2' is not three"),
        ("60000,1,30\n60001,2,3\n", "line 3: elevation 3"),
        ("60000,1,30\n60001,900,30\n", "line 3: azimuth 900"),
    ],
)
def test_a_bad_table_is_refused_with_its_line(tmp_path, rows, said):
    file = tmp_path / "way.csv"
    file.write_text("mjd,azimuth_deg,elevation_deg\n" + rows, "utf-8")
    with pytest.raises(InputError, match=said):
        read_table(file)
    file.write_text("time,az,el\n" + rows, "utf-8")
    with pytest.raises(InputError, match="header"):
        read_table(file)
