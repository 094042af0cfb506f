"""Both faces: traced rays at a mirror off its axes, distances and counts; what shows only against known places."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.mirror.both_faces import RECIPE
from catseye.reduction.calibrations.mirror.both_faces_pointing import RECIPE as POINTING
from lab_scene import ARC, LINES, faces, pointed, pointings, range_to, sky, table

TRUTH = {"offsets": (0.4e-3, -0.3e-3, 0.0, 0.0), "back": 12e-3}
NUMBERS = ("phi_deg", "distance_m")


def calibrated(truth, known=False, made=None, reject=False, **sheet):
    numbers, words = faces(truth, **(made or {}))
    if not known:
        numbers.pop("known_distance_m")
    return RECIPE.recipe(table(RECIPE, numbers, words, **{"u_distance_mm": 0.02, **sheet}), reject)


def test_half_the_difference_of_both_pointings_is_the_axis_offset_whatever_the_distance():
    found = calibrated(TRUTH)
    assert found.value("axis_offset_mm") == pytest.approx(0.4, abs=1e-5)  # s e / R, as s is not known
    assert found.record == {"axis_offset_mm": found.value("axis_offset_mm"), "u_axis_mm": found.u("axis_offset_mm")}
    assert any("mirror offset moves both pointings alike" in note for note in found.notes)


def test_one_pair_by_hand():
    words = {"line": "AA", "to": ["face"] * 2, "pointing": ("direct", "prime")}
    readings = table(RECIPE, {"phi_deg": [30.0] * 2, "distance_m": [29.9998, 30.0002]}, words, u_distance_mm=0.02)
    found = RECIPE.recipe(readings, False)  # the face is nearer by e sin Phi direct, farther in prime
    assert found.value("axis_offset_mm") == pytest.approx(0.2 / np.sin(np.radians(30)), abs=1e-9)
    assert found.u("axis_offset_mm") == pytest.approx(0.02 / np.sqrt(2) / 0.5, rel=1e-6)


@pytest.mark.parametrize("to", ["face", "back", "target"])
def test_each_kind_of_distance_shows_it_with_its_sign(to):
    lines = tuple(line for line in LINES if line[3] == to)
    found = calibrated(TRUTH, made={"lines": lines})
    assert found.value("axis_offset_mm") == pytest.approx(0.4, abs=1e-5)


def test_known_distances_give_the_mirror_offset_and_the_ranger_its_zero():
    found = calibrated(
        {**TRUTH, "zero": 0.15e-3}, known=True, u_known_distance_mm=1e-3, u_zero_mm=0.5, u_distance_mm=1e-3
    )
    assert found.value("axis_offset_mm") == pytest.approx(0.4, abs=1e-5)
    assert found.value("mirror_offset_mm") == pytest.approx(-0.3, abs=1e-5)
    assert any("zero came out as +0.1500 mm" in note for note in found.notes)
    assert any("stands 12.0000 mm before the scan point" in note for note in found.notes)


def test_the_trace_is_the_one_that_the_ranges_reduction_is_tested_with():
    from mirror_scene import traced_change

    target = pointed(0.7, 1.9, 12.0)
    for prime in (False, True):
        change, _ = traced_change(target, (0.4e-3, -0.3e-3, 0.2e-3, 0.1e-3), prime)
        truth = {"offsets": (0.4e-3, -0.3e-3, 0.2e-3, 0.1e-3)}
        assert range_to(target, truth, prime) - 12.0 == pytest.approx(change, abs=1e-11)


def test_one_pointing_alone_or_unknown_words_are_refused():
    numbers, words = faces(TRUTH, lines=LINES[:1])
    numbers.pop("known_distance_m")
    words["pointing"] = ["direct"] * len(words["pointing"])
    with pytest.raises(EstimationError, match=r"rank deficient: .*axis offset"):
        RECIPE.recipe(table(RECIPE, numbers, words, u_distance_mm=0.02), False)
    words["pointing"][1] = "reverse"
    with pytest.raises(InputError, match="line 3, pointing = 'reverse' is unknown"):
        RECIPE.recipe(table(RECIPE, numbers, words, u_distance_mm=0.02), False)
    with pytest.raises(InputError, match="u_known_distance_mm is missing"):
        calibrated(TRUTH, known=True)
    with pytest.raises(InputError, match="u_zero_mm is missing"):
        calibrated(TRUTH, known=True, u_known_distance_mm=0.01)
    numbers, words = faces(TRUTH, lines=LINES[:1])
    numbers["known_distance_m"][2] += 0.01
    with pytest.raises(InputError, match=r"line 4, known_distance_m = 30\.01 of line 'A' was 30\.0 before"):
        RECIPE.recipe(table(RECIPE, numbers, words, u_known_distance_mm=0.01), False)


# ------------------------------------------------------------------------------------------------- counts

POINT = {"na0": 2691.4, "ne0": 1434.7, "tilt": 2e-4, "beam_tilt": (1e-4, -3e-4), "offsets": (0.4e-3, 0.0, 0.0, 0.0)}
SHEET = {"na0_nominal": 2700.0, "ne0_nominal": 1430.0, "axis_offset_mm": 0.4, "u_counts": 0.3}


def found_by_counts(truth=POINT, known=False, reject=False, made=None, **sheet):
    numbers, words = pointings(truth, **(made or {}))
    if not known:
        numbers = {k: v for k, v in numbers.items() if k not in ("theta_deg", "phi_deg")}
    return POINTING.recipe(table(POINTING, numbers, words, **{**SHEET, **sheet}), reject)


def test_traced_counts_give_back_the_tilt_of_the_face_and_the_elevation_zero():
    found = found_by_counts()
    assert found.value("face_tilt_rad") == pytest.approx(2e-4, abs=1e-8)
    assert found.value("ne0") == pytest.approx(1434.7, abs=1e-3)
    assert set(found.record) == {"face_tilt_rad", "ne0", "u_tilt_rad", "u_zero_counts"}


def test_known_directions_show_the_tilt_of_the_beam_and_the_azimuth_zero():
    found = found_by_counts(known=True, u_direction_arcsec=0.1, u_frame_arcsec=0.0)
    assert found.value("beam_tilt_x_rad") == pytest.approx(1e-4, abs=2e-7)
    assert found.value("beam_tilt_y_rad") == pytest.approx(-3e-4, abs=2e-7)
    assert found.value("na0") == pytest.approx(2691.4, abs=0.01)
    assert found.value("face_tilt_rad") == pytest.approx(2e-4, abs=1e-7)


def test_the_difference_of_the_azimuths_by_hand_at_ninety_degrees():
    # Phi = 90: the direct count is tilt/sin 45 low, the prime one as much high
    low = 2e-4 / np.sin(np.pi / 4) * 1e5 / (2 * np.pi)
    words = {"target": "AA", "pointing": ("direct", "prime")}
    numbers = {
        "azimuth_counts": [2700.0 - low, 52_700.0 + low],
        "elevation_counts": [13_930.0, -11_070.0],
        "distance_m": [50.0] * 2,
    }
    found = POINTING.recipe(table(POINTING, numbers, words, **{**SHEET, "axis_offset_mm": 0.0}), False)
    assert found.value("face_tilt_rad") == pytest.approx(2e-4, abs=1e-9)
    assert found.value("ne0") == pytest.approx(1430.0, abs=1e-3)


def test_an_omitted_axis_offset_moves_the_elevation_zero_as_predicted():
    at = [(0.2, np.pi / 2, 10.0)] * 2
    found = found_by_counts({**POINT, "tilt": 0.0, "beam_tilt": (0, 0)}, made={"targets": at}, axis_offset_mm=0.0)
    # 4 e sin^2(45) / R of the sum, half of it the zero's, in counts of Phi
    assert found.value("ne0") - 1434.7 == pytest.approx(2 * 0.4e-3 * 0.5 / 10.0 * 1e5 / (4 * np.pi), rel=0.01)


def test_targets_at_several_heights_separate_shaft_and_face_tilt():
    truth = {**POINT, "tilt": 2e-4}
    numbers, words = pointings(truth)
    numbers = {k: v for k, v in numbers.items() if k not in ("theta_deg", "phi_deg")}
    kappa = 40 * ARC
    for k, ne in enumerate(numbers["elevation_counts"]):  # by hand: kappa cot psi more, the first order
        numbers["azimuth_counts"][k] += kappa / np.tan((ne - 1434.7) * 2 * np.pi / 1e5) * 1e5 / (2 * np.pi)
    sheet = {**SHEET, "u_counts": 0.01}
    wrong = POINTING.recipe(table(POINTING, numbers, words, **sheet), False)
    assert wrong.decisions[0].passed is False
    told = POINTING.recipe(table(POINTING, numbers, words, **sheet, u_axis_tilt_arcsec=200.0), False)
    assert told.value("face_tilt_rad") == pytest.approx(2e-4, abs=1e-6)
    assert any("tilt came out as +40." in note or "tilt came out as +39.9" in note for note in told.notes)


def test_a_wrong_pointing_is_found_and_a_missing_column_refused():
    numbers, words = pointings(POINT, np.random.default_rng(3))
    numbers["azimuth_counts"][4] += 8.0
    sheet = {**SHEET, "u_direction_arcsec": 2.0, "u_frame_arcsec": 2.0}
    found = POINTING.recipe(table(POINTING, numbers, words, **sheet), True)
    assert [k for k, s in enumerate(found.states) if s == "rejected"] == [4]
    assert abs(found.value("face_tilt_rad") - 2e-4) < 4 * found.u("face_tilt_rad")
    numbers.pop("phi_deg")
    with pytest.raises(InputError, match="of the columns 'theta_deg' and 'phi_deg' one is missing"):
        POINTING.recipe(table(POINTING, numbers, words, **sheet), False)
    with pytest.raises(InputError, match="u_frame_arcsec is missing"):
        found_by_counts(known=True, u_direction_arcsec=2.0)


def test_whole_turns_of_the_azimuth_do_not_matter():
    numbers, words = pointings(POINT, targets=sky()[:3])
    numbers = {k: v for k, v in numbers.items() if k not in ("theta_deg", "phi_deg")}
    plain = POINTING.recipe(table(POINTING, numbers, words, **SHEET), False)
    numbers["azimuth_counts"][1] -= 100_000.0
    turned = POINTING.recipe(table(POINTING, numbers, words, **SHEET), False)
    assert turned.value("face_tilt_rad") == pytest.approx(plain.value("face_tilt_rad"), abs=1e-12)


def test_a_target_has_one_known_direction():
    numbers, words = pointings(POINT, targets=sky()[:3])
    numbers["theta_deg"][1] += 0.01
    with pytest.raises(InputError, match=r"line 3, theta_deg = .* was .* before \(expected one direction for each\)"):
        POINTING.recipe(table(POINTING, numbers, words, **SHEET, u_direction_arcsec=2.0, u_frame_arcsec=2.0), False)
