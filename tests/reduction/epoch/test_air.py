"""The air of a campaign: states in time, profile in height, derivatives."""

import dataclasses

import numpy as np
import pytest

from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.night.path_temperature import PathTemperature, path_temperature_columns
from catseye.records.night.weather import Weather
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.settings import ReductionSettings

Z0 = 806.42  # m above sea level, night-01's


def weathered(campaign, heights, seconds, temperature, pressure=900.0, humidity=50.0):
    """The campaign with stations at heights (ground frame, m) and functions of time (s) and station as readings."""
    start = float(campaign.shots.mjd_utc[0])
    names = [f"S{i}" for i in range(len(heights))]
    rows = [(s, i) for s in seconds for i in range(len(heights))]
    station = campaign.site.weather_station[0]
    site = campaign.site.model_copy(
        update={
            "weather_station": tuple(
                station.model_copy(update={"name": n, "elevation_m": h + Z0})
                for n, h in zip(names, heights, strict=True)
            )
        }
    )
    weather = Weather(
        mjd_utc=np.array([start + s / SECONDS_PER_DAY for s, _ in rows]),
        station=tuple(names[i] for _, i in rows),
        temperature_c=np.array([temperature(s, i) for s, i in rows]),
        pressure_hpa=np.full(len(rows), pressure),
        humidity_percent=np.full(len(rows), humidity),
    )
    return dataclasses.replace(campaign, site=site, weather=weather), start


def at(start, *seconds):
    return start + np.array(seconds) / SECONDS_PER_DAY


def test_a_line_in_time_is_left_a_line_right_up_to_its_ends(night_01):
    campaign, start = weathered(night_01, [0.0, 40.0], np.arange(0.0, 3601.0, 30.0), lambda s, i: 10 + i - s / 1800)
    times = (0.0, 1.0, 77.0, 1800.0, 3599.0, 3600.0)
    smooth = AirField.of(campaign, ReductionSettings()).smoothed(at(start, *times))
    expected = np.array([[10 - s / 1800, 11 - s / 1800] for s in times])
    # 1e-6 °C: the Modified Julian Day resolves a microsecond
    np.testing.assert_allclose(smooth[:, :, 0], expected, atol=1e-6)


def test_ordinary_readings_are_not_blamed_for_air_that_the_ranges_ask_for(night_01):
    """A profile that bends by 60 °C beside stations alike, and readings that are 60 °C apart."""
    times = np.array([0.0, 3600.0])
    for readings, bend, said in (((20.0, 21.0), 60.0, "ordinary air"), ((-20.0, 40.0), 0.0, "check these readings")):
        campaign, start = weathered(night_01, [0.0, 40.0], times, lambda _, i, read=readings: read[i])
        field = AirField.of(campaign, ReductionSettings())
        low, high = np.array([[0.0, 0.0, -40.0]]), np.array([[100.0, 0.0, 120.0]])
        with pytest.raises(InputError, match=said):
            field.along(at(start, 1800.0), low, high, np.array([0.0, 0.0, bend]))


def test_readings_that_no_index_formula_covers_are_refused_with_their_stations(night_01):
    """55 °F typed as °C: dry enough to be air of a desert, and beyond the formula."""
    campaign, _ = weathered(night_01, [0.0, 40.0], np.array([0.0, 3600.0]), lambda _, i: 55.3)
    with pytest.raises(
        InputError, match=r"S0 55\.3 °C \(12\.9 °C if these are degrees Fahrenheit\).*outside -40 to 50"
    ):
        AirField.of(campaign, ReductionSettings())


