"""Calibrations of the mirror in the lab, many times on paper: what they find scatters as they claim, and is right.

Every systematic effect is drawn anew in each run from the prior that the sheet states: an autocollimator that leans, a
v-block that is not level, a shaft that is not square. The tables are traced by `lab_scene`, not by catseye.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.reduction.calibrations.length import height_gauge  # fmt: skip
from catseye.reduction.calibrations.mirror import (  # fmt: skip
    alignment,
    autocollimation,
    both_faces,
    both_faces_pointing,
    detector_focus,
    encoder,
    limits,
    search_results,
)
from lab_scene import (
    ARC,
    BALL,
    MIRROR,
    MONUMENT,
    PER_RADIAN,
    PLUG,
    SETTINGS,
    SIGHTS,
    check_scatter,
    faces,
    heights,
    pointings,
    polygon,
    searches,
    sky,
    spots,
    station_truth,
    table,
    through_focus,
    waves,
)  # fmt: skip
from lab_scene import (
    autocollimation as looks,
)

RUNS = [pytest.param(16, id="quick"), pytest.param(600, id="long", marks=pytest.mark.slow)]


def many(runs, seed, made, recipe, keys, reject=False):
    """Values (n, q) and covariances (n, q, q) of quantities; `made` gives numbers, words, sheet of one run."""
    values, covariances = [], []
    for run in range(runs):
        numbers, words, sheet = made(np.random.default_rng([seed, run]))
        found = recipe.recipe(table(recipe, numbers, words, **sheet), reject)
        at = [[q.key for q in found.quantities].index(key) for key in keys]
        values.append([found.quantities[k].value for k in at])
        covariances.append(found.covariance[np.ix_(at, at)])
    return np.array(values), np.array(covariances)


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("outlier", [False, True])
def test_autocollimation(runs, outlier):
    def made(rng):
        truth = {
            "beta": (-150 * ARC, 25 * ARC), "na0": -4195.3, "ne0": -4935.4, "tilt": 20 * ARC,
            "axis_tilt": 10 * ARC * rng.standard_normal(), "lean": 1.5 * ARC * rng.standard_normal(2),
            "roll": 120 * ARC * rng.standard_normal(), "flat": rng.standard_normal(2) * [1.0 * ARC, 300 * ARC],
        }  # fmt: skip
        numbers, words = looks(truth, rng, settings=(*SETTINGS[::2], *SIGHTS[:4]), u_count=0.05)
        if outlier:
            numbers["x_arcsec"][3] += 40.0
        return numbers, words, {
            "displays": "beam", "na0_nominal": -4190.0, "ne0_nominal": -4930.0, "u_lean_x_arcsec": 1.5,
            "u_lean_y_arcsec": 1.5, "u_roll_arcsec": 120.0, "u_flat_arcsec": 1.0, "u_flat_turn_arcsec": 300.0,
            "u_axis_tilt_arcsec": 10.0, "u_count": 0.05, "u_reading_arcsec": 0.3, "level": 0.001,
        }  # fmt: skip

    keys = ("beta1_rad", "beta2_rad", "ne0", "na0", "face_tilt_rad")
    truth = [-150 * ARC, 25 * ARC, -4935.4, -4195.3, 20 * ARC]
    values, covariances = many(runs, 1, made, autocollimation.RECIPE, keys, reject=outlier)
    check_scatter(values, covariances, truth)


@pytest.mark.parametrize("runs", RUNS)
def test_height_gauge(runs):
    offset = (-0.075, 247.459, -0.762)

    def made(rng):
        lean = {a: 10 * ARC * rng.standard_normal(2) for a in "xyz"}
        return *heights({"offset": offset, "lean": lean}, rng, times=1, seating=1 * ARC), {
            "ball_diameter_mm": BALL + 5e-4 * rng.standard_normal(), "u_ball_diameter_mm": 5e-4,
            "mirror_diameter_mm": PLUG + 1e-3 * rng.standard_normal(), "u_mirror_diameter_mm": 1e-3,
            "u_lean_arcsec": 10.0, "u_seating_arcsec": 1.0, "u_scale_ppm": 0.0, "u_reading_mm": 0.001,
        }  # fmt: skip

    values, covariances = many(runs, 2, made, height_gauge.RECIPE, ("dx_mm", "dy_mm", "dz_mm"))
    check_scatter(values, covariances, offset)


@pytest.mark.parametrize("runs", RUNS)
def test_both_faces(runs):
    def made(rng):
        truth = {
            "offsets": (0.4e-3, -0.3e-3, 0.0, 0.0), "back": 12e-3, "zero": 0.2e-3 * rng.standard_normal(),
            "known": {line: 3e-5 * rng.standard_normal() for line in "ABCD"},
        }  # fmt: skip
        return *faces(truth, rng, times=1), {"u_distance_mm": 0.02, "u_known_distance_mm": 0.03, "u_zero_mm": 0.2}

    values, covariances = many(runs, 3, made, both_faces.RECIPE, ("axis_offset_mm", "mirror_offset_mm"))
    check_scatter(values, covariances, (0.4, -0.3))


@pytest.mark.parametrize("runs", [pytest.param(12, id="quick"), pytest.param(300, id="long", marks=pytest.mark.slow)])
def test_both_faces_pointing(runs):
    targets = sky(count=6)

    def made(rng):
        truth = {
            "na0": 2691.4, "ne0": 1434.7, "tilt": 2e-4, "beam_tilt": (1e-4, -3e-4),
            "offsets": 0.05e-3 * rng.standard_normal(4),
        }  # fmt: skip
        numbers, words = pointings(truth, rng, targets=targets, frame=4 * ARC * rng.standard_normal(2))
        for k in range(len(targets)):  # what is known of a direction is not quite so
            shift = np.degrees(3 * ARC * rng.standard_normal(2)) / [np.sin(targets[k][1]), 1.0]
            for name, by in zip(("theta_deg", "phi_deg"), shift, strict=True):
                numbers[name][2 * k] += by
                numbers[name][2 * k + 1] += by
        return numbers, words, {
            "na0_nominal": 2690.0, "ne0_nominal": 1430.0, "u_axis_mm": 0.05, "u_direction_arcsec": 3.0,
            "u_frame_arcsec": 4.0, "u_counts": 0.3,
        }  # fmt: skip

    keys = ("face_tilt_rad", "ne0", "beam_tilt_x_rad", "beam_tilt_y_rad", "na0")
    values, covariances = many(runs, 4, made, both_faces_pointing.RECIPE, keys)
    check_scatter(values, covariances, (2e-4, 1434.7, 1e-4, -3e-4, 2691.4))


@pytest.mark.parametrize("runs", RUNS)
def test_encoder(runs):
    truth = {"zero": 2691.0, "cosine": (3.0, -1.0), "sine": (-2.0, 0.5)}

    def made(rng):
        return *polygon(truth, rng, size=0.05, u_face=1.0 * ARC), {
            "axis": "azimuth", "zero_counts": 2691.0, "u_face_arcsec": 1.0, "u_counts": 0.04,
            "u_reading_arcsec": 0.03 * 12.96,
        }  # fmt: skip

    keys = [f"azimuth_encoder_{part}_{k}_counts" for part in ("cosine", "sine") for k in (1, 2)]
    values, covariances = many(runs, 5, made, encoder.RECIPE, keys)
    check_scatter(values, covariances, (3.0, -1.0, -2.0, 0.5))


def test_limits_are_seldom_passed_by_a_touch_to_come():
    rng = np.random.default_rng(6)
    passed = 0
    for _ in range(300):
        touches = np.concatenate([-21_810 + 4 * rng.standard_normal(4), 76_191 + 4 * rng.standard_normal(4)])
        words = {"stop": ["low"] * 4 + ["high"] * 4}
        readings = table(limits.RECIPE, {"azimuth_counts": touches}, words, margin_counts=0.0, u_touch_counts=4.0)
        record = limits.RECIPE.recipe(readings, False).record
        passed += -21_810 + 4 * rng.standard_normal() > record["az_low_limit"]
        passed += 76_191 + 4 * rng.standard_normal() < record["az_high_limit"]
    assert passed <= 5  # 600 touches, 0.13 % each or a little less for the rounding: 5 is a chance of 1e-3


@pytest.mark.parametrize("runs", RUNS)
def test_alignment(runs):
    def made(rng):
        truth = {"beam": (0.21, -0.33), "beam_tilt": (3e-4, 1e-4), "na0": 2691.0, "tilt": 2e-4}
        numbers, words = spots(truth, rng)
        for screen, path in (("before", -0.3), ("near", 0.5), ("far", 4.0)):  # a screen that is not where it is said
            at = [k for k, name in enumerate(words["screen"]) if name == screen]
            turn, said = np.radians(0.5) * rng.standard_normal(), path + 2e-3 * rng.standard_normal()
            for k in at:
                p, q = numbers["p_mm"][k], numbers["q_mm"][k]
                numbers["p_mm"][k], numbers["q_mm"][k] = (
                    p * np.cos(turn) + q * np.sin(turn),
                    q * np.cos(turn) - p * np.sin(turn),
                )
                numbers["path_m"][k] = said
        return numbers, words, {"na0": 2691.0, "u_screen_turn_deg": 0.5, "u_path_mm": 2.0, "u_spot_mm": 0.02}

    keys = ("beam_x_mm", "beam_y_mm", "beam_tilt_x_rad", "beam_tilt_y_rad")
    values, covariances = many(runs, 7, made, alignment.RECIPE, keys)
    check_scatter(values, covariances, (0.21, -0.33, 3e-4, 1e-4))


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("claimed", [True, False])
def test_detector_focus(runs, claimed):
    def made(rng):
        said = {"u_amplitude_share": 0.01} if claimed else {}
        numbers = through_focus({"focus": 0.31, "rayleigh": 1.4}, rng)
        return numbers, None, {"installed_mm": 0.8 + 0.05 * rng.standard_normal(), "u_installed_mm": 0.05, **said}

    keys = ("best_focus_mm", "depth_mm", "detector_defocus_mm")
    values, covariances = many(runs, 8, made, detector_focus.RECIPE, keys)
    if claimed:
        check_scatter(values, covariances, (0.31, 1.4, 0.49))
    else:  # u comes from 22 degrees of freedom: the mean of u^2 is right
        ratio = np.mean((values - (0.31, 1.4, 0.49)) ** 2, axis=0) / np.mean(covariances, axis=0).diagonal()
        assert np.all(np.abs(ratio - 1.0) < 4 * np.sqrt(2.0 / runs)), ratio


@pytest.mark.parametrize("runs", [pytest.param(12, id="quick"), pytest.param(300, id="long", marks=pytest.mark.slow)])
def test_search_results(runs):
    nominal, u = station_truth()
    truths, values, covariances, whole = [], [], [], []
    for run in range(runs):
        rng = np.random.default_rng([9, run])
        truth = nominal + u * rng.standard_normal(13)  # the laboratory is off by what it says
        numbers, words = searches(truth, rng, u_target=2e-3, prime=(1, 4))
        sheet = {"u_counts": 0.5, "u_target_mm": 2.0, "monument": MONUMENT, "mirror": MIRROR}
        found = search_results.RECIPE.recipe(table(search_results.RECIPE, numbers, words, **sheet), False)
        size = np.array([1e-3] * 3 + [1.0] * 3 + [1e-3] * 3 + [1.0] * 4)
        values.append([q.value for q in found.quantities] * size)
        covariances.append(found.covariance * np.outer(size, size))
        truths.append(truth)
        whole.append(found.decisions[0].statistic)
        degrees = int(found.decisions[0].name.split()[-2])
    check_scatter(values, covariances, truths)
    assert np.mean(whole) == pytest.approx(degrees, abs=4 * np.sqrt(2 * degrees / runs))
    assert max(whole) < chi2.isf(1e-3 / runs, degrees)


def test_waves_of_the_scene_are_those_of_the_record():
    psi = 0.3
    assert waves(psi, (1.0,), (2.0,)) == pytest.approx(np.cos(0.3) + 2 * np.sin(0.3))
    assert PER_RADIAN * 2 * np.pi == pytest.approx(100_000)
