"""Living air: its index along a path by another quadrature, the ray's bending by Fermat, the day's course, dew."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import PPM
from catseye.simulator.night.air import group_refractivity_ppm
from catseye.simulator.twin.conditions import (
    DEWY_NIGHT,
    LIVING_NIGHT,
    STILL,
    WINDY_DAY,
    LivingConditions,
    LivingPlanted,
)
from simulator.living_scene import START, only, rms, site, twin

A, B = np.array([87.0, -84.8, 0.7]), np.array([-2.0, -40.0, 104.0])
NOON = 14.5 * 3600.0  # s after 21 h local mean time: 11:30 of the next day


def index(made, points, seconds):
    return made.air.index(points, np.full(len(points), float(seconds)))


@pytest.mark.parametrize("seconds", [0.0, 20_000.0, NOON])
@pytest.mark.parametrize("end", [B, np.array([60.0, -100.0, 0.9])])
@pytest.mark.parametrize(("left_out", "good_to"), [(("eddies",), 1e-11), ((), 2e-10)])  # 1 nm and 20 nm in 100 m
def test_the_mean_of_a_path_is_that_of_a_fine_sum(seconds, end, left_out, good_to):
    made = twin(planted=LivingPlanted(ignore=left_out))
    share = (np.arange(4000) + 0.5)[:, None] / 4000
    fine = index(made, A + (end - A) * share, seconds).mean()
    mean, last, _ = made.air.along(A[None], end[None], np.array([seconds]))
    assert mean[0] == pytest.approx(fine, abs=good_to)
    assert last[0] == pytest.approx(index(made, end[None], seconds)[0], abs=1e-15)


@pytest.mark.parametrize("conditions", [LIVING_NIGHT, WINDY_DAY])
def test_a_bent_ray_is_shorter_by_less_than_a_tenth_of_a_micrometre(conditions):
    made, far = twin(conditions=conditions), np.array([-90.0, 85.0, 0.9])  # 245 m low over the ground: the worst here
    share = ((np.arange(6000) + 0.5) / 6000)[:, None]
    way = far - A
    length, up = np.linalg.norm(way), np.array([0.0, 0.0, 1.0])

    def optical(bow):
        """Group path along a parabola that rises by `bow` half-way, m."""
        n = index(made, A + way * share + 4 * bow * share * (1 - share) * up, 0.0)
        slope = 4 * bow * (1 - 2 * share[:, 0]) / length
        tilt = way[2] / length
        return float(np.mean(n * (np.sqrt(1 + slope**2 + 2 * slope * tilt) - 1)) + np.mean(n - 1)) * length

    bows = np.linspace(-4e-3, 4e-3, 17)
    paths = np.array([optical(b) for b in bows])
    best = np.polynomial.Polynomial.fit(bows, paths, 2)
    at = best.deriv().roots()[0]
    assert abs(at) < 4e-3  # the least is inside
    assert 0.0 <= optical(0.0) - best(at) < 0.1e-6


def test_it_begins_as_its_conditions_say_and_without_layers_is_everywhere_the_same():
    made = twin(planted=STILL)
    points = np.random.default_rng(1).normal(0.0, 60.0, (1, 7, 3))
    t, p, h = made.air.weather(points, np.array([5000.0]))
    assert t == pytest.approx(np.full((1, 7), 11.3), abs=1e-12)
    assert p == pytest.approx(np.full((1, 7), 930.6), abs=1e-12)
    assert h == pytest.approx(np.full((1, 7), 70.5), abs=1e-9)
    expected = 1 + PPM * group_refractivity_ppm(11.3, 930.6, 70.5)
    assert made.air.index(points[0], np.zeros(7)) == pytest.approx(np.full(7, expected), abs=1e-15)


def test_the_day_is_warmest_at_15_h_local_mean_time_and_drier():
    made = twin(planted=only("diurnal"))
    t = np.arange(0.0, 86_400.0, 60.0)
    temperature, _, humidity = (v[:, 0] for v in made.air.weather(np.zeros((len(t), 1, 3)), t))
    local = (START % 1 * 24 + site().site.site.longitude_deg / 15 + t / 3600) % 24
    assert temperature[0] == pytest.approx(11.3, abs=1e-12)
    assert humidity[0] == pytest.approx(70.5, abs=1e-9)
    assert local[np.argmax(temperature)] == pytest.approx(15.0, abs=0.05)
    assert np.ptp(temperature) == pytest.approx(10.0, rel=1e-3)
    assert local[np.argmin(humidity)] == pytest.approx(15.0, abs=0.1)  # the vapour stays
    steel = made.air.steel_c(t)
    assert local[np.argmax(steel)] == pytest.approx(16.0, abs=0.05)


def test_the_sun_is_brightest_at_half_past_twelve_local_mean_time():
    air, seconds = twin(planted=only("diurnal")).air, np.arange(0.0, 86_400.0, 60.0)
    clock = (START % 1.0 * 24.0 + site().site.site.longitude_deg / 15.0 + seconds / 3600.0) % 24.0
    sunshine = air.sunshine(seconds)
    assert clock[np.argmax(sunshine)] == pytest.approx(12.5, abs=1 / 60)
    assert clock[np.argmin(sunshine)] == pytest.approx(0.5, abs=1 / 60)
    assert (sunshine.min(), sunshine.max()) == pytest.approx((0.0, 1.0), abs=1e-4)


def test_temperature_rises_from_the_ground_at_night_and_falls_by_day():
    made = twin(planted=only("stratification", "diurnal"))
    heights = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 100.0]]])
    night, day = (made.air.weather(heights, np.array([s]))[0][0] for s in (3 * 3600.0, 15.5 * 3600.0))
    assert night[1] - night[0] == pytest.approx(0.8 + 0.4, abs=0.15)
    assert day[1] - day[0] == pytest.approx(-0.98 - 0.8, abs=0.15)
    pressures = made.air.weather(heights, np.array([0.0]))[1][0]
    assert pressures[0] - pressures[1] == pytest.approx(11.0)  # 0.11 hPa a metre


def test_the_horizontal_gradient_is_of_the_stated_size():
    slopes = [twin(planted=only("horizontal_gradient"), seed=s).air.slope * 100 for s in range(30)]
    assert rms(slopes) == pytest.approx(0.05, rel=0.3)  # 60 draws: 9 %
    made = twin(planted=only("horizontal_gradient"))
    t = made.air.weather(np.array([[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]]), np.zeros(1))[0][0]
    assert t[1] - t[0] == pytest.approx(made.air.slope[0] * 100, rel=1e-9)


def test_weather_varies_by_the_stated_amount():
    t = np.array([0.0, 3600.0])
    moved = []
    for seed in range(60):
        w = twin(planted=only("weather_wander"), seed=seed).air.wander(t)
        moved.append([w[1, 0] * np.sqrt(1), w[1, 1] - w[0, 1], w[1, 2]])
    temperature, pressure, dew_point = (rms(v) for v in np.array(moved).T)
    assert (temperature, pressure, dew_point) == pytest.approx((0.15, 0.2, 0.3), rel=0.35)  # 60 draws: 9 %


def kept(made, seconds):
    return float(made.air.along(A[None], B[None], np.array([seconds]))[2][0])


def test_dew_falls_on_a_damp_calm_night_and_dries_by_noon():
    quiet = only("diurnal", "dew")
    assert kept(twin(planted=quiet, conditions=DEWY_NIGHT), 3600.0) < 0.05
    assert kept(twin(planted=quiet, conditions=DEWY_NIGHT), NOON) > 0.999
    assert kept(twin(planted=quiet), 3600.0) > 0.99
    assert kept(twin(planted=only("diurnal"), conditions=DEWY_NIGHT), 3600.0) == 1.0
    windy = replace(DEWY_NIGHT, wind_m_s=20.0)
    assert kept(twin(planted=quiet, conditions=windy), 3600.0) > 2 * kept(
        twin(planted=quiet, conditions=DEWY_NIGHT), 3600.0
    )


def test_dew_comes_smoothly_about_the_dew_point():
    # in still air under a night sky, a retroreflector 3 degrees below the air at 11.3: dew point 8.3 at 82 %
    humid = [
        kept(twin(planted=only("dew"), conditions=LivingConditions(wind_m_s=0.0, humidity_percent=h)), 0.0)
        for h in range(75, 96)
    ]
    assert np.all(np.diff(humid) < 0)
    assert humid[0] > 0.9
    assert humid[-1] < 0.05


def test_a_station_reads_the_air_where_it_stands_its_offset_and_its_scatter():
    made = twin(planted=only("stratification"))
    low, high = (made.weather(s, 60.0) for s in ("WX1", "WX2"))
    c, z1, z2 = LIVING_NIGHT, 803.8 - 806.42, 850.15 - 806.42
    assert low.pressure_hpa - high.pressure_hpa == pytest.approx(0.11 * (z2 - z1), abs=2e-3)
    night = c.gradient_c_per_m[0] + (c.gradient_c_per_m[1] - c.gradient_c_per_m[0]) * float(made.air.sunshine(60.0))
    layer = c.surface_layer_c[0] + (c.surface_layer_c[1] - c.surface_layer_c[0]) * float(made.air.sunshine(60.0))
    expected = night * (z2 - z1) + layer * (np.exp(-z1 / 10) - np.exp(-z2 / 10))
    assert high.temperature_c - low.temperature_c == pytest.approx(expected, abs=2e-3)
    assert low.ticks == made.ticks(60.0)

    offsets = [
        twin(planted=only("thermometer_offsets"), seed=s).weather("WX1", 0.0).temperature_c - 11.3 for s in range(40)
    ]
    assert rms(offsets) == pytest.approx(0.3, rel=0.35)
    noisy = twin(planted=only("weather_scatter"))
    reads = np.array(
        [
            [w.temperature_c, w.pressure_hpa, w.humidity_percent]
            for w in (noisy.weather("WX2", 10.0 * k) for k in range(300))
        ]
    )
    assert reads.std(axis=0) == pytest.approx([0.05, 0.05, 0.5], rel=0.15)  # 300 draws: 4 %
    assert noisy.weather("WX2", 50.0) == noisy.weather("WX2", 50.0)


@pytest.mark.parametrize(("elevation_m", "expected"), [(319.0, 986.7), (0.0, 1024.9), (2600.0, 745.9)])
def test_pressure_follows_the_standard_atmosphere_to_the_site_s_height(elevation_m, expected):
    """By hand: 930.6 hPa at 806.42 m times ((288.15 - 0.0065 h) / 282.908)^5.25588."""
    whole = site()
    there = whole.site.model_copy(
        update={"site": whole.site.site.model_copy(update={"elevation_of_z0_m": elevation_m})}
    )
    made = twin(planted=STILL, at=replace(whole, site=there))
    pressure = made.air.weather(np.zeros((1, 1, 3)), np.zeros(1))[1]
    assert pressure[0, 0] == pytest.approx(expected, abs=0.1)
    assert twin(planted=STILL).air.conditions == LIVING_NIGHT
    kept = LivingConditions(pressure_hpa=1000.0, elevation_m=elevation_m)  # what is said of this very height stands
    assert twin(planted=STILL, at=replace(whole, site=there), conditions=kept).air.conditions.pressure_hpa == 1000.0