@pytest.mark.parametrize("wander", [0.0, 0.3])
def test_noise_of_readings_falls_to_the_records_claim(night_01, wander):
    """Of air that stands still far below a reading's 0.05 °C, of air that wanders by 0.3 °C a root hour by a half."""
    rng = np.random.default_rng(5)
    seconds = np.arange(0.0, 36001.0, 30.0)
    walk = 10.0 + np.cumsum(wander * np.sqrt(30.0 / 3600.0) * rng.standard_normal((len(seconds), 2)), axis=0)
    read = walk + 0.05 * rng.standard_normal(walk.shape)
    campaign, start = weathered(night_01, [0.0, 40.0], seconds, lambda s, i: read[int(s) // 30, i])
    field = AirField.of(campaign, ReductionSettings())
    error = field.smoothed(at(start, *seconds))[:, :, 0] - walk
    claimed = np.array([np.diag(r.temperature_c.covariance(seconds)) for r in field.records]).T
    # errors hang together over an hour of still air, and over five minutes of air that wanders: 20 and 240 of them
    assert np.sqrt(np.mean(error**2) / np.mean(claimed)) == pytest.approx(1.0, abs=0.12 if wander else 0.5)
    assert np.sqrt(np.mean(claimed)) < (0.6 if wander else 0.1) * 0.05


def test_beyond_the_samples_the_air_stays_as_it_was_last_without_a_jump(night_01):
    campaign, start = weathered(night_01, [0.0, 40.0], np.arange(0.0, 1801.0, 30.0), lambda s, i: 10 - s / 600)
    smooth = AirField.of(campaign, ReductionSettings()).smoothed(at(start, -3600, -0.01, 0.01, 1799.99, 1800.01, 1e5))[
        :, 0, 0
    ]
    np.testing.assert_allclose(smooth, [10, 10, 10, 7, 7, 7], atol=1e-3)


def test_in_a_gap_of_hours_the_nearest_samples_still_count(night_01):
    seconds = [0.0, 30.0, 60.0, 20000.0, 20030.0]
    campaign, start = weathered(night_01, [0.0, 40.0], seconds, lambda s, i: 10 + s / 10000)
    smooth = AirField.of(campaign, ReductionSettings()).smoothed(at(start, 10000.0))[0, 0, 0]
    assert smooth == pytest.approx(11.0, abs=1e-6)


def test_a_single_sample_holds_for_ever(night_01):
    campaign, start = weathered(night_01, [0.0, 40.0], [100.0], lambda s, i: 7.0 + i)
    smooth = AirField.of(campaign, ReductionSettings()).smoothed(at(start, -5e4, 100.0, 5e4))
    np.testing.assert_array_equal(smooth[:, :, 0], [[7.0, 8.0]] * 3)


def paths(m=6):
    rng = np.random.default_rng(3)
    a, b = rng.uniform(-100, 100, (2, m, 3))
    a[:, 2], b[:, 2] = rng.uniform(0, 2, m), rng.uniform(0, 110, m)
    return a, b


@pytest.mark.parametrize("heights", [(-2.6, 43.7), (-2.6, 20.0, 43.7), (10.0,), (10.0, 12.0)])
def test_slopes_are_the_derivatives_of_the_refractivity(night_01, heights):
    campaign, start = weathered(night_01, heights, np.arange(0.0, 3601.0, 30.0), lambda s, i: 10 + 0.4 * i - s / 3600)
    field = AirField.of(campaign, ReductionSettings())
    a, b = paths()
    when = at(start, *np.linspace(100, 3000, len(a)))
    base = np.array([*[0.2, -0.1, 0.15][: len(heights)], 0.002])
    found = field.along(when, a, b, base)
    assert found.slopes.shape == (len(a), len(field.names))
    for q in range(len(base)):
        step = np.zeros(len(base))
        step[q] = 1e-3
        up, down = (field.along(when, a, b, base + sign * step).refractivity for sign in (1, -1))
        # 1e-3: the slope is a difference over a whole degree, the curvature of n(T) enters in its third order
        np.testing.assert_allclose(found.slopes[:, q], (up - down) / 2e-3, rtol=1e-3, atol=1e-12)


def test_two_stations_make_a_straight_profile_and_pressure_falls_by_0_11_hpa_a_metre(night_01):
    campaign, start = weathered(night_01, [0.0, 40.0], np.arange(0.0, 3601.0, 30.0), lambda s, i: 10 + 2.0 * i)
    field = AirField.of(campaign, ReductionSettings())
    # a path of no slope: the value at its height; both stations read 900 hPa, so 900 holds half-way
    for z in (-5.0, 0.0, 20.0, 40.0, 100.0):
        end = np.array([[50.0, 0.0, z]])
        found = field.along(at(start, 1800.0), end - [[50, 0, 0]], end, np.zeros(3)).refractivity[0]
        expected = group_refractivity(
            10 + z / 20, 900.0 - 0.11 * (z - 20), 50.0, wavelength_um=0.78, model="rueger1990"
        )
        assert found == pytest.approx(float(expected), abs=1e-11)


def test_three_stations_are_levelled_by_their_line(night_01):
    line = [5.0, 5.5, 6.5]
    campaign, start = weathered(night_01, [0.0, 10.0, 30.0], [0.0, 3600.0], lambda s, i: line[i])
    field = AirField.of(campaign, ReductionSettings())
    two, start = weathered(night_01, [0.0, 30.0], [0.0, 3600.0], lambda s, i: (5.0, 6.5)[i])
    a, b = paths()
    when = at(start, *[100.0] * len(a))
    b[:, 2] = a[:, 2]  # level paths: pressure is referred to the stations' mean height, the same after a shift
    shift = 0.11 * (15.0 - 40.0 / 3.0)
    exact = group_refractivity(
        5.0 + a[:, 2] / 20, 900.0 - 0.11 * (a[:, 2] - 15.0) - shift, 50.0, wavelength_um=0.78,
        model="rueger1990",
    )  # fmt: skip
    np.testing.assert_allclose(field.along(when, a, b, np.zeros(4)).refractivity, exact, atol=1e-11)
    assert field.names == ("S0", "S1", "S2", "bend")
    assert field.steepest(np.zeros(3)) == pytest.approx(0.05, abs=1e-12)
    assert AirField.of(two, ReductionSettings()).names == ("S0", "S1", "bend")


@pytest.mark.parametrize("heights", [(5.0,), (5.0, 5.0), (5.0, 9.9)])
def test_stations_at_one_height_show_no_gradient_so_it_is_a_parameter(night_01, heights):
    campaign, start = weathered(night_01, heights, [0.0, 3600.0], lambda s, i: 10.0 + i)
    field = AirField.of(campaign, ReductionSettings())
    assert field.names[-1] == "gradient"
    assert field.sigmas[-1] == ReductionSettings().u_gradient_c_per_m
    assert field.steepest(np.zeros(len(heights))) == 0.0
    a, b = paths(1)
    b[:, 2] = a[:, 2] = 45.0
    flat = np.zeros(len(field.names))
    warm = flat.copy()
    warm[-1] = 0.01
    change = field.along(at(start, 0.0), a, b, warm).refractivity - field.along(at(start, 0.0), a, b, flat).refractivity
    # 0.4 °C warmer 40 m higher, 0.9 ppm per °C at 10 °C and 900 hPa
    assert change[0] == pytest.approx(-0.9e-6 * 0.01 * (45.0 - np.mean(heights)), rel=0.05)


def test_a_path_has_one_air_from_either_end(night_01):
    field = AirField.of(night_01, ReductionSettings())
    a, b = paths()
    when = np.full(len(a), night_01.shots.mjd_utc[50])
    there, back = field.along(when, a, b, np.zeros(3)), field.along(when, b, a, np.zeros(3))
    np.testing.assert_allclose(there.refractivity, back.refractivity, rtol=1e-14)
    np.testing.assert_allclose(there.slopes, back.slopes, rtol=1e-12, atol=1e-20)


def test_a_bend_of_one_degree_is_one_degree_half_way_and_zero_at_the_stations(night_01):
    campaign, start = weathered(night_01, [0.0, 50.0], [0.0, 60.0], lambda s, i: 10.0 + 2.0 * i)
    field = AirField.of(campaign, ReductionSettings(air_model="rueger1990"))
    level = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 25.0], [0.0, 0.0, 50.0]])
    far = level + np.array([100.0, 0.0, 0.0])
    bent = field.along(at(start, 30.0, 30.0, 30.0), level, far, np.array([0.0, 0.0, 1.0]))
    warmth, pressure = np.array([10.0, 12.0, 12.0]), 900.0 - 0.11 * (level[:, 2] - 25.0)  # half-way 11 on the line
    expected = group_refractivity(warmth, pressure, 50.0, wavelength_um=0.78, model="rueger1990")
    np.testing.assert_allclose(bent.refractivity, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("humidity", "expected"), [(100.0, 100.0), (0.0, 0.0)])
