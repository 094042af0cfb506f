"""The telescope in motion: the notes' checks of 2.44, and the size and direction of everything that bends it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.simulator.twin.conditions import LIVING_NIGHT, STILL, LivingConditions
from catseye.simulator.twin.telescope import ARM_FOOT, ARM_LENGTH, low_orders, turning
from simulator.living_scene import only, rms, twin

TIP = ARM_FOOT + np.array([0.0, 0.0, ARM_LENGTH])
HOUR = np.arange(0.0, 3600.0, 0.25)


def ground(made, body, rest, seconds):
    """A rest point of a body at times (k, 3)."""
    turn, shift = made.standing(seconds).bodies[body]
    return turn @ np.asarray(rest, dtype=float) + shift


def tip_on_dish(made, seconds):
    """The arm's tip as an observer who rides on the dish sees it, less where it rests (k, 3)."""
    turn, shift = made.standing(seconds).bodies["dish"]
    return np.einsum("kji,kj->ki", turn, ground(made, "arm", TIP, seconds) - shift) - TIP


@pytest.mark.parametrize(
    ("motion", "vertex_mm", "focus_mm"),
    [
        ("fixed 0 90", (0, -54839.108, 53259.990), (0, -54839.108, 113259.990)),
        ("fixed 90 45", (-35241.578, 0, 90572.632), (7184.829, 0, 132999.039)),
    ],
)
def test_vertex_and_focus_stand_where_the_notes_say(motion, vertex_mm, focus_mm):
    made = twin(motion, planted=STILL)
    for body in ("dish", "arm"):
        assert ground(made, body, [0, 0, 0], [0.0])[0] * 1e3 == pytest.approx(vertex_mm, abs=6e-4)  # printed digits
        assert ground(made, body, [0, 0, 60.0], [0.0])[0] * 1e3 == pytest.approx(focus_mm, abs=6e-4)


def test_without_bending_it_is_the_rigid_telescope_of_the_reduction():
    made = twin("track 200 35", planted=STILL)
    points = np.random.default_rng(1).normal(0.0, 40.0, (9, 3))
    for t in (0.0, 1234.5):
        a, e, _, _ = (v[0] for v in made.posture(t))
        expected = ground_from_reflector(a, e).points(points)
        found = [ground(made, "dish", p, [t])[0] for p in points]
        assert np.abs(found - expected).max() < 1e-11  # rounding of 100 m


def test_turning_is_rodrigues_formula():
    vectors = np.concatenate([np.random.default_rng(2).normal(size=(9, 3)), np.zeros((1, 3)), [[1e-9, 0.0, 0.0]]])
    assert turning(vectors) == pytest.approx(Rotation.from_rotvec(vectors).as_matrix(), abs=1e-14)


def test_low_orders_have_rms_one_over_the_aperture_and_do_not_mix():
    rng = np.random.default_rng(3)
    xy = rng.uniform(-1, 1, (400_000, 2))
    shapes = low_orders(xy[np.hypot(*xy.T) < 1], np.zeros(2), 1.0)
    # a mean over 310 000 points is good to some 0.5 %
    assert shapes.T @ shapes / len(shapes) == pytest.approx(np.eye(6), abs=0.02)


def test_encoders_err_by_arc_seconds_and_rates_match_their_angles():
    true, told = twin("slew 0 10 300 80", planted=STILL), twin("slew 0 10 300 80", planted=only("encoder"))
    t = np.linspace(0.0, 500.0, 20_001)
    for axis in (0, 1):
        error = told.posture(t)[axis] - true.posture(t)[axis]
        assert 0.3 * ARCSECOND < rms(error) < 15 * ARCSECOND
        rate = np.gradient(told.posture(t)[axis], t)
        assert np.abs(rate - told.posture(t)[axis + 2])[2:-2].max() < 5e-5  # half of 0.2 deg/s^2 for 25 ms at corners
        steady = (t > 10) & (t < 200)
        assert np.abs(rate - told.posture(t)[axis + 2])[steady].max() < 1e-9
    truly = told.standing(t).bodies["dish"].turn
    assert truly == pytest.approx(true.standing(t).bodies["dish"].turn, abs=0)


def test_the_arm_sags_towards_the_dish_as_the_elevation_falls():
    high, low = (tip_on_dish(twin(f"fixed 0 {e}", planted=only("gravity")), [0.0])[0] for e in (80, 10))
    expected = 0.012 * (np.cos(10 * DEGREE) - np.cos(80 * DEGREE))  # 9.7 mm
    assert low - high == pytest.approx([0, expected, 0], abs=2e-6)  # a turn about the foot shortens by 1 um
    at_rest = tip_on_dish(twin("fixed 200 30", planted=only("gravity")), [0.0])[0]  # the site's elevation
    assert at_rest == pytest.approx(np.zeros(3), abs=1e-12)


