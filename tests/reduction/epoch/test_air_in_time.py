"""The air along paths by its parameters in time: lags, sunshine, level, slope and gradients across the site."""

import dataclasses

import numpy as np
import pytest

from catseye.atmosphere.index.air import group_refractivity
from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.path_temperature import PathTemperature, path_temperature_columns
from catseye.records.night.weather import Weather
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.parameter import ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings

Z0 = 806.42  # m above sea level, night-01's
NOON = 0.7125  # day: 17:06 UTC is 11:47 of local mean solar time at night-01's longitude of -79.84 degrees
PLACES = ((-60.0, 20.0), (80.0, -40.0))  # m


def moved_to(campaign, fraction):
    """The campaign with its first shot at a fraction of the day before, UTC; weather is made anew."""
    mjd = campaign.shots.mjd_utc
    first = np.floor(mjd[0]) + fraction
    return dataclasses.replace(campaign, shots=dataclasses.replace(campaign.shots, mjd_utc=mjd - mjd[0] + first))


def weathered(campaign, places, *, heights=(0.0, 50.0), temperature=lambda s, i: 10.0 + i):
    """Two stations that read every 30 s for as long as there are shots; places (x, y) or None."""
    mjd = campaign.shots.mjd_utc
    start, span = float(mjd[0]), float(np.ptp(mjd)) * SECONDS_PER_DAY
    seconds = np.arange(-60.0, span + 61.0, 30.0)
    one = campaign.site.weather_station[0]
    stations = tuple(
        one.model_copy(
            update={"name": f"S{i}", "elevation_m": h + Z0}
            | ({} if places is None else {"x_m": places[i][0], "y_m": places[i][1]})
        )
        for i, h in enumerate(heights)
    )
    rows = [(s, i) for s in seconds for i in range(len(heights))]
    weather = Weather(
        mjd_utc=np.array([start + s / SECONDS_PER_DAY for s, _ in rows]),
        station=tuple(f"S{i}" for _, i in rows),
        temperature_c=np.array([temperature(s, i) for s, i in rows]),
        pressure_hpa=np.full(len(rows), 900.0),
        humidity_percent=np.full(len(rows), 50.0),
    )
    site = campaign.site.model_copy(update={"weather_station": stations})
    return dataclasses.replace(campaign, site=site, weather=weather)


def waving(s, i):
    return 10.0 + i + (0.8 + 0.3 * i) * np.sin(s / 900.0 + i)


def paths(m=12):
    rng = np.random.default_rng(3)
    a, b = rng.uniform(-100, 100, (2, m, 3))
    a[:, 2], b[:, 2] = rng.uniform(0, 2, m), rng.uniform(0, 110, m)
    return a, b


def somewhere(field, seed=1):
    """Values of all parameters, each of a size that it can have."""
    rng = np.random.default_rng(seed)
    size = {
        ParameterKind.THERMOMETER: 0.3,
        ParameterKind.PROFILE: 0.01,
        ParameterKind.LAG: 60.0,
        ParameterKind.RADIATION: 0.5,
    }
    across = {"east": 0.003, "north": 0.003, "level": 0.2, "slope": 0.1}
    sizes = [across[p.of] if p.kind is ParameterKind.AIR else size[p.kind] for p in field.parameters]
    return np.array(sizes) * rng.standard_normal(field.count), np.array(sizes)


def at_columns(field, found):
    """The derivatives (m, p) by every parameter, from lasting slopes and columns."""
    every = np.zeros((len(found.refractivity), field.count))
    every[:, : found.slopes.shape[1]] = found.slopes
    for row, columns, slopes in zip(every, found.columns, found.column_slopes, strict=True):
        np.add.at(row, columns, slopes)
    return every