def test_fog_and_dry_air_are_humidities_too(night_01, humidity, expected):
    """Weights sum to one only to rounding: 100.00000000000001 % was refused, and with it the whole night."""
    campaign, start = weathered(
        night_01, [0.0, 40.0], np.arange(0.0, 3601.0, 37.0), lambda s, i: 10.0, humidity=humidity
    )
    field = AirField.of(campaign, ReductionSettings())
    times = at(start, *np.linspace(0.0, 3600.0, 500))
    assert np.all(np.abs(field.smoothed(times)[:, :, 2] - expected) < 1e-9)
    ends = np.zeros((500, 3)), np.tile([50.0, 0.0, 30.0], (500, 1))
    assert np.all(np.isfinite(field.along(times, *ends, np.zeros(3)).refractivity))


def lined(campaign, rows):
    """Its field, with path temperatures (mjd, ranger, target, °C, u), and the field of shots ZY101 - T, ZY102 - T."""
    keys = ("mjd_utc", "ranger", "target", "temperature_c", "u_temperature_c")
    table = path_temperature_columns([PathTemperature(**dict(zip(keys, row, strict=True))) for row in rows])
    return AirField.of(dataclasses.replace(campaign, path_temperatures=table), ReductionSettings())


ENDS = [frozenset(("ZY101", "T")), frozenset(("ZY102", "T"))]


