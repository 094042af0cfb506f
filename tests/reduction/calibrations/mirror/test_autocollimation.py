"""Autocollimation: signs and factors by traced rays, what can be told apart, what is refused."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.mirror.autocollimation import RECIPE
from lab_scene import ARC, SETTINGS, SIGHTS, autocollimation, table

TRUTH = {"beta": (-150 * ARC, 25 * ARC), "na0": -4195.3, "ne0": -4935.4, "tilt": 20 * ARC}
SHEET = {
    "displays": "beam", "na0_nominal": -4100.0, "ne0_nominal": -4900.0, "u_lean_x_arcsec": 1.0, "u_lean_y_arcsec": 1.0,
    "u_roll_arcsec": 60.0, "u_flat_arcsec": 1.0, "u_count": 0.0,
}  # fmt: skip


def calibrated(truth, reject=False, rng=None, made=None, **sheet):
    made = made or {}
    numbers, words = autocollimation(truth, rng, **made)
    return RECIPE.recipe(table(RECIPE, numbers, words, **{**SHEET, "u_reading_arcsec": 0.3, **sheet}), reject)


@pytest.mark.parametrize("display", ["beam", "mirror"])
@pytest.mark.parametrize("signs", [(1, 1), (-1, 1), (1, -1)])
def test_exact_readings_give_back_the_truth_whatever_the_scale_shows(display, signs):
    made = {"display": display, "signs": signs}
    found = calibrated(TRUTH, made=made, displays=display, x_sign=signs[0], y_sign=signs[1])
    assert found.value("beta1_rad") == pytest.approx(-150 * ARC, abs=1e-10)
    assert found.value("beta2_rad") == pytest.approx(25 * ARC, abs=1e-10)
    assert found.value("ne0") == pytest.approx(-4935.4, abs=1e-5)
    assert found.value("na0") == pytest.approx(-4195.3, abs=1e-4)
    assert found.value("face_tilt_rad") == pytest.approx(20 * ARC, abs=1e-10)
    assert found.record["beta1_rad"] == found.value("beta1_rad")
    assert found.record["u_zero_counts"] == found.u("na0") > found.u("ne0")


def test_the_notes_own_reading_gives_their_betas():
    # Step 4: at N_e0 the reflection stays at x = 25", y = 2'30" (of the mirror) wherever the azimuth stands.
    settings = [(a, 0, "mirror") for a in range(0, 100_000, 25_000)]
    numbers, words = autocollimation({"beta": (0, 0), "na0": 0.0, "ne0": 0.0}, settings=settings)
    numbers["x_arcsec"], numbers["y_arcsec"] = [25.0] * 4, [150.0] * 4
    sheet = {**SHEET, "displays": "mirror", "na0_nominal": 0.0, "ne0_nominal": 0.0, "u_na0_counts": 50.0}
    found = RECIPE.recipe(table(RECIPE, numbers, words, **sheet, u_reading_arcsec=0.5), False)
    assert found.value("beta1_rad") / ARC == pytest.approx(-150.0, abs=1e-3)
    assert found.value("beta2_rad") / ARC == pytest.approx(25.0, abs=1e-3)
    assert found.value("ne0") == pytest.approx(0.0, abs=1e-3)
    assert "na0" not in found.record


def test_beta_is_no_better_than_the_autocollimators_alignment():
    found = calibrated(TRUTH)
    noise = 0.5 * 0.3 * ARC / np.sqrt(len(SETTINGS))  # a scale of the beam: half of it is the mirror's
    assert found.u("beta2_rad") == pytest.approx(np.hypot(1.0 * ARC, noise), rel=0.01)
    leaning = calibrated({**TRUTH, "lean": (3 * ARC, 0.0)}, u_lean_x_arcsec=5.0)
    assert leaning.value("beta2_rad") == pytest.approx(22 * ARC, abs=0.01 * ARC)  # c leans as z~ does: less is read
    assert abs(leaning.value("beta2_rad") - 25 * ARC) < leaning.u("beta2_rad")


def test_one_azimuth_separates_beta_neither_from_the_face_tilt_nor_the_shaft():
    made = {"settings": [(0, e, "mirror") for e in (-12, 0, 12) for _ in range(4)]}
    with pytest.raises(EstimationError, match=r"rank deficient: .*beta"):
        calibrated(TRUTH, made=made, u_na0_counts=5.0)
    with pytest.raises(EstimationError, match=r"rank deficient: .*N_e0, beta2|beta2, N_e0"):
        calibrated(TRUTH, made=made, u_na0_counts=5.0, u_face_tilt_arcsec=10.0)


def test_a_tilt_known_before_is_a_prior_and_stays_out_of_the_record():
    made = {"settings": [(a, e, "mirror") for a in (0, 50_000) for e in (-12, 0, 12)]}
    held = calibrated({**TRUTH, "tilt": 0.0}, made=made, u_na0_counts=5.0, u_face_tilt_arcsec=10.0, na0_nominal=-4195.3)
    assert "face_tilt_rad" not in held.record
    assert held.value("beta1_rad") == pytest.approx(-150 * ARC, abs=1e-9)


def test_flips_give_face_minus_shaft_and_both_faces_separate_them():
    truth = {**TRUTH, "axis_tilt": 15 * ARC}
    near = {"settings": SETTINGS}
    flips = calibrated(truth, made=near, u_na0_counts=2.0, na0_nominal=-4195.3)
    assert flips.value("face_tilt_rad") == pytest.approx(5 * ARC, abs=1e-8)
    told = calibrated(truth, u_axis_tilt_arcsec=60.0)
    assert told.value("face_tilt_rad") == pytest.approx(20 * ARC, abs=0.02 * ARC)
    assert (
        told.u("face_tilt_rad")
        < 1.0 * ARC
        < calibrated(truth, made=near, u_na0_counts=2.0, u_axis_tilt_arcsec=60.0).u("face_tilt_rad")
    )


def test_a_wrong_reading_is_named_and_rejected_only_on_request():
    numbers, words = autocollimation(TRUTH, np.random.default_rng(5))
    numbers["y_arcsec"][9] += 30.0
    readings = table(RECIPE, numbers, words, **SHEET, u_reading_arcsec=0.3)
    assert RECIPE.recipe(readings, False).states[9] == "suspect"
    found = RECIPE.recipe(readings, True)
    assert [k for k, state in enumerate(found.states) if state == "rejected"] == [9]
    assert abs(found.value("beta1_rad") + 150 * ARC) < 4 * found.u("beta1_rad")


def test_the_servos_own_count_makes_the_readings_along_the_shaft_weaker():
    made = {"settings": (*SETTINGS, *SIGHTS)}
    fine, coarse = (calibrated(TRUTH, made=made, u_count=u) for u in (0.0, 0.29))
    # 0.29 counts of the shaft, which 24 readings into the mirror and 6 into the flat, direct and prime, show once each
    assert coarse.u("ne0") == pytest.approx(0.29 / np.sqrt(30), rel=0.01)
    assert fine.u("ne0") < 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"into": ["window"] + ["mirror"] * 29}, r"t\.csv: line 2, into = 'window' is unknown"),
        ({"elevation_counts": -4935 + 12_500}, r"line 2, elevation_counts = 7565 points to Phi = 89\.\d+ degrees"),
    ],
)
def test_readings_that_cannot_be_are_refused(change, said):
    numbers, words = autocollimation(TRUTH, settings=(*SETTINGS, *SIGHTS))
    for name, value in change.items():
        if name in words:
            words[name] = value
        else:
            numbers[name][0] = value
    with pytest.raises(InputError, match=said):
        RECIPE.recipe(table(RECIPE, numbers, words, **SHEET, u_reading_arcsec=0.3), False)


def test_missing_keys_of_the_sheet_are_reported():
    with pytest.raises(InputError, match=r"t\.toml: u_na0_counts is missing"):
        calibrated(TRUTH, made={"settings": SETTINGS})
    with pytest.raises(InputError, match=r"t\.toml: u_flat_arcsec is missing"):
        calibrated(TRUTH, u_flat_arcsec=None)
