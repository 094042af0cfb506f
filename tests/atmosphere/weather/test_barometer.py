"""Barometer, gravity and pressure at other elevations against other people's numbers and in high precision."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp

from catseye.atmosphere.path import mean as path
from catseye.atmosphere.weather import barometer
from catseye.atmosphere.weather.barometer import GRAVITY_STATIONS, carried_pressure
from catseye.errors import ValidityError

LATITUDE = np.radians(38.45)  # [PARKER04] section 1.4.2

# boule 0.6.0 (PyPI), Ellipsoid GRS80, closed formula for any height: latitude °, height m, gravity m/s²
EXACT_GRS80 = [
    (0.0, 0.0, 9.78032677153605), (45.0, 0.0, 9.806199202522187), (90.0, 0.0, 9.832186368517242),
    (38.45, 0.0, 9.80032516035036), (38.45, 797.3, 9.797865075896384), (38.45, 820.8264, 9.797792498746974),
    (-30.7, 1000.0, 9.790714095436202), (60.0, 4000.0, 9.80685199642921), (20.0, 5000.0, 9.770951254418085),
]  # fmt: skip


@pytest.mark.parametrize(("latitude_deg", "height", "expected"), EXACT_GRS80)
def test_grs80_gravity_is_the_exact_ellipsoids(latitude_deg, height, expected):
    got = barometer.normal_gravity(np.radians(latitude_deg), height, formula="grs80")
    # the lift leaves out what is of second order in flattening and rotation, f² and f m, 3e-5 of itself in all
    assert float(got) == pytest.approx(expected, abs=1e-9 + 3e-5 * 3.086e-6 * height)


def test_grs80_gravity_is_the_printed_one_at_equator_and_pole():
    for degrees, printed in ((0.0, 9.780_326_771_5), (90.0, 9.832_186_368_5), (-90.0, 9.832_186_368_5)):  # [MORITZ80]
        assert float(barometer.normal_gravity(np.radians(degrees), 0.0, formula="grs80")) == pytest.approx(
            printed, abs=1e-10
        )


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(0.0, 5000.0))
def test_the_smithsonian_formula_lies_within_11_milligal_of_todays(latitude, elevation):
    notes, today = (barometer.normal_gravity(latitude, elevation, formula=f) for f in ("smithsonian", "grs80"))
    assert abs(float(notes - today)) < 1.1e-4


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(0.0, 5000.0))
def test_gravity_falls_with_height_as_in_free_air(latitude, elevation):
    for formula in barometer.GRAVITY_FORMULAS:
        low, high = (barometer.normal_gravity(latitude, elevation + s, formula=formula) for s in (-50.0, 50.0))
        # the second order takes 1.5e-12/s² a metre off
        assert float(high - low) / 100.0 == pytest.approx(barometer.FREE_AIR, abs=2e-8)


@pytest.mark.parametrize(
    ("name", "smithsonian", "grs80"),
    [("Green Bank AA", 12.10e-5, 9.72e-5), ("Green Bank B", 13.01e-5, 10.64e-5), ("Green Bank AB", 15.27e-5, 12.89e-5)],
)
def test_each_stations_distance_from_each_formula_is_as_stated_and_todays_is_nearer(name, smithsonian, grs80):
    """Checked against ourselves: the numbers in the comment beside the stations."""
    station = GRAVITY_STATIONS[name]
    off = {formula: float(station.anomaly(LATITUDE, formula=formula)) for formula in barometer.GRAVITY_FORMULAS}
    assert off == pytest.approx({"smithsonian": smithsonian, "grs80": grs80}, abs=1e-7)
    assert off["grs80"] < off["smithsonian"] < barometer.U_NORMAL_GRAVITY
    north = float(station.anomaly(LATITUDE - np.radians(1 / 60)) - station.anomaly(LATITUDE))
    assert north == pytest.approx(1.48e-5, abs=2e-7)  # a minute of arc south: the formula falls, the anomaly grows


def test_between_the_stations_gravity_falls_as_on_a_hillside_and_not_as_in_free_air():
    stations = list(GRAVITY_STATIONS.values())
    gradient = np.polyfit([s.elevation for s in stations], [s.gravity for s in stations], 1)[0]
    assert gradient == pytest.approx(-1.62e-6, abs=3e-8)
    hillside = barometer.FREE_AIR + barometer.BOUGUER_PLATE
    assert abs(gradient - hillside) < 0.25 * abs(gradient - barometer.FREE_AIR)


def test_the_stations_are_the_printed_ones():
    printed = {
        "Green Bank AA": (979.795_654, 2622),
        "Green Bank B": (979.794_688, 2642),
        "Green Bank AB": (979.792_146, 2693),
    }
    assert {s.name: (s.gravity_gal, s.elevation_ft) for s in GRAVITY_STATIONS.values()} == printed
    assert GRAVITY_STATIONS["Green Bank AA"].u_gal == 5e-6
    assert GRAVITY_STATIONS["Green Bank AA"].elevation == pytest.approx(799.1856)
    assert GRAVITY_STATIONS["Green Bank B"].u_gal is None


def test_a_measured_station_is_carried_down_to_the_laboratory():
    station = GRAVITY_STATIONS["Green Bank AA"]
    g = station.gravity_at(797.3)
    assert float(g - station.gravity) == pytest.approx(3.086e-6 * (2622 * 0.3048 - 797.3), rel=1e-9)
    # 12 mgal of gravity are 0.0115 hPa
    by_formula, measured = (
        barometer.station_pressure_hpa(700.0, 20.0, x) for x in (barometer.normal_gravity(LATITUDE, 797.3), g)
    )
    assert float(measured - by_formula) == pytest.approx(929.38 * 12.1e-5 / 9.8, abs=2e-4)
    with pytest.raises(ValidityError, match="elevation 900 m is outside 749-849 m"):
        station.gravity_at(900.0)


def test_a_warm_barometer_reads_too_much():
    cold, warm = barometer.temperature_corrected_mmhg(700.0, np.array([0.0, 20.0]))
    assert float(cold) == 700.0
    assert float(700.0 - warm) == pytest.approx(2.28, abs=0.005)  # barometer tables: 700 mm at 20 °C, take off 2.28


def test_the_straight_expansion_of_mercury_is_within_its_stated_uncertainty():
    t = np.linspace(0.0, 40.0, 41)
    # Beattie and others 1941: volume of mercury, coefficients of t, t², t³, as in handbooks
    volume = 1.0 + 1.8144e-4 * t + 7.016e-9 * t**2 + 2.8625e-11 * t**3
    off = volume / (1.0 + barometer.MERCURY_PER_C * t) - 1.0
    assert np.all(np.abs(off) < barometer.U_MERCURY_EXPANSION)


def test_station_pressures_uncertainty_is_the_scatter_of_a_monte_carlo():
    rng, n = np.random.default_rng(4), 20_000
    u = {"u_reading_mmhg": 0.05, "u_mercury_c": 0.5, "u_gravity": 3e-4}
    draws = (mean + sigma * rng.normal(size=n) for mean, sigma in zip((700.0, 20.0, 9.79784), u.values(), strict=True))
    scatter = barometer.station_pressure_hpa(*draws).std()
    claimed = barometer.station_pressure_uncertainty_hpa(700.0, 20.0, 9.79784, **u)
    # 20 000 draws know a standard deviation to 0.5 %; mercury's own 1e-5 is not drawn
    assert scatter == pytest.approx(np.sqrt(float(claimed) ** 2 - (1e-5 * 929.38) ** 2), rel=0.02)


# ICAO Doc 7488: geopotential altitude m, pressure hPa
ICAO = [(-500.0, 1074.78), (500.0, 954.608), (1000.0, 898.746), (2000.0, 794.952), (3000.0, 701.085), (5000.0, 540.199)]


@pytest.mark.parametrize(("altitude", "expected"), ICAO)
def test_the_standard_atmosphere_is_its_printed_table(altitude, expected):
    got = float(carried_pressure(1013.25, 15.0, 0.0, z_to=altitude).pressure_hpa)
    # ICAO's molar mass and gas constant differ from today's: 1.1e-5 and 1.7e-5 of the exponent, in the same direction
    constants = 3.2e-5 * abs(np.log(expected / 1013.25)) * expected
    assert got == pytest.approx(
        expected, abs=constants + (5e-3 if altitude < 0 else 6e-4)
    )  # and the last printed digit


def exact_pressure(p, t, lapse, e, g, rise):
    """dp/dz = -rho g integrated in high precision with a mixing ratio that stays."""
    kelvin, light = t + mp.mpf("273.15"), 1 - mp.mpf("0.62198")
    weight = g * mp.mpf("28.9641e-3") / mp.mpf("8.314462618") * (1 - light * e / p)
    return p * mp.exp(-weight * mp.quad(lambda z: 1 / (kelvin - lapse * z), [0, rise]))


@pytest.mark.parametrize("lapse", [0.0065, 1e-9, 0.0, -0.02, 0.0098])
@pytest.mark.parametrize("rise", [148.0, -60.0, 1500.0, 0.0])
def test_pressure_and_all_its_slopes_are_those_of_the_integral_in_high_precision(lapse, rise):
    point = (933.0, 20.0, lapse, 11.7, 9.798, rise)
    got = carried_pressure(
        933.0, 20.0, 800.0, z_to=800.0 + rise, lapse_c_per_m=lapse, vapour_pressure_hpa=11.7, gravity=9.798
    )
    with mp.workdps(30):
        at = [mp.mpf(x) for x in point]
        of = lambda p, t, lapse, e, g, rise: exact_pressure(p, t, lapse, e, g, rise)  # noqa: E731
        slopes = [mp.diff(of, at, tuple(int(i == k) for i in range(6))) for k in range(6)]
        assert float(got.pressure_hpa) == pytest.approx(float(exact_pressure(*at)), rel=1e-13)
    np.testing.assert_allclose([float(s) for s in got[1:7]], [float(s) for s in slopes], rtol=1e-9, atol=1e-12)


def test_without_a_lapse_it_is_the_hydrostatic_pressure_of_the_path():
    for rise in (-50.0, 148.0):
        flat = carried_pressure(933.0, 20.0, 0.0, z_to=rise, lapse_c_per_m=0.0, vapour_pressure_hpa=11.7).pressure_hpa
        other = path.hydrostatic_pressure_hpa(933.0, 20.0, 0.0, z_to=rise, vapour_pressure_hpa=11.7)
        assert float(flat) == pytest.approx(float(other), rel=1e-14)


def test_the_notes_lapse_to_the_highest_point_is_0_2_hpa_too_steep():
    constant = path.pressure_at(933.0, 0.0, 148.0)
    assert float(933.0 - constant) == pytest.approx(16.28, abs=1e-9)
    assert float(carried_pressure(933.0, 20.0, 0.0, z_to=148.0).pressure_hpa - constant) == pytest.approx(
        0.34, abs=0.05
    )


def test_carried_pressures_uncertainty_is_the_scatter_of_a_monte_carlo():
    rng, n = np.random.default_rng(6), 20_000
    u = {"u_temperature_c": 2.0, "u_lapse": 0.01, "u_vapour": 2.0, "u_gravity": 1e-3, "u_rise": 1.0}
    p, t, lapse, e, g, rise = (
        mean + sigma * rng.normal(size=n)
        for mean, sigma in zip((933.0, 20.0, 0.0065, 11.7, 9.798, 148.0), (0.1, *u.values()), strict=True)
    )
    scatter = carried_pressure(
        p, t, 0.0, z_to=rise, lapse_c_per_m=lapse, vapour_pressure_hpa=e, gravity=g
    ).pressure_hpa.std()
    middle = carried_pressure(933.0, 20.0, 0.0, z_to=148.0, vapour_pressure_hpa=11.7, gravity=9.798)
    claimed = float(middle._replace(u_formula_hpa=0.0).standard_uncertainty_hpa(0.1, **u))
    assert scatter == pytest.approx(claimed, rel=0.02)  # 20 000 draws know a standard deviation to 0.5 %
    assert float(middle.u_formula_hpa) == pytest.approx(4e-4 * 16.0, rel=0.05)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: barometer.station_pressure_hpa(700.0, 20.0, 979.784), "gravity 979.784 m/s² is outside 9.7-9.9"),
        (lambda: barometer.station_pressure_hpa(929.0, 20.0, 9.798), "barometer reading 929 mm Hg"),
        (lambda: barometer.station_pressure_hpa(700.0, np.nan, 9.798), "mercury temperature is not a number"),
        (lambda: barometer.normal_gravity(38.45, 797.3), "latitude 38.45 rad is outside"),
        (lambda: barometer.normal_gravity(0.6, 79730.0), "elevation 79730 m"),
        (lambda: barometer.normal_gravity(0.6, 0.0, formula="wgs72"), "choose one of smithsonian, grs80"),
        (lambda: carried_pressure(93300.0, 20.0, 0.0, z_to=1.0), "pressure 93300 hPa"),
        (lambda: carried_pressure(933.0, -300.0, 0.0, z_to=1.0), "temperature -300 °C"),
        (lambda: carried_pressure(933.0, 20.0, 0.0, z_to=1e5), "difference of elevation 100000 m"),
        (lambda: carried_pressure(933.0, 20.0, 0.0, z_to=1000.0, lapse_c_per_m=6.5), "absolute temperature at the top"),
        (lambda: carried_pressure(933.0, 20.0, 0.0, z_to=1.0, vapour_pressure_hpa=1000.0), "vapour's share"),
    ],
)
def test_values_out_of_range_are_refused_with_name_value_and_limit(call, text):
    with pytest.raises(ValidityError, match=text):
        call()
