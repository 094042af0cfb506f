"""What passes through a living site's air, thermometers that follow it late, steel that expands: sizes by hand."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import PPM
from catseye.geometry.sky.sun import altitude_azimuth, sun_direction
from catseye.simulator.night.fields import AirWave
from catseye.simulator.night.lag import lagged
from catseye.simulator.twin.conditions import LIVING_NIGHT, STILL
from catseye.simulator.twin.fronts import SLOT, LivingFronts, step_share
from catseye.simulator.twin.passing import TravellingWaves
from simulator.living_scene import START, only, rms, site, twin

LOW, HIGH = np.array([87.0, -84.8, 0.7]), np.array([-2.0, -40.0, 104.0])
NOON = 14.5 * 3600.0  # s after 21 h local mean time
HOURS = np.arange(0.0, 12 * 3600.0, 20.0)


def temperature(made, point, seconds):
    """Of the air at a point (3,) and times (k,)."""
    t = np.asarray(seconds, dtype=float)
    return made.air.weather(np.asarray(point)[None, None], t)[0][:, 0]


def test_waves_are_those_of_a_night_side_by_side():
    waves = [AirWave(0.2, 700.0, 0.4, (0.1, -0.2), 0.004), AirWave(0.1, 3000.0, 2.0, (-0.05, 0.1), 0.0)]
    points, seconds = np.random.default_rng(1).normal(0.0, 60.0, (50, 3)), np.linspace(0.0, 9000.0, 50)
    expected = sum(w.temperature_c(points, seconds) for w in waves)
    np.testing.assert_allclose(TravellingWaves.of(waves)(points, seconds), expected, atol=1e-13)


def test_waves_are_common_to_the_site_and_of_their_size():
    sizes = []
    for seed in range(24):
        made = twin(planted=only("air_waves"), seed=seed)
        low, high = (temperature(made, p, HOURS) - 11.3 for p in (LOW, HIGH))
        assert np.corrcoef(low, high)[0, 1] > 0.7  # at 2 m/s a wave of 5 min needs 70 s from one to the other
        sizes.append(rms(temperature(made, [0.0, 0.0, 0.0], HOURS) - 11.3))
    # three amplitudes, even up to 0.2 degC: 0.2 / sqrt(3) x sqrt(3 / 2)
    assert rms(sizes) == pytest.approx(0.141, rel=0.25)


def test_fronts_step_from_level_to_level_and_stay_within_their_size():
    fronts = LivingFronts.drawn(np.random.default_rng(3), 1.0, np.array([0.0, 4.0]))
    origin, t = np.zeros((1, 3)), np.arange(-2 * SLOT, 10 * SLOT, 10.0)
    level = fronts(origin, t)
    assert 0.3 < np.ptp(level) <= 1.0
    between = fronts(origin, np.arange(0, 10) * SLOT)
    np.testing.assert_allclose(between, fronts.level[np.arange(-1, 9)], atol=1e-12)
    step = np.abs(np.diff(level)).max() / 10.0  # °C/s: pi / 2 of a step in no less than 120 s
    assert step < np.pi / 2 * 1.0 / 120.0
    late = fronts(np.array([[0.0, 80.0, 5.0]]), t + 20.0)  # 80 m further north, at 4 m/s
    np.testing.assert_allclose(late, level, atol=1e-9)


def test_fronts_followed_late_are_the_lag_of_fronts():
    fronts = LivingFronts.drawn(np.random.default_rng(4), 1.0, np.array([3.0, 0.0]))
    origin, t = np.zeros((1, 3)), np.linspace(0.0, 20_000.0, 41)
    for lag in (45.0, 3600.0):
        expected = lagged(lambda s: fronts(origin, s), t, time_constant_s=lag, step_s=1.0)
        np.testing.assert_allclose(fronts(origin, t, lag), expected, atol=2e-6)
    assert step_share(1e5, 300.0, 60.0) == pytest.approx(1.0)
    assert step_share(-5.0, 300.0, 60.0) == pytest.approx(0.0, abs=1e-12)


def test_eddies_are_local_and_ride_on_the_wind():
    made = twin(planted=only("eddies"))
    near, far = LOW + np.array([3.0, 0.0, 0.0]), LOW + np.array([-160.0, 120.0, 40.0])
    here, beside, away = (temperature(made, p, HOURS) - 11.3 for p in (LOW, near, far))
    assert rms(here) == pytest.approx(0.075, rel=0.1)
    assert np.corrcoef(here, beside)[0, 1] > 0.8
    assert abs(np.corrcoef(here, away)[0, 1]) < 0.4
    wind = np.array([*made.air.passing.eddies.wind_m_s, 0.0])
    assert np.linalg.norm(wind) == pytest.approx(LIVING_NIGHT.wind_m_s)
    np.testing.assert_allclose(temperature(made, LOW + 10.0 * wind, HOURS + 10.0) - 11.3, here, atol=1e-10)


def test_paths_that_lie_side_by_side_see_the_same_eddies():
    made, still = twin(planted=only("eddies")), twin(planted=STILL)
    t = HOURS[::10]

    def change(start, end):
        ends = (np.broadcast_to(p, (len(t), 3)) for p in (start, end))
        a, b = list(ends)
        return (made.air.along(a, b, t)[0] - still.air.along(a, b, t)[0]) / PPM

    one = change(LOW, HIGH)
    aside = np.array([2.0, 1.0, 0.0])
    beside, across = change(LOW + aside, HIGH + aside), change(-LOW, HIGH)
    assert 0.015 < rms(one) < 0.07  # 0.94 ppm/degC x 0.075 degC, less by averaging over 140 m of 80 m eddies
    assert np.corrcoef(one, beside)[0, 1] > 0.95
    assert np.corrcoef(one, across)[0, 1] < 0.8


def test_pressure_waves_are_read_at_both_stations():
    made = twin(planted=only("pressure_waves"))
    t = np.arange(0.0, 7200.0, 30.0)
    read = np.array([[made.weather(s, k).pressure_hpa for k in t] for s in ("WX1", "WX2")]) - 930.6
    assert 0.02 < rms(read) < 0.5 * np.sqrt(2.0)
    assert np.corrcoef(*read)[0, 1] > 0.9
    assert {made.weather("WX1", k).temperature_c for k in t} == {11.3}


@pytest.mark.parametrize("seconds", [100.0, 7000.0, NOON])
def test_a_thermometer_follows_the_true_air_late(seconds):
    made = twin(planted=only("air_waves", "fronts", "eddies", "weather_wander", "diurnal", "thermometer_lag"))
    for name, thermometer in made.thermometers.items():
        place = thermometer.place
        expected = lagged(
            lambda t, at=place: temperature(made, at, t),
            np.array([seconds]),
            time_constant_s=thermometer.lag,
            step_s=0.1,
        )[0]
        assert 0.0 < thermometer.lag < 60.0
        assert thermometer.temperature_c(made.air, [seconds])[0] == pytest.approx(expected, abs=3e-4)  # 0.1 s, day
        assert made.weather(name, seconds).temperature_c == pytest.approx(expected, abs=1e-3)  # rounded


def test_the_sun_warms_thermometers_by_day_only():
    made = twin(planted=only("radiation_error"))
    for name, thermometer in made.thermometers.items():
        assert 0.0 < thermometer.radiation_c < 0.25
        assert made.weather(name, 0.0).temperature_c == 11.3  # 21 h local mean time
        where = site().site.site
        way = sun_direction(START + NOON / 86_400.0, *np.radians([where.latitude_deg, where.longitude_deg]))
        expected = thermometer.radiation_c * np.sin(altitude_azimuth(way)[0]) / (1.0 + 4.0 / 2.0)
        assert made.weather(name, NOON).temperature_c - 11.3 == pytest.approx(float(expected), abs=6e-4)  # rounded
    calm = twin(planted=only("radiation_error"), conditions=replace(LIVING_NIGHT, wind_m_s=0.0))
    assert calm.thermometers["WX1"].warmed_c(NOON, 0.0) == pytest.approx(
        3.0 * made.thermometers["WX1"].warmed_c(NOON, 4.0)
    )


def test_the_telescope_expands_with_its_steel_and_the_ground_does_not():
    made, still = twin(planted=only("expansion", "diurnal")), twin(planted=only("diurnal"))
    t = np.array([0.0, 3600.0, 7200.0])
    steel = made.air.steel_c(t)
    assert -3.0 < steel[2] < -0.3
    for name in ("ZEG41040L", "ZY115", "ZAG731P"):
        rest = still.point(name, t)
        np.testing.assert_allclose(made.point(name, t), rest * (1.0 + 11.7e-6 * steel[:, None]), atol=1e-10)
    for name in ("ZBM01", "ZY105", "ZY105-F"):
        assert np.array_equal(made.point(name, t), still.point(name, t))
    assert np.array_equal(made.points(["DP44C", "ZBM01"], t)[:, 0], made.point("DP44C", t))


def test_the_dish_expands_by_a_share_of_its_own_about_its_middle():
    made, still = twin(planted=only("expansion", "diurnal")), twin(planted=only("diurnal"))
    t = np.array([7200.0])
    shared = made.air.steel_c(t)[0] * 11.7e-6
    own = made.standing(t).dish_scale[0] / shared
    assert 0.0 < abs(own) < 0.2
    a, b = (np.diff(world.points(["DP01C", "DP44C"], t)[0], axis=0) for world in (made, still))
    np.testing.assert_allclose(a, b * (1.0 + shared * (1.0 + own)), atol=1e-9)
    turn, shift = still.standing(t).bodies["dish"]
    middle = turn[0] @ np.array([0.0, 54.0, 54.0**2 / 240.0]) + shift[0]
    for name in ("DP01C", "DP44C"):
        rest = still.point(name, t)[0]
        expected = shared * (rest + own * (rest - middle))
        np.testing.assert_allclose(made.point(name, t)[0] - rest, expected, atol=1e-9)


def test_steel_follows_waves_and_fronts_late():
    made = twin(planted=only("air_waves", "fronts"))
    t = np.linspace(0.0, 9000.0, 31)
    middle = np.array([0.0, 0.0, 50.0])
    expected = lagged(lambda s: temperature(made, middle, s), np.append(t, 0.0), time_constant_s=3600.0, step_s=5.0)
    np.testing.assert_allclose(made.air.steel_c(t), expected[:-1] - expected[-1], atol=1e-5)


def test_an_instant_is_the_same_alone_and_in_company():
    made, t = twin(), np.array([12.0, 5000.0, 90_000.0])
    together = temperature(made, HIGH, t)
    assert together == pytest.approx([temperature(made, HIGH, [s])[0] for s in t], abs=1e-12)
    assert np.all(np.isfinite(made.point("DP44C", t)))