def test_sound_replaces_the_thermometers_on_its_line_but_not_the_vapour(night_01):
    campaign, start = weathered(night_01, [0.0, 50.0], [0.0, 3600.0], lambda s, i: 10.0 + i)
    field = lined(campaign, [(start + 0.01, "T", "ZY101", 16.0, 0.2)])  # a line is the same from either end
    times = at(start, 864.0, 864.0)
    level = np.zeros((2, 3))
    far = level + np.array([100.0, 0.0, 0.0])
    found = field.on_lines(times, ENDS).along(times, level, far, np.zeros(4))
    plain = field.along(times, level, far, np.zeros(4))
    assert found.refractivity[1] == plain.refractivity[1]
    pressure = 900.0 + 0.11 * 25.0
    vapour = float(vapour_pressure_hpa(10.0, pressure, 50.0))
    expected = MODELS["rueger1990"].refractivity(16.0, pressure, vapour, wavelength_um=0.78, co2_ppm=300.0)
    assert found.refractivity[0] == pytest.approx(float(expected), abs=1e-13)
    assert found.refractivity[0] < plain.refractivity[0] - 5e-6  # 6 °C warmer
    assert field.names == ("S0", "S1", "bend", "T - ZY101")
    assert field.stations == ("S0", "S1")
    assert field.sigmas[-1] == pytest.approx(0.2)


def test_sound_counts_near_in_time_only_and_is_a_line_between_its_rows(night_01):
    campaign, start = weathered(night_01, [0.0, 50.0], [0.0, 9000.0], lambda s, i: 10.0)
    rows = [(start + s / SECONDS_PER_DAY, "ZY101", "T", t, 0.2) for s, t in ((2000.0, 12.0), (2400.0, 14.0))]
    field = lined(campaign, rows)
    times = at(start, 1300.0, 1500.0, 2100.0, 2900.0, 3100.0)
    bound = field.on_lines(times, [ENDS[0]] * 5)
    assert bound.sounded.tolist() == [-1, 0, 0, 0, -1]
    np.testing.assert_allclose(field.lines[0].at(times)[0][1:4], [12.0, 12.5, 14.0], atol=1e-4)


def test_slopes_of_a_sounded_line_are_derivatives_scaled_by_each_rows_u(night_01):
    campaign, start = weathered(night_01, [0.0, 50.0], [0.0, 9000.0], lambda s, i: 10.0 + i)
    rows = [(start + s / SECONDS_PER_DAY, "ZY101", "T", 13.0, u) for s, u in ((1000.0, 0.1), (3000.0, 0.3))]
    times = at(start, 1000.0, 3000.0)
    field = lined(campaign, rows).on_lines(times, [ENDS[0]] * 2)
    a, b = paths(2)
    base = np.array([0.2, -0.1, 0.05, 0.1])
    found = field.along(times, a, b, base)
    for q in range(4):
        step = np.zeros(4)
        step[q] = 1e-2
        up, down = (field.along(times, a, b, base + sign * step).refractivity for sign in (1, -1))
        # 2e-3: of the vapour's curve over a degree, as above
        np.testing.assert_allclose(found.slopes[:, q], (up - down) / 2e-2, rtol=2e-3, atol=1e-13)
    assert np.all(found.slopes[:, 3] > 0.0)  # sound that reads too warm hides a higher index
    assert found.slopes[1, 3] / found.slopes[0, 3] == pytest.approx(3.0, rel=0.02)
    assert field.sigmas[3] == pytest.approx(np.sqrt((0.01 + 0.09) / 2))