@pytest.mark.parametrize("heights", [(0.0, 50.0), (10.0, 12.0)])
@pytest.mark.parametrize("places", [None, PLACES])
@pytest.mark.parametrize("when", [None, NOON])
def test_every_derivative_by_the_air_is_a_finite_difference(night_01, when, places, heights):
    campaign = night_01 if when is None else moved_to(night_01, when)
    field = AirField.of(weathered(campaign, places, heights=heights, temperature=waving), ReductionSettings())
    kinds = {p.kind for p in field.parameters}
    assert (ParameterKind.RADIATION in kinds) == (when is not None)
    a, b = paths()
    times = np.linspace(campaign.shots.mjd_utc.min(), campaign.shots.mjd_utc.max(), len(a))
    base, sizes = somewhere(field)
    found = at_columns(field, field.along(times, a, b, base))
    seen = set()
    for q, parameter in enumerate(field.parameters):
        step = np.zeros(field.count)
        step[q] = 0.01 * sizes[q]
        up, down = (field.along(times, a, b, base + sign * step).refractivity for sign in (1, -1))
        # 1e-3: slopes are taken over a degree, so that the third derivative of n(T) enters, 1e-4 of it; vapour more
        scale = np.abs(up - down).max() / (2 * step[q])
        np.testing.assert_allclose(
            found[:, q],
            (up - down) / (2 * step[q]),
            rtol=1e-3,
            atol=1e-3 * scale + 1e-14 / step[q],
            err_msg=str(parameter),
        )
        if np.abs(found[:, q]).max() > 0.0:
            seen.add((parameter.kind, parameter.of if parameter.kind is ParameterKind.AIR else ""))
    assert {(ParameterKind.AIR, part) for part in ("level", "slope", "east", "north")} <= seen
    assert (ParameterKind.LAG, "") in seen
    assert ((ParameterKind.RADIATION, "") in seen) == (when is not None)


def test_by_day_each_thermometer_may_be_too_warm_by_the_sines_share_of_the_sun(night_01):
    campaign = moved_to(night_01, NOON)
    field = AirField.of(weathered(campaign, None), ReductionSettings())
    assert field.errors == (ParameterKind.LAG, ParameterKind.RADIATION)
    # by hand: 2003-09-07 near noon at 38.43 degrees of latitude, declination 6.0 degrees: the Sun is 57.6 degrees high
    times = campaign.shots.mjd_utc[:1]
    found = field.along(times, np.zeros((1, 3)), np.array([[100.0, 0.0, 0.0]]), np.zeros(3))
    by_station = dict(zip(field.parameters, at_columns(field, found)[0], strict=True))
    thermometer, sunshine = (
        next(v for p, v in by_station.items() if p.kind is kind and p.of == "S0")
        for kind in (ParameterKind.THERMOMETER, ParameterKind.RADIATION)
    )
    # to a degree of the altitude, 0.01
    assert sunshine / thermometer == pytest.approx(np.sin(np.radians(57.6)), abs=0.01)
    assert sunshine > 0.0  # it reads too warm: the air is colder, the index higher


def test_at_night_there_is_no_sunshine(night_01):
    field = AirField.of(weathered(night_01, None), ReductionSettings())
    assert field.errors == (ParameterKind.LAG,)
    assert field.sun.shape == (2, 0)


def test_a_thermometer_that_lags_shows_the_temperature_of_before(night_01):
    """By hand: falling by 3.6 °C an hour, 100 s late, it reads 0.1 °C too warm: the air is that much colder."""
    field = AirField.of(weathered(night_01, None, temperature=lambda s, i: 15.0 - 0.001 * s), ReductionSettings())
    values = np.zeros(field.count)
    values[[p.kind is ParameterKind.LAG for p in field.parameters]] = 100.0
    times = night_01.shots.mjd_utc[[100]]
    foot, far = np.array([[0.0, 0.0, 25.0]]), np.array([[100.0, 0.0, 25.0]])
    warmth = 15.0 - 0.001 * (times - field.start_mjd) * SECONDS_PER_DAY - 0.1
    expected = group_refractivity(warmth, 900.0, 50.0, wavelength_um=0.78, model="rueger1990")
    # 1e-11: a microsecond of the Modified Julian Day, and its tenth in which a record counts, times 0.001 °C/s
    np.testing.assert_allclose(field.along(times, foot, far, values).refractivity, expected, rtol=0, atol=1e-10)


def of_part(field, part, number):
    return next(
        i
        for i, p in enumerate(field.parameters)
        if p.kind is ParameterKind.AIR and (p.of, p.part) == (part, str(number))
    )


