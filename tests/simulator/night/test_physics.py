"""The twin against formulas that it does not use: those of the README and of the notes, worked out here by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from catseye.constants import PPM, SPEED_OF_LIGHT
from catseye.simulator.night.air import NIGHT, SUMMER_DAY, WINTER, TrueAir, group_refractivity_ppm
from catseye.simulator.night.faults import EFFECTS, Faults, Planted, Streams
from catseye.simulator.night.glass import GLASS_TO_AIR, prism_delay
from catseye.simulator.night.head import electronic_phase
from catseye.simulator.night.paraboloid import normal_deviation
from catseye.simulator.night.posture import TruePosture
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from catseye.simulator.night.world import kelvin_from_ground

HALF_WAVE = SPEED_OF_LIGHT / 2 / 1.5e9  # in vacuum, m
PER_RADIAN = HALF_WAVE / (2 * np.pi)
N = GLASS_TO_AIR


def phasors(night):
    """(2/mn)(a + i b) of every frame, less the true leakage of its ranger."""
    j = np.arange(8192)
    turn = np.exp(2j * np.pi * j / 64)
    raw = (night.frames @ turn) * (2 / 8192) * (10 / 32768)
    return raw - np.array([night.truth.leakage[s.ranger] for s in night.shots])


def measured_minus_true(night):
    """Range of each shot from its phase and the reference shots around it, minus the truth; m, nan for references."""
    z, truth = phasors(night), night.truth
    found = np.full(len(night.shots), np.nan)
    for ranger in night.heads:
        mine = [i for i, s in enumerate(night.shots) if s.ranger == ranger]
        refs = [i for i in mine if night.shots[i].target == "ZRG"]
        seconds = np.array([s.seconds for s in night.shots])
        phase_0 = np.interp(seconds, seconds[refs], np.unwrap(np.angle(z[refs])))
        for i in set(mine) - set(refs):
            n = 1 + PPM * truth.path_refractivity_ppm[str(i + 1)]
            wave = n * (truth.shot_ranges[str(i + 1)] - truth.d0[ranger] + glass(night, i))
            miss = -(np.angle(z[i]) - phase_0[i]) * PER_RADIAN - wave
            found[i] = (miss + HALF_WAVE / 2) % HALF_WAVE - HALF_WAVE / 2
    return found


def glass(night, i):
    """-(Pc + dPc) of the README, m."""
    shot, truth = night.shots[i], night.truth
    target = {t.name: t for t in (*night.telescope.targets.values(), *night.single_targets)}[shot.target]
    if target.kind.name == "hollow":
        return 0.0
    if target.kind.name == "ball":
        r1, r2 = target.sizes
        return N * (r1 + r2) - r1
    away = truth.points[shot.ranger] - truth.points[shot.target]
    cosine = away @ truth.normals[shot.target] / np.linalg.norm(away)
    sine2, h = 1 - cosine**2, target.sizes[0]
    d_pc = N * h * (1 - np.sqrt(1 - sine2 / N**2)) - h / N * (1 - cosine)
    return (N - 1 / N) * h - d_pc


def test_the_readme_recovers_every_range_of_a_still_night_to_the_noise(still_night):
    miss = measured_minus_true(still_night)
    ranged = ~np.isnan(miss)
    # White noise of at most 0.245 V over 8192 samples, target and two references at 6.5 V; the index of the path
    # instead of the one at the ends matters 5e-6 x 0.17 m, far below.
    amplitude = np.abs(phasors(still_night))[ranged]
    u = 0.205 * np.sqrt(2 / 8192) * np.sqrt(1 / amplitude**2 + 0.7 / 6.5**2) * PER_RADIAN
    normalised = miss[ranged] / u
    assert 0.85 < normalised.std() < 1.15  # heads draw 0.165 to 0.245 V around 0.205 V
    assert np.abs(normalised).max() < 5.5
    assert abs(normalised.mean()) < 0.2


@pytest.mark.parametrize("kind", ["hollow", "prism", "ball"])
def test_each_kind_of_glass_is_unbiased(still_night, kind):
    miss = measured_minus_true(still_night)
    kinds = {t.name: t.kind.name for t in (*still_night.telescope.targets.values(), *still_night.single_targets)}
    strong = [
        miss[i]
        for i, s in enumerate(still_night.shots)
        if s.target != "ZRG" and s.ranger != "ZY116" and kinds[s.target] == kind
    ]
    assert abs(np.mean(strong)) < 4 * np.std(strong) / np.sqrt(len(strong))
    assert np.std(strong) < 30e-6  # 0.2 V of noise on 2 V of a ball: 25 um


def test_on_an_ordinary_night_drift_adds_tens_of_micrometres(night):
    miss = measured_minus_true(night)
    good = np.array([night.truth.shot_status[str(i + 1)] == "good" for i in range(len(miss))]) & ~np.isnan(miss)
    # Half a minute from a reference: 0.010 rad x sqrt(60/3600) is 1.3 mrad, 20 um, and 12 to 60 um of noise.
    assert 10e-6 < np.std(miss[good]) < 80e-6
    assert np.abs(miss[good]).max() < 0.5e-3


def test_the_amplitudes_noise_and_offsets_are_those_of_night_01(night):
    volts = night.frames.astype(float) * 10 / 32768
    offset = volts.mean(axis=1)
    assert np.abs(offset).max() < 0.26
    cycles = volts.reshape(len(volts), 128, 64) @ np.exp(2j * np.pi * np.arange(64) / 64) * 2 / 64
    scatter = cycles.std(axis=1)  # complex standard deviation
    assert scatter.min() > 0.033
    assert scatter.max() < 0.078
    assert 0.045 < np.median(scatter) < 0.065  # night-01: 0.055 V
    z = np.abs(phasors(night))
    status = night.truth.shot_status
    for i, shot in enumerate(night.shots):
        if shot.target == "ZRG":
            assert 6.4 < z[i] < 6.6
        elif status[str(i + 1)] == "blocked":
            assert z[i] < 0.02
        elif status[str(i + 1)] == "good":
            assert (0.6 < z[i] < 1.4) if shot.ranger == "ZY116" else (1.9 < z[i] < 6.7)


def test_a_foreign_return_is_wrong_by_at_least_a_millimetre_and_below_half_a_wave():
    night = simulate_night(13, faults=Faults(fraction_blocked=0.0, fraction_reflected=0.3))
    bad = [i for i, s in enumerate(night.shots) if night.truth.shot_status[str(i + 1)] == "reflected"]
    assert len(bad) > 150
    planted = np.array([night.truth.shot_phase_errors[str(i + 1)] for i in bad]) * PER_RADIAN
    assert np.abs(planted).min() > 0.99e-3  # 1 mm, in vacuum
    assert np.abs(planted).max() < HALF_WAVE / 2
    seen = measured_minus_true(night)[bad]
    # Weak returns of the weak ranger: 0.5 mrad x 6.5 / 0.4 V; drift as above.
    np.testing.assert_allclose(seen, -planted, atol=0.6e-3)
    assert night.shots[bad[0]].target != "ZRG"


@pytest.mark.parametrize(("height", "degrees"), [(0.038, 0.0), (0.0382, 12.0), (0.0384, 36.0), (0.037, 75.0)])
def test_the_traced_prism_agrees_with_the_closed_form_of_the_readme(height, degrees):
    angle = np.radians(degrees)
    towards = np.array([np.sin(angle), 0.0, np.cos(angle)])
    closed = (N - 1 / N) * height - (
        N * height * (1 - np.sqrt(1 - (np.sin(angle) / N) ** 2)) - height / N * (1 - np.cos(angle))
    )
    assert prism_delay(np.asarray(height), np.array([0.0, 0.0, 1.0]), towards) == pytest.approx(closed, abs=1e-15)


def gamma_of_the_notes(alpha):
    """[PARKER04] eq. 2.4, the product of its four matrices."""
    a1, a2, a3 = alpha
    ry = [[np.cos(a1), 0, -np.sin(a1)], [0, 1, 0], [np.sin(a1), 0, np.cos(a1)]]
    rz = [[np.cos(a2), np.sin(a2), 0], [-np.sin(a2), np.cos(a2), 0], [0, 0, 1]]
    rx = [[1, 0, 0], [0, np.cos(a3), np.sin(a3)], [0, -np.sin(a3), np.cos(a3)]]
    return np.array(rx) @ rz @ ry @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


def test_the_monument_matrix_is_the_product_of_the_four_of_the_notes():
    alpha = np.array([-1.197, 0.0121, -0.0043])
    np.testing.assert_allclose(kelvin_from_ground(alpha), gamma_of_the_notes(alpha), atol=1e-15)


def test_the_scan_point_stands_a_quarter_of_a_metre_above_the_fixed_point(night):
    for ranger, fixed in night.truth.fixed_points.items():
        up = night.truth.points[ranger] - fixed
        alpha, offset = night.monuments[ranger].alpha_rad, night.truth.mirror_offsets[ranger]
        np.testing.assert_allclose(gamma_of_the_notes(alpha) @ up, offset, atol=1e-12)
        assert up[2] == pytest.approx(offset[1], abs=1e-5)  # tilts of 0.2 mrad on some mm
        inward = -fixed[:2] / np.linalg.norm(fixed[:2])  # z^ points at the pintle bearing
        assert up[:2] @ inward == pytest.approx(offset[2], abs=2e-4)  # 0.25 m tilted by 0.3 mrad


@pytest.mark.parametrize(
    ("azimuth", "elevation", "z_mm", "ground_mm"),
    [
        (0, 90, 0, (0, -54839.108, 53259.990)),
        (0, 90, 60000, (0, -54839.108, 113259.990)),
        (90, 45, 0, (-35241.578, 0, 90572.632)),
        (90, 45, 60000, (7184.829, 0, 132999.039)),
    ],
)
def test_the_nominal_posture_puts_vertex_and_focus_where_the_site_says(azimuth, elevation, z_mm, ground_mm):
    pose = TruePosture(azimuth, elevation)
    at = np.array([0.0, 0.0, z_mm / 1000])
    np.testing.assert_allclose(pose.nominal(at) * 1000, ground_mm, atol=6e-4)  # printed to the micrometre
    np.testing.assert_allclose(pose.reflector_from_nominal(pose.nominal(at)), at, atol=1e-12)
    np.testing.assert_allclose(pose.arm(at), pose.nominal(at), atol=1e-12)


def test_the_air_has_the_sensitivities_that_the_notes_print():
    # [PARKER04] eqs. 1.49 to 1.52, at 20 degrees, 933 hPa, 50 %; recomputed digits of facts/numbers-and-errata.md.
    assert group_refractivity_ppm(20.0, 933.0, 50.0) == pytest.approx(253.246815, abs=1e-6)
    slope = approx_fprime(np.array([20.0, 933.0, 50.0]), lambda x: group_refractivity_ppm(*x), 1e-5)
    np.testing.assert_allclose(slope, (-0.895887, 0.272048, -0.0096058), rtol=1e-4)


@pytest.mark.parametrize("conditions", [NIGHT, SUMMER_DAY, WINTER])
def test_the_path_index_is_the_mean_of_the_index_along_the_path(conditions):
    air = TrueAir(conditions)
    start, end = np.array([110.0, 40.0, 0.3]), np.array([10.0, 20.0, 110.0])
    share = (np.arange(20000) + 0.5) / 20000
    dense = air.index(start[2] + share * (end - start)[2], 900.0).mean()
    assert air.path_index(start, end, 900.0) == pytest.approx(dense, abs=1e-12)


def test_the_stations_read_the_air_with_their_offsets(night):
    for station, z in (("WX1", 803.800 - 806.42), ("WX2", 850.150 - 806.42)):
        mine = [w for w in night.weather if w.station == station]
        off = np.array([w.temperature_c - night.truth.air.temperature_c(z, w.seconds) for w in mine])
        n = np.sqrt(len(mine))
        assert off.mean() == pytest.approx(night.truth.thermometer_offsets_c[station], abs=4 * 0.05 / n)
        assert off.std() == pytest.approx(0.05, rel=0.3)
        pressure = np.array([w.pressure_hpa - night.truth.air.pressure_hpa(z, w.seconds) for w in mine])
        assert abs(pressure.mean()) < 4 * 0.05 / n
    low, high = (np.mean([w.pressure_hpa for w in night.weather if w.station == s]) for s in ("WX1", "WX2"))
    assert low - high == pytest.approx(0.11 * 46.35, abs=0.05)


def test_sheets_differ_from_the_truth_by_their_uncertainties_over_many_sites():
    scatter = {"d0": [], "fixed": [], "certificate": [], "height": [], "lateral": [], "d12": [], "h_corr": []}
    for seed in range(8):
        night = simulate_night(100 + seed, telescope=SimulatedTelescope(dish_prisms=12))
        points = night.truth.points
        for h in night.heads.values():
            scatter["d0"].append((h.true_d0 * 1e3 - h.d0_mm) / 0.010)
        for m in night.monuments.values():
            scatter["fixed"] += [*((m.true_fixed_point * 1e3 - m.fixed_point_mm) / 0.1)[:2]]
        for b in night.benchmarks:
            length = np.linalg.norm(points[b.name] - points[b.ranger]) * 1e3
            scatter["certificate"].append((b.certified_mm - length) / 0.020)
        for unit in night.telescope.triplets:
            left, right, ball = (points[t.name] for t in unit.targets)
            n, d = night.truth.normals[unit.targets[0].name], right - left
            off = ball - (left + right) / 2
            scatter["d12"].append((np.linalg.norm(d) * 1e3 - unit.d12_mm) / 0.030)
            scatter["h_corr"].append((off @ n * 1e3 - unit.h_corr_mm) / 0.020)
            scatter["lateral"] += [
                off @ d / np.linalg.norm(d) / 40e-6,
                off @ np.cross(n, d / np.linalg.norm(d)) / 40e-6,
            ]
            scatter["height"] += [(t.sizes[0] * 1e3 - t.sizes_mm[0]) / 0.002 for t in unit.targets[:2]]
    for name, normalised in scatter.items():
        many = np.sqrt(2 * len(normalised))
        assert abs(np.std(normalised) - 1) < 4 / many, name
        assert abs(np.mean(normalised)) < 6 / many, name


def test_every_ball_is_shot_from_below_and_within_its_acceptance(night):
    truth = night.truth
    for shot in night.shots:
        if shot.target.endswith("-B"):
            away = truth.points[shot.ranger] - truth.points[shot.target]
            angle = np.degrees(np.arccos(away @ truth.normals[shot.target] / np.linalg.norm(away)))
            assert angle < 80
            assert away[2] < 0


def test_the_dish_is_rough_by_a_third_of_a_millimetre_and_the_fit_is_the_best(night):
    paraboloid, pose = night.truth.paraboloid, night.truth.posture
    residual = np.array(list(paraboloid.deviations.values()))
    assert 0.15e-3 < residual.std() < 0.31e-3
    points = np.array([night.truth.points[n] for n in paraboloid.deviations])
    np.testing.assert_allclose(np.linalg.norm(paraboloid.axis), 1, atol=1e-14)
    np.testing.assert_allclose(paraboloid.focus, paraboloid.vertex + 60 * paraboloid.axis, atol=1e-12)

    def cost(vertex, axis):
        x = np.cross([0.0, 0.0, 1.0], axis)
        frame = np.array([x / np.linalg.norm(x), np.cross(axis, x / np.linalg.norm(x)), axis])
        return np.sum(normal_deviation((points - vertex) @ frame.T) ** 2)

    best = cost(paraboloid.vertex, paraboloid.axis)
    assert best == pytest.approx(np.sum(residual**2), rel=1e-9)
    for k in range(3):
        step = np.eye(3)[k]
        for sign in (-1, 1):
            assert cost(paraboloid.vertex + sign * 20e-6 * step, paraboloid.axis) > best
            turned = paraboloid.axis + sign * 1e-6 * step
            assert cost(paraboloid.vertex, turned / np.linalg.norm(turned)) > best
    nominal = pose.nominal(np.zeros(3))
    assert np.linalg.norm(paraboloid.vertex - nominal) < 0.08  # some mm and tens of arc seconds at 75 m


def test_a_perfect_dish_is_found_exactly_where_the_posture_put_it():
    night = simulate_night(14, planted=Planted(ignore=["surface"]))
    paraboloid, pose = night.truth.paraboloid, night.truth.posture
    assert max(map(abs, paraboloid.deviations.values())) < 1e-10
    np.testing.assert_allclose(paraboloid.vertex, pose.dish(np.zeros(3)), atol=1e-8)
    np.testing.assert_allclose(paraboloid.focus, pose.dish(np.array([0.0, 0.0, 60.0])), atol=1e-8)


def test_a_head_that_warms_up_comes_nearer_to_its_rest_by_e_in_five_minutes():
    seconds = np.array([0.0, 300.0, 600.0, 3.6e4])
    alone = Planted(ignore=[effect for effect in EFFECTS if effect != "warm_up"])
    phases = [electronic_phase(SimpleNamespace(ranger=f"ZY{n}"), seconds, Streams(3), planted=alone) for n in range(60)]
    rises = np.array([phase - phase[-1] for phase in phases])
    warm = np.abs(rises[:, 0]) > 1e-9
    assert 10 <= warm.sum() <= 30  # every third of 60
    assert np.all((np.abs(rises[warm, 0]) > 0.010) & (np.abs(rises[warm, 0]) < 0.030))
    np.testing.assert_allclose(rises[warm, 1:3] / rises[warm, :1], [[np.exp(-1.0), np.exp(-2.0)]] * warm.sum())
    np.testing.assert_allclose(rises[~warm], 0.0, atol=1e-12)