def test_gravity_bends_the_dish_by_a_millimetre_and_not_at_the_site_s_elevation():
    bent = [
        rms(twin(f"fixed 0 {e}", planted=only("gravity"), seed=s).standing(0.0).orders)
        for e in (10, 85)
        for s in range(5)
    ]
    assert 0.05e-3 < np.mean(bent) < 0.5e-3  # six of them
    assert rms(twin("fixed 0 30", planted=only("gravity")).standing(0.0).orders) < 1e-15


def test_prisms_of_the_dish_move_along_its_normals_by_the_low_orders():
    made = twin("fixed 0 80", planted=only("gravity"))
    standing, surface, retro = made.standing(0.0), made.scene._surface, made.scene.retros["DP20P10"]
    turn, shift = standing.bodies["dish"]
    moved = turn[0].T @ (made.point("DP20P10", 0.0)[0] - shift[0]) - retro.rest_place
    xy = retro.rest_place[None, :2]
    expected = (low_orders(xy, surface.centre, surface.radius) @ standing.orders[0])[0] * surface.up(xy)[0]
    assert moved == pytest.approx(expected, abs=1e-11)
    assert np.linalg.norm(expected) > 20e-6


def test_the_arm_vibrates_at_its_modes_and_the_dish_does_not():
    made = twin(planted=only("vibration"))
    t = np.arange(0.0, 1600.0, 0.1)
    tip = tip_on_dish(made, t)
    power = np.sum(np.abs(np.fft.rfft(tip * np.hanning(len(t))[:, None], axis=0)) ** 2, axis=1)
    hertz = np.fft.rfftfreq(len(t), 0.1)
    in_mode = np.min(np.abs(hertz[:, None] / [0.8, 1.2, 2.4] - 1), axis=1) < 0.02
    assert power[in_mode].sum() > 0.999 * power.sum()
    assert 20e-6 < rms(tip[:, :2]) < 150e-6
    assert np.ptp(ground(made, "dish", [0, 50, 10], t), axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    strength = [rms(part) for part in np.array_split(tip[:, 0], 40)]
    assert max(strength) > 1.5 * min(strength)  # it breathes


@pytest.mark.parametrize(("wind_m_s", "expected"), [(5.0, 0.3e-3), (10.0, 1.2e-3)])
def test_wind_moves_the_tip_with_the_square_of_its_speed(wind_m_s, expected):
    conditions = LivingConditions(wind_m_s=wind_m_s)
    found = [
        rms(tip_on_dish(twin(planted=only("wind"), conditions=conditions, seed=s), HOUR[::5])[:, :2]) for s in range(12)
    ]
    # eight waves of normal amplitudes: one seed's power is good to 35 %, twelve seeds of two directions to 7 %
    assert rms(found) == pytest.approx(expected, rel=0.2)


def test_warm_steel_lifts_the_elevation_axis_by_a_third_of_a_millimetre_a_degree():
    made = twin("fixed 145.3 30", planted=only("thermal", "diurnal"))
    warmer = made.air.steel_c(np.array([28_800.0]))[0]
    assert abs(warmer) > 2.0
    # the bearings ride on the alidade's tower: the vertex rises by it, apart from what bends
    rise = (
        ground(made, "dish", [0, 54.84, -5.0], [28_800.0])[0, 2] - ground(made, "dish", [0, 54.84, -5.0], [0.0])[0, 2]
    )
    assert rise == pytest.approx(0.3e-3 * warmer, rel=1e-6)
    tip = tip_on_dish(made, [28_800.0])[0]
    assert 0.05e-3 * abs(warmer) < np.linalg.norm(tip) < 1.5e-3 * abs(warmer)
    assert tip == pytest.approx(warmer * made.telescope.steel[1:4], abs=1e-7)  # the turn's second order, 3 mm^2 / 55 m


def test_the_bearing_leans_by_some_arc_seconds():
    leans = []
    for seed in range(8):
        for azimuth in (0, 100):
            made, still = (twin(f"fixed {azimuth} 30", planted=p, seed=seed) for p in (only("bearing_tilt"), STILL))
            turn = made.standing(0.0).bodies["alidade"].turn[0] @ still.standing(0.0).bodies["alidade"].turn[0].T
            leans.append(Rotation.from_matrix(turn).as_rotvec())
    assert np.abs(np.array(leans)[:, 2]).max() < 1e-12  # it leans, it does not turn
    assert 2 * ARCSECOND < rms(np.array(leans)[:, :2]) < 8 * ARCSECOND


def test_what_stays_is_as_large_as_the_generator_of_nights_has_it():
    made, still = twin(planted=only("posture", "feed_arm"), conditions=LIVING_NIGHT), twin(planted=STILL)
    away = ground(made, "dish", [0, 54, 12], [0.0])[0] - ground(still, "dish", [0, 54, 12], [0.0])[0]
    assert 0.2e-3 < np.linalg.norm(away) < 25e-3
    assert 0.2e-3 < np.linalg.norm(tip_on_dish(made, [0.0])[0]) < 25e-3