def trended(campaign, until=(3600.0, 3600.0)):
    """Two stations, 5 °C apart, that fall by 2 °C, rise by 3 hPa and moisten by 20 % in an hour.

    until   s of each station's last reading; the first is at 0 s, one every 30 s
    """
    campaign, start = weathered(
        campaign, [0.0, 40.0], np.arange(0.0, 3601.0, 30.0), lambda s, i: 10.0 + 5.0 * i - 2.0 * s / 3600.0
    )
    weather = campaign.weather
    seconds = (weather.mjd_utc - start) * SECONDS_PER_DAY
    last = np.array([until[int(name[1:])] for name in weather.station])
    kept = seconds < last + 1.0
    columns = {
        "mjd_utc": weather.mjd_utc[kept],
        "station": tuple(name for name, keep in zip(weather.station, kept, strict=True) if keep),
        "temperature_c": weather.temperature_c[kept],
        "pressure_hpa": (900.0 + 3.0 * seconds / 3600.0)[kept],
        "humidity_percent": (50.0 + 20.0 * seconds / 3600.0)[kept],
    }
    return dataclasses.replace(campaign, weather=Weather(**columns)), start


FIRST = [[10.0, 900.0, 50.0], [15.0, 900.0, 50.0]]  # °C, hPa, % of the stations at 0 s
LAST = [[8.0, 903.0, 70.0], [13.0, 903.0, 70.0]]  # at 3600 s, by hand


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [(0.0, FIRST), (-1.0, FIRST), (-3600.0, FIRST), (3600.0, LAST), (3601.0, LAST), (7200.0, LAST)],
)
def test_before_the_first_reading_and_after_the_last_the_air_is_that_of_the_reading(night_01, seconds, expected):
    """No jump at the ends, and no trend carried on: an hour later a line would say 6 °C, 906 hPa, 90 %."""
    campaign, start = trended(night_01)
    found = AirField.of(campaign, ReductionSettings()).smoothed(at(start, seconds))[0]
    # 1e-6: the Modified Julian Day resolves a microsecond
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_a_station_that_falls_silent_keeps_its_last_reading_while_the_other_goes_on(night_01):
    campaign, start = trended(night_01, until=(3600.0, 1800.0))
    found = AirField.of(campaign, ReductionSettings()).smoothed(at(start, 1800.0, 2700.0, 3600.0, 5400.0))
    np.testing.assert_allclose(found[:, 0, 0], [9.0, 8.5, 8.0, 8.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found[:, 1], [[14.0, 901.5, 60.0]] * 4, rtol=0, atol=1e-6)


def test_a_station_with_one_reading_is_constant_in_time(night_01):
    campaign, start = trended(night_01, until=(3600.0, 0.0))
    found = AirField.of(campaign, ReductionSettings()).smoothed(at(start, -1800.0, 0.0, 1800.0, 5400.0))
    np.testing.assert_allclose(found[:, 1], [FIRST[1]] * 4, rtol=0, atol=1e-6)


def test_a_shot_after_the_last_reading_is_ranged_in_the_last_air_and_one_before_the_first_in_the_first(night_01):
    """By hand: n_g - 1 of 258 ppm falls by 1/281 of it a degree, 0.92 ppm, and rises by 1/905 a hectopascal, 0.285 ppm.

    Colder by 2 °C and denser by 3 hPa the air is later, so the index is the larger; vapour changes it by 0.1 ppm.
    """
    campaign, start = trended(night_01)
    field = AirField.of(campaign, ReductionSettings())
    foot = np.array([[0.0, 0.0, 0.0]])
    far = np.array([[100.0, 0.0, 0.0]])
    index = {}
    for seconds in (-1800.0, 0.0, 3600.0, 5400.0):
        path = field.along(at(start, seconds), foot, far, np.zeros(3))
        index[seconds] = float(path.refractivity[0])
    assert index[-1800.0] == pytest.approx(index[0.0], abs=1e-12)
    assert index[5400.0] == pytest.approx(index[3600.0], abs=1e-12)
    # level at the lower station, 20 m below the mean height: 8 °C, 903 + 20 x 0.11 hPa, 70 %
    expected = group_refractivity(8.0, 905.2, 70.0, wavelength_um=0.78, model="rueger1990")
    assert index[5400.0] == pytest.approx(float(expected), abs=1e-11)
    assert 1e6 * (index[5400.0] - index[-1800.0]) == pytest.approx(2.0 * 0.92 + 3.0 * 0.285, rel=0.05)


@pytest.mark.parametrize("humidity", [0.0, 0.2, 99.9, 100.0])
def test_air_at_the_ends_of_humidity_has_a_field(night_01, humidity):
    """What a percent is worth was asked at 100.4 %, which no formula knows; found among natural nights."""
    campaign, _ = weathered(night_01, [0.0, 40.0], np.arange(0.0, 3601.0, 60.0), lambda s, i: 10.0, humidity=humidity)
    assert np.all(np.isfinite(AirField.of(campaign, ReductionSettings()).knots.record))
