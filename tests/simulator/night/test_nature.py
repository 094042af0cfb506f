"""Nature of a night: each effect is there with its size, worked out here by hand; without it nothing changes."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import PPM
from catseye.errors import InputError, ValidityError
from catseye.geometry.sky.sun import altitude_azimuth, sun_direction
from catseye.simulator.night.air import NIGHT, TrueAir, group_refractivity_ppm
from catseye.simulator.night.batches import in_batches
from catseye.simulator.night.expansion import SteelExpansion
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.fields import AirWave, Front, HorizontalGradient, PressureWave, Turbulence
from catseye.simulator.night.head import neighbouring_residuals
from catseye.simulator.night.lag import lagged
from catseye.simulator.night.natural_air import NaturalAir
from catseye.simulator.night.nature import CALM, Nature
from catseye.simulator.night.posture import posture
from catseye.simulator.night.schedule import REFERENCE
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from catseye.simulator.night.stations import ReadingGap, StationNature
from catseye.simulator.night.structure import structure
from catseye.simulator.night.sun import sine_of_sun

SMALL = SimulatedTelescope(dish_prisms=20, triplets=4)
SILENT = Planted(ignore=["weather_scatter", "thermometer_offsets", "index_fluctuation"])
RIM, LOW = np.array([35.0, -70.0, 95.0]), np.array([110.0, -45.0, 0.4])
SLOPE_PPM = -float(group_refractivity_ppm(11.0, 925.0, 70.0)) / 284.15  # per degC: density goes with 1 / T
NOON = 52892.72  # MJD UTC: the Sun is highest at Green Bank, 56.5 degrees


def small(nature=None, *, seed=5, planted=SILENT, **options):
    return simulate_night(seed, telescope=SMALL, faults=Faults(0.0, 0.0), planted=planted, nature=nature, **options)


@pytest.fixture(scope="module")
def calm():
    return small()


def read(night, station, what="temperature_c"):
    """Times and readings of one station."""
    mine = [w for w in night.weather if w.station == station]
    return np.array([w.seconds for w in mine]), np.array([getattr(w, what) for w in mine])


def ppm(night):
    return np.array(list(night.truth.path_refractivity_ppm.values()))


def test_a_calm_nature_is_no_nature(calm):
    for nature in (CALM, Nature(), Nature.drawn(5, 0.0)):
        other = small(nature)
        assert np.array_equal(other.frames, calm.frames)
        assert other.weather == calm.weather
        assert other.truth.path_refractivity_ppm == calm.truth.path_refractivity_ppm
        assert type(other.truth.air) is TrueAir


def test_the_same_seed_draws_the_same_nature_and_the_same_night():
    nature = Nature.drawn(3)
    assert nature == Nature.drawn(3)
    assert nature != Nature.drawn(4)
    one, two = small(nature), small(Nature.drawn(3))
    assert np.array_equal(one.frames, two.frames)
    assert one.weather == two.weather


def test_another_night_has_other_air_and_the_same_stations_steel_and_glass():
    one, two = Nature.drawn(3), Nature.drawn(3, night=1)
    assert one.wind_m_s != two.wind_m_s
    assert one.waves != two.waves
    assert (one.expansion, one.batch_heights) == (two.expansion, two.batch_heights)
    assert (one.stations.lags_s, one.stations.interval_s) == (two.stations.lags_s, two.stations.interval_s)


def test_each_effect_stays_below_its_largest_reaches_near_it_and_is_sometimes_absent():
    drawn = [Nature.drawn(seed) for seed in range(200)]
    sizes = {
        "wave": (0.4, [w.amplitude_c for n in drawn for w in n.waves]),
        "front": (1.5, [abs(f.step_c) for n in drawn for f in n.fronts]),
        "eddies": (0.15, [n.turbulence.rms_c for n in drawn if n.turbulence]),
        "gradient": (0.008, [n.horizontal.turning_c_per_m for n in drawn if n.horizontal]),
        "pressure": (0.5, [w.amplitude_hpa for n in drawn for w in n.pressure_waves]),
        "lag": (120.0, [v for n in drawn for v in n.stations.lags_s.values() if v]),
        "Sun": (0.5, [v for n in drawn for v in n.stations.radiation_c.values() if v]),
        "steel": (1.0, [n.expansion.share for n in drawn if n.expansion]),
        "batches": (1.0, [n.batch_heights for n in drawn if n.batch_heights]),
        "neighbours": (1.0, [n.neighbours for n in drawn if n.neighbours]),
    }
    for name, (largest, values) in sizes.items():
        assert 0.95 * largest < max(values) <= largest, name  # of 150 even draws one lies in the last twentieth
        assert np.mean(values) == pytest.approx(0.5 * largest, rel=0.15), name
    for absent in (
        (not n.turbulence for n in drawn),
        (not n.horizontal for n in drawn),
        (not n.expansion for n in drawn),
    ):
        assert np.mean(list(absent)) == pytest.approx(0.2, abs=0.09)  # three sigmas of 200
    intervals = [n.stations.interval_s for n in drawn]
    assert 10.0 <= min(intervals) <= 20.0
    assert 500.0 <= max(intervals) <= 600.0


def test_half_the_strength_is_half_of_each_effect():
    one, half = Nature.drawn(8), Nature.drawn(8, 0.5)
    assert [w.amplitude_c for w in half.waves] == pytest.approx([0.5 * w.amplitude_c for w in one.waves])
    assert [w.period_s for w in half.waves] == [w.period_s for w in one.waves]
    assert half.stations.lags_s == pytest.approx({k: 0.5 * v for k, v in one.stations.lags_s.items()})


def test_a_wave_common_to_the_site_is_in_both_stations_and_in_every_path(calm):
    made = small(Nature(waves=(AirWave(amplitude_c=0.3, period_s=2100.0),)))
    for station in ("WX1", "WX2"):
        seconds, read_c = read(made, station)
        expected = 0.3 * np.sin(2 * np.pi * seconds / 2100.0)
        np.testing.assert_allclose(read_c - read(calm, station)[1], expected, atol=1e-12)
    seconds = np.array([s.seconds for s in made.shots if s.target != "ZRG"])
    expected = -ppm(calm) / 284.0 * 0.3 * np.sin(2 * np.pi * seconds / 2100.0)  # density goes with 1 / T
    np.testing.assert_allclose(ppm(made) - ppm(calm), expected, atol=0.01 * 0.3)  # air of 281 to 286 K


def test_a_wave_travels_and_grows_with_height():
    wave = AirWave(0.2, 900.0, slowness_s_per_m=(0.2, -0.1), growth_per_m=0.005)
    point = np.array([50.0, 20.0, 80.0])  # 50 x 0.2 - 20 x 0.1: 8 s later, 1.4 times the amplitude
    assert wave.temperature_c(point, 225.0 + 8.0) == pytest.approx(0.28)
    assert wave.temperature_c(np.zeros(3), 225.0) == pytest.approx(0.2)


def test_a_front_is_a_step_that_passes_with_its_rise():
    front = Front(step_c=-1.0, at_s=1000.0, rise_s=300.0, slowness_s_per_m=(0.25, 0.0))
    at, east = np.zeros(3), np.array([100.0, 7.0, 3.0])
    steps = [float(front.temperature_c(at, s)) for s in (850.0, 1000.0, 1150.0, 9e3)]
    assert steps == pytest.approx([0.0, -0.5, -1.0, -1.0], abs=1e-12)
    assert front.temperature_c(east, 1025.0) == pytest.approx(-0.5)


def test_a_gradient_changes_a_paths_index_by_the_mean_along_it():
    gradient = HorizontalGradient((0.006, -0.004))
    even = replace(NIGHT, gradient_c_per_m=0.0, surface_layer_c=0.0)
    air, seconds = NaturalAir(even, 1.0, Nature(horizontal=gradient)), np.array([0.0])
    smooth = TrueAir(even)
    mean_c = 0.006 * 72.5 - 0.004 * -57.5  # half-way between the ends, by hand
    changed = (air.path_index(RIM, LOW[None], seconds) - smooth.path_index(RIM, LOW[None], seconds)) / PPM
    assert changed[0] == pytest.approx(SLOPE_PPM * mean_c, rel=0.01)


def test_a_turning_gradient_is_a_quarter_turn_on_after_a_quarter_of_its_period():
    gradient = HorizontalGradient(turning_c_per_m=0.005, period_s=4000.0)
    np.testing.assert_allclose(gradient.c_per_m([0.0, 1000.0]), [[0.005, 0.0], [0.0, 0.005]], atol=1e-15)


def test_a_pressure_wave_is_in_the_barometers_and_in_the_paths(calm):
    made = small(Nature(pressure_waves=(PressureWave(0.4, 1200.0),)))
    seconds, hpa = read(made, "WX2", "pressure_hpa")
    np.testing.assert_allclose(
        hpa - read(calm, "WX2", "pressure_hpa")[1], 0.4 * np.sin(2 * np.pi * seconds / 1200.0), atol=1e-12
    )
    seconds = np.array([s.seconds for s in made.shots if s.target != "ZRG"])
    per_hpa = group_refractivity_ppm(11.0, 930.0, 70.0) / 930.0  # 0.29 ppm
    expected = per_hpa * 0.4 * np.sin(2 * np.pi * seconds / 1200.0)
    np.testing.assert_allclose(ppm(made) - ppm(calm), expected, atol=2e-3)


def test_eddies_have_their_rms_fade_with_distance_and_time_and_ride_on_the_wind():
    rng = np.random.default_rng(1)
    points, seconds = rng.uniform(-3000.0, 3000.0, (4000, 3)), rng.uniform(0.0, 1e5, 4000)
    wind = np.array([3.0, -1.0, 0.0])
    apart, later = np.zeros(4), np.zeros(3)
    for seed in range(16):
        eddies = Turbulence(0.1, 60.0, wind_m_s=(3.0, -1.0), seed=seed)
        here = eddies.temperature_c(points, seconds)
        assert here.std() == pytest.approx(0.1, rel=0.05)  # 4000 places
        steps = [eddies.temperature_c(points + np.array([d, 0.0, 0.0]), seconds) for d in (1.0, 5.0, 15.0, 120.0)]
        waits = [eddies.temperature_c(points, seconds + t) for t in (1.0, 5.0, 40.0)]
        apart += [np.mean(here * there) / 0.01 / 16 for there in steps]
        later += [np.mean(here * then) / 0.01 / 16 for then in waits]
    assert 0.9 < apart[0] < 1.0
    assert apart[0] > apart[1] + 0.1 > apart[2] + 0.2 > apart[3] + 0.3
    assert abs(apart[3]) < 0.1  # two outer scales away
    assert later[0] > later[1] + 0.1 > later[2] + 0.2
    assert abs(later[2]) < 0.1
    carried = points + 25.0 * wind
    np.testing.assert_allclose(eddies.temperature_c(carried, seconds + 25.0), here, atol=1e-10)


def test_eddies_have_a_spectrum_of_minus_five_thirds():
    """Structure functions of many fields: 2^(2/3) from a distance to its double, well inside the scales."""
    rng, d = np.random.default_rng(2), np.array([1.0, 0.0, 0.0])
    squares = np.zeros(2)
    for seed in range(60):
        eddies = Turbulence(1.0, 400.0, seed=seed)
        points = rng.uniform(-2000.0, 2000.0, (400, 3))
        for k, by in enumerate((10.0, 20.0)):
            step = eddies.temperature_c(points + by * d, 0.0) - eddies.temperature_c(points, 0.0)
            squares[k] += np.mean(step**2)
    assert squares[1] / squares[0] == pytest.approx(2.0 ** (2.0 / 3.0), rel=0.08)  # 60 fields; ends of the band


def test_a_path_through_eddies_is_their_mean_along_it():
    eddies = Turbulence(0.15, 30.0, wind_m_s=(4.0, 3.0), seed=1)
    air, seconds = NaturalAir(NIGHT, 1.0, Nature(turbulence=eddies)), np.array([777.0])
    on = RIM + (LOW - RIM) * ((np.arange(20_000) + 0.5) / 20_000)[:, None]
    fine = air.index_at(on, 777.0).mean()
    assert air.path_index(RIM, LOW[None], seconds)[0] == pytest.approx(fine, abs=1e-11)  # 1 nm in 100 m
    assert eddies.mean_c(RIM, LOW, 777.0) == pytest.approx(eddies.temperature_c(on, 777.0).mean(), abs=1e-7)


def test_warming_adds_no_vapour():
    warm = Nature(waves=(AirWave(2.0, 4000.0),))
    t, _, h = NaturalAir(NIGHT, 1.0, warm).weather_at(np.zeros(3), 1000.0)
    t0, _, h0 = TrueAir(NIGHT).weather_at(np.zeros(3), 1000.0)
    es = [6.112 * np.exp(17.62 * c / (243.12 + c)) for c in (t0, t)]
    assert h * es[1] == pytest.approx(h0 * es[0], rel=1e-12)


def test_a_lag_is_of_first_order():
    seconds = np.linspace(0.0, 4000.0, 57)
    ramp = lagged(lambda t: 2.0 - 1e-3 * t, seconds, time_constant_s=90.0, step_s=10.0)
    np.testing.assert_allclose(ramp, 2.0 - 1e-3 * (seconds - 90.0), atol=1e-12)
    wave = lagged(lambda t: np.sin(t / 80.0), seconds, time_constant_s=60.0, step_s=0.25)
    delay, size = np.arctan(60.0 / 80.0), 1.0 / np.hypot(1.0, 60.0 / 80.0)
    np.testing.assert_allclose(wave, size * np.sin(seconds / 80.0 - delay), atol=2e-6)  # (0.25 / 80)^2 / 8 and memory
    step = lagged(lambda t: (t > 1000.0) * 1.0, np.array([1100.0]), time_constant_s=100.0, step_s=0.01)
    assert step[0] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-4)
    assert lagged(np.sin, seconds, time_constant_s=0.0, step_s=1.0) == pytest.approx(np.sin(seconds))


def test_a_lagging_thermometer_follows_the_air_and_the_other_does_not(calm):
    made = small(Nature(stations=StationNature(lags_s={"WX1": 100.0})))
    # the air cools by 0.9 degC an hour: 100 s late is 25 mK too warm, from the first reading on
    np.testing.assert_allclose(read(made, "WX1")[1] - read(calm, "WX1")[1], 0.9 * 100.0 / 3600.0, atol=1e-9)
    np.testing.assert_array_equal(read(made, "WX2")[1], read(calm, "WX2")[1])
    assert np.array_equal(made.frames, calm.frames)
    assert made.truth.thermometer_lags_s == {"WX1": 100.0, "WX2": 0.0}


def test_the_sun_warms_thermometers_by_day_only_and_wind_cools_them(calm):
    warm = StationNature(radiation_c={"WX2": 0.5})
    at_night = small(Nature(stations=warm))
    np.testing.assert_array_equal(read(at_night, "WX2")[1], read(calm, "WX2")[1])
    for wind, share in (((0.0, 0.0), 1.0), ((0.0, 2.0), 0.5)):
        by_day = small(Nature(stations=warm, wind_m_s=wind), start_mjd_utc=NOON)
        error = read(by_day, "WX2")[1] - read(calm, "WX2")[1]
        assert error[6] == pytest.approx(share * 0.5 * np.sin(np.radians(56.47)), abs=1e-4)  # at the start
        np.testing.assert_array_equal(read(by_day, "WX1")[1], read(calm, "WX1")[1])


def test_the_sun_stands_where_the_ephemeris_has_it():
    mjd = np.linspace(52_800.0, 53_200.0, 501)
    altitude, _ = altitude_azimuth(sun_direction(mjd, np.radians(38.433121), np.radians(-79.839835), 807.0))
    np.testing.assert_allclose(sine_of_sun(mjd), np.maximum(np.sin(altitude), 0.0), atol=3e-4)  # 0.015 degree
    assert sine_of_sun(52889.125) == 0.0


def test_readings_have_their_rhythm_their_gaps_and_cover_the_night():
    gap = ReadingGap("WX2", 500.0, 1100.0)
    made = small(Nature(stations=StationNature(interval_s=120.0, gaps=(gap,))))
    first, _ = read(made, "WX1")
    assert set(np.diff(first)) == {120.0}
    assert first[0] == -180.0
    assert first[-1] >= made.shots[-1].seconds + 570.0
    second, _ = read(made, "WX2")
    assert set(first) - set(second) == {540.0, 660.0, 780.0, 900.0, 1020.0}


def test_steel_expands_the_telescope_about_the_pintle_bearing(calm):
    made = small(Nature(expansion=SteelExpansion(share=1.0, lag_s=3600.0)))
    middle = 0.5 * (made.shots[0].seconds + made.shots[-1].seconds)
    assert made.truth.reference_s == middle
    truth = made.truth
    hour = np.array([middle - 1800.0, middle, middle + 1800.0])
    ppm_ = truth.moving.scale(hour) / PPM
    assert ppm_ == pytest.approx([11.7 * 0.45, 0.0, -11.7 * 0.45], rel=1e-6, abs=1e-9)  # a lag moves no even drift
    rim = max((t.name for t in made.telescope.dish), key=lambda n: np.linalg.norm(truth.points[n]))
    moved = truth.moving.at([rim] * 3, hour) - truth.points[rim]
    np.testing.assert_allclose(moved, np.outer(ppm_, truth.points[rim]) * PPM, atol=1e-12)
    assert 0.3e-3 < np.linalg.norm(moved[2] - moved[0]) * 0.5 < 1.2e-3
    for name in ("ZY105", "ZBM02"):
        assert np.array_equal(truth.moving.at([name], hour[:1])[0], truth.points[name])
    for points in (truth.points, calm.truth.points):
        np.testing.assert_array_equal(points[rim], calm.truth.points[rim])
    assert made.weather == calm.weather


def test_each_shot_sees_points_where_they_are_at_its_time(calm):
    made = small(Nature(expansion=SteelExpansion(share=1.0, lag_s=3600.0, dish_share=-0.2)))
    for i in range(0, len(made.shots), 7):
        shot = made.shots[i]
        if shot.target != "ZRG":
            a, b = made.truth.moving.at([shot.ranger, shot.target], np.full(2, shot.seconds))
            assert made.truth.shot_ranges[str(i + 1)] == pytest.approx(np.linalg.norm(a - b), abs=1e-12)
    changed = np.array(list(made.truth.shot_ranges.values())) - np.array(list(calm.truth.shot_ranges.values()))
    assert 0.1e-3 < np.abs(changed).max() < 1.5e-3


def test_what_the_alidade_carries_moves_with_its_own_share_and_the_alidade_does_not():
    """A tenth more of 47 m of steel: dish and arm move alike, away from the pintle bearing."""
    shares = [small(Nature(expansion=SteelExpansion(1.0, 3600.0, alidade_share=share))) for share in (0.0, 0.1)]
    plain, more = (night.truth.moving for night in shares)
    late = np.array([plain.reference_s + 1800.0])
    expected = 0.1 * float(plain.scale(late)[0]) * plain.dish_middle
    for name in ("ZY114", "DP020", "TR03-L"):
        np.testing.assert_allclose((more.at([name], late) - plain.at([name], late))[0], expected, atol=1e-12)
    assert np.array_equal(plain.at(["ZAG731D"], late), more.at(["ZAG731D"], late))


def test_the_dish_expands_by_its_own_share_about_its_middle():
    shares = {share: small(Nature(expansion=SteelExpansion(1.0, 3600.0, share))) for share in (0.0, 0.2)}
    plain, more = shares[0.0].truth.moving, shares[0.2].truth.moving
    late = np.array([plain.reference_s + 1800.0])
    arm, prism, triplet = "ZY114", "DP020", "TR03-L"
    assert np.array_equal(plain.at([arm], late), more.at([arm], late))
    for name in (prism, triplet):
        own = (more.at([name], late) - plain.at([name], late))[0]
        expected = 0.2 * float(plain.scale(late)[0]) * (plain.points[name] - plain.dish_middle)
        np.testing.assert_allclose(own, expected, atol=1e-12)
    dish = np.array([t.point for t in shares[0.0].telescope.dish])
    assert np.linalg.norm(dish.mean(axis=0) - plain.dish_middle) < 6.0  # of a radius of 50 m; 20 prisms


def test_the_arm_expands_by_its_own_share_away_from_the_dish():
    shares = {share: small(Nature(expansion=SteelExpansion(1.0, 3600.0, 0.1, share))) for share in (0.0, -0.1)}
    plain, less = shares[0.0].truth.moving, shares[-0.1].truth.moving
    late = np.array([plain.reference_s + 1800.0])
    for name in ("DP020", "TR03-L"):
        assert np.array_equal(plain.at([name], late), less.at([name], late))
    own = (less.at(["ZY114"], late) - plain.at(["ZY114"], late))[0]
    expected = -0.1 * float(plain.scale(late)[0]) * (plain.points["ZY114"] - plain.dish_middle)
    np.testing.assert_allclose(own, expected, atol=1e-12)


def test_steel_follows_waves_late_and_less():
    made = small(Nature(waves=(AirWave(0.3, 3600.0),), expansion=SteelExpansion(1.0, 3600.0)))
    t = np.arange(0.0, 3600.0, 60.0)
    swing = made.truth.moving.scale(t) / 11.7e-6 + 0.9 * t / 3600.0
    # 2 pi of a radian late: amplitude 0.3 / sqrt(1 + 4 pi^2)
    assert np.ptp(swing) == pytest.approx(2.0 * 0.3 / np.sqrt(1.0 + 4.0 * np.pi**2), rel=0.01)


def glass(seed, strength):
    """A telescope of 230 prisms and 4 triplets, and the errors of its heights by batches, m: dish, left prisms."""
    streams, planted = Streams(seed), Planted()
    pose = posture(145.3, 30.0, streams, planted=planted)
    made = structure(pose, dish_count=230, triplet_count=4, streams=streams, faults=Faults(), planted=planted)
    ground = in_batches(made, strength, streams, planted)
    lots = zip(made.dish, ground.dish, strict=True), zip(made.triplets, ground.triplets, strict=True)
    assert [t.sizes_mm for t in ground.dish] == [t.sizes_mm for t in made.dish]
    return np.array([b.sizes[0] - a.sizes[0] for a, b in lots[0]]), np.array(
        [b.targets[0].sizes[0] - a.targets[0].sizes[0] for a, b in lots[1]]
    )


def test_heights_of_a_batch_err_together():
    dish, left = glass(9, 1.0)
    for batch in (dish[:100], dish[100:200], dish[200:], left):
        assert np.ptp(batch) < 1e-15
    assert len({round(float(v), 12) for v in (*dish, *left)}) == 4
    assert not np.any(glass(9, 0.0)[0])
    common = [glass(seed, 1.0)[0][::100] for seed in range(12)]
    assert np.sqrt(np.mean(np.square(common))) == pytest.approx(2e-6, rel=0.36)  # 36 draws: 12 %, three sigmas


def test_a_night_takes_its_batches_from_its_nature(calm):
    made = small(Nature(batch_heights=1.0))
    common = [b.sizes[0] - a.sizes[0] for a, b in zip(calm.telescope.dish, made.telescope.dish, strict=True)]
    assert common[0] == pytest.approx(glass(5, 1.0)[0][0], abs=1e-15)
    changed = {s.target[:2] for s, a, b in zip(made.shots, made.frames, calm.frames, strict=True) if np.any(a != b)}
    assert changed == {"DP", "TR"}


def test_lines_to_near_ends_share_their_air():
    """Over 2000 draws: variance 1, and share exp(-3 m / 5 m) between ends 3 m apart; two per cent by chance."""
    rng, ends = np.random.default_rng(8), np.array([[0.0, 0.0, 50.0], [3.0, 0.0, 50.0], [60.0, 0.0, 50.0]])
    own = (dict(zip("abc", rng.normal(size=3), strict=True)) for _ in range(2000))
    drawn = [list(neighbouring_residuals(each, ends, rng=rng, share=0.7).values()) for each in own]
    covariance = np.cov(np.array(drawn).T)
    np.testing.assert_allclose(np.diag(covariance), 1.0, atol=0.1)
    np.testing.assert_allclose(covariance[0, 1:], [0.7 * np.exp(-0.6), 0.0], atol=0.08)


def test_a_night_takes_its_neighbours_from_its_nature():
    plain, made = (small(nature, planted=Planted()) for nature in (Nature(batch_heights=1e-9), Nature(neighbours=1.0)))
    changed = {s.target for s, a, b in zip(made.shots, made.frames, plain.frames, strict=True) if np.any(a != b)}
    assert REFERENCE not in changed
    assert len(changed) > 0.9 * len({s.target for s in made.shots})  # a blocked shot has no line


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Nature.drawn(1, -0.5), r"strength of nature = -0.5 \(expected 0 to 10\)"),
        (lambda: Nature.drawn(1, float("nan")), "strength of nature = nan"),
        (lambda: AirWave(0.3, 0.0), r"period_s of a wave = 0 \(expected 1 to 1e\+06\)"),
        (lambda: AirWave(40.0, 600.0), "amplitude_c of a wave = 40"),
        (lambda: Front(1.0, 0.0, rise_s=-3.0), "rise_s of a front = -3"),
        (lambda: Turbulence(-0.1), "rms_c of turbulence = -0.1"),
        (lambda: Turbulence(0.1, 3.0), "outer_scale_m of turbulence = 3"),
        (lambda: HorizontalGradient((0.5, 0.0)), "a horizontal gradient in degC/m = 0.5"),
        (lambda: StationNature(lags_s={"WX1": -1.0}), "lags_s of WX1 = -1"),
        (lambda: StationNature(interval_s=0.0), "interval_s of readings = 0"),
        (lambda: ReadingGap("WX1", 100.0, 50.0), "end_s - start_s of a gap of WX1 = -50"),
        (lambda: SteelExpansion(lag_s=0.0), "lag_s of the steel = 0"),
        (lambda: Nature(batch_heights=-1.0), "batch_heights = -1"),
        (lambda: Nature(neighbours=1.5), "neighbours = 1.5"),
    ],
)
def test_invalid_values_are_refused_in_one_line(make, message):
    with pytest.raises(ValidityError, match=message) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_an_unknown_station_is_refused():
    with pytest.raises(InputError, match="'WX9' of a nature"):
        StationNature(lags_s={"WX9": 30.0})