def test_a_level_of_one_degree_is_one_degree_everywhere_at_its_knots_time_only(night_01):
    field = AirField.of(weathered(night_01, PLACES, temperature=lambda s, i: 10.0), ReductionSettings())
    own = field.knots.level
    number = len(own) // 2
    values = np.zeros(field.count)
    values[of_part(field, "level", number)] = 1.0
    between = 0.5 * (own[number] + own[number + 1])
    seconds = np.array([own[number - 1], own[number], between, own[number + 1], own[0], own[-1]])
    share = np.array([0.0, 1.0, 0.5, 0.0, 0.0, 0.0])
    times = field.start_mjd + seconds / SECONDS_PER_DAY
    for end in ([100.0, 0.0, 25.0], [-30.0, 90.0, 0.0], [10.0, 10.0, 100.0]):
        b = np.tile(end, (6, 1))
        a = b - [50.0, 50.0, 0.0]
        found = field.along(times, a, b, values).refractivity
        expected = group_refractivity(
            10.0 + share, 900.0 - 0.11 * (b[:, 2] - 25.0), 50.0, wavelength_um=0.78, model="rueger1990"
        )
        # 1e-11: a tenth of a microsecond between knots two minutes apart is 1e-9 °C
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def test_a_slope_of_one_degree_is_a_degree_warmer_at_the_highest_station_and_colder_at_the_lowest(night_01):
    field = AirField.of(weathered(night_01, None, temperature=lambda s, i: 10.0), ReductionSettings())
    values = np.zeros(field.count)
    values[of_part(field, "slope", 0)] = 1.0
    z = np.array([0.0, 25.0, 50.0, 100.0])
    a = np.stack([0.0 * z, 0.0 * z, z], axis=1)
    times = np.full(4, field.start_mjd + field.knots.slope[0] / SECONDS_PER_DAY)
    found = field.along(times, a, a + np.array([80.0, 0.0, 0.0]), values).refractivity
    expected = group_refractivity(
        10.0 + np.array([-1.0, 0.0, 1.0, 3.0]), 900.0 - 0.11 * (z - 25.0), 50.0, wavelength_um=0.78, model="rueger1990"
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def along_east(field, x, values, y=0.0):
    """Refractivity of a level path of 40 m, north to south, at x metres east."""
    times = np.full(1, field.start_mjd + field.knots.across[0] / SECONDS_PER_DAY)
    return field.along(times, np.array([[x, y - 20.0, 25.0]]), np.array([[x, y + 20.0, 25.0]]), values).refractivity[0]


def index_at(temperature):
    return float(group_refractivity(temperature, 900.0, 50.0, wavelength_um=0.78, model="rueger1990"))


def test_an_east_gradient_of_a_hundredth_makes_a_path_100_m_east_a_degree_warmer(night_01):
    """Stations that stand nobody knows where, so at the middle: their readings are the middle's."""
    field = AirField.of(weathered(night_01, None, temperature=lambda s, i: 10.0), ReductionSettings())
    values = np.zeros(field.count)
    values[of_part(field, "east", 0)] = 0.01
    assert along_east(field, 0.0, values) == pytest.approx(index_at(10.0), abs=1e-12)
    assert along_east(field, 100.0, values) == pytest.approx(index_at(11.0), abs=1e-11)
    assert along_east(field, -50.0, values) == pytest.approx(index_at(9.5), abs=1e-11)
    # a path from west to east across the middle: the mean is nothing, and the curvature of n(T) 4e-9
    times = np.full(1, field.start_mjd)
    across = field.along(times, np.array([[-100.0, 0.0, 25.0]]), np.array([[100.0, 0.0, 25.0]]), values)
    assert across.refractivity[0] == pytest.approx(index_at(10.0), abs=5e-9)
    gradient = dict(zip(field.parameters, at_columns(field, across)[0], strict=True))
    # 1e-6 °C/m of that is what the slope says of 100 m of a ppm a degree
    assert abs(next(v for p, v in gradient.items() if (p.of, p.part) == ("east", "0"))) < 1e-6


def test_a_station_in_the_east_reads_the_air_there_not_the_middles(night_01):
    """By hand: both stations at x = 100 read 10 °C, and it is 0.01 °C/m warmer to the east: 9 °C in the middle."""
    east = AirField.of(
        weathered(night_01, ((100.0, 0.0), (100.0, 0.0)), temperature=lambda s, i: 10.0), ReductionSettings()
    )
    values = np.zeros(east.count)
    values[of_part(east, "east", 0)] = 0.01
    assert along_east(east, 0.0, values) == pytest.approx(index_at(9.0), abs=1e-11)
    assert along_east(east, 100.0, values) == pytest.approx(index_at(10.0), abs=1e-11)
    values = np.zeros(east.count)
    values[of_part(east, "north", 0)] = 0.01
    assert along_east(east, 0.0, values, y=50.0) == pytest.approx(index_at(10.5), abs=1e-8)  # n(T) is curved


def test_the_height_gradient_excludes_the_effect_of_the_stations_places(night_01):
    """A mast 50 m higher and 100 m to the east reads 1 °C warmer: all of it is the site's 0.01 °C/m."""
    field = AirField.of(
        weathered(night_01, ((0.0, 0.0), (100.0, 0.0)), temperature=lambda s, i: 10.0 + i), ReductionSettings()
    )
    values = np.zeros(field.count)
    assert field.steepest(values) == pytest.approx(0.02, abs=1e-9)
    for k in range(len(field.knots.across)):
        values[of_part(field, "east", k)] = 0.01
    assert field.across(values) == pytest.approx([0.01, 0.0], abs=1e-15)
    assert field.steepest(values) == pytest.approx(0.0, abs=1e-9)
    assert field.placed.tolist() == [True, True]


def test_a_path_has_one_air_from_either_end_whatever_the_parameters(night_01):
    campaign = moved_to(night_01, NOON)
    field = AirField.of(weathered(campaign, PLACES, temperature=waving), ReductionSettings())
    a, b = paths()
    times = np.linspace(campaign.shots.mjd_utc.min(), campaign.shots.mjd_utc.max(), len(a))
    values, _ = somewhere(field, 4)
    there, back = field.along(times, a, b, values), field.along(times, b, a, values)
    np.testing.assert_allclose(there.refractivity, back.refractivity, rtol=1e-13)
    np.testing.assert_array_equal(there.columns, back.columns)
    # 1e-12 of the largest: gradients cancel along a path
    limit = 1e-12 * np.abs(there.column_slopes).max(axis=0).max()
    np.testing.assert_allclose(there.column_slopes, back.column_slopes, rtol=1e-9, atol=limit)


def test_parameters_left_out_at_the_end_are_zero(night_01):
    field = AirField.of(weathered(night_01, PLACES, temperature=waving), ReductionSettings())
    a, b = paths()
    times = np.full(len(a), field.start_mjd)
    every = np.zeros(field.count)
    every[:3] = [0.2, -0.1, 0.02]
    short, whole = (field.along(times, a, b, values) for values in (every[:3], every))
    np.testing.assert_array_equal(short.refractivity, whole.refractivity)
    np.testing.assert_array_equal(short.column_slopes, whole.column_slopes)


def test_the_columns_of_a_path_are_all_lags_and_two_knots_of_each_part(night_01):
    field = AirField.of(weathered(night_01, PLACES), ReductionSettings())
    found = field.along(night_01.shots.mjd_utc[:1], np.zeros((1, 3)), np.full((1, 3), 30.0), np.zeros(3))
    names = [str(field.parameters[c]) for c in found.columns[0]]
    knots = [f"air's {part} {i}" for part in ("level", "slope", "east", "north") for i in (0, 1)]
    assert names == ["lag S0", "lag S1", *knots]


def test_on_a_line_that_sound_measured_the_process_acts_by_the_vapour_alone(night_01):
    campaign = weathered(night_01, PLACES, temperature=waving)
    start = float(campaign.shots.mjd_utc[0])
    rows = [
        PathTemperature(
            mjd_utc=start + s / SECONDS_PER_DAY, ranger="ZY101", target="T", temperature_c=13.0, u_temperature_c=0.2
        )
        for s in (0.0, 600.0)
    ]
    table = path_temperature_columns(rows)
    field = AirField.of(dataclasses.replace(campaign, path_temperatures=table), ReductionSettings())
    a, b = paths()
    times = np.full(len(a), start + 300.0 / SECONDS_PER_DAY)
    bound = field.on_lines(times, [frozenset(("ZY101", "T"))] * len(a))
    values, sizes = somewhere_sounded(field)
    found = at_columns(field, bound.along(times, a, b, values))
    plain = at_columns(field, field.along(times, a, b, values))
    for q, parameter in enumerate(field.parameters):
        step = np.zeros(field.count)
        step[q] = 0.1 * sizes[q]
        up, down = (bound.along(times, a, b, values + sign * step).refractivity for sign in (1, -1))
        slope = (up - down) / (2 * step[q])
        # 5e-3: saturation pressure is curved over the degree of the slope
        np.testing.assert_allclose(
            found[:, q], slope, rtol=5e-3, atol=5e-3 * np.abs(slope).max() + 1e-14 / step[q], err_msg=str(parameter)
        )
    level = [p.kind is ParameterKind.AIR and p.of == "level" for p in field.parameters]
    # a degree is 0.9 ppm by density, and by the vapour of half-wet air at 10 °C some hundredth of that
    by_density = np.abs(plain[:, level].sum(axis=1))
    assert np.all(by_density > 0.8e-6)
    assert np.all(np.abs(found[:, level].sum(axis=1)) < 0.1 * by_density)


def somewhere_sounded(field):
    sounded = [p.kind is ParameterKind.SOUND for p in field.parameters]
    values, sizes = np.zeros(field.count), np.full(field.count, 0.1)
    own, own_sizes = somewhere(dataclasses.replace(field, names=field.names[:3], lines=()))
    values[~np.array(sounded)], sizes[~np.array(sounded)] = own, own_sizes
    return values, sizes
