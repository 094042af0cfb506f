"""The laser's alignment: traced spots on turning screens, the effect on range and counts by other rays."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.geometry.mirror.mirror_path import path_change
from catseye.reduction.calibrations.mirror.alignment import RECIPE, effect
from lab_scene import PER_RADIAN, found_at, pointed, range_to, spots, table

TRUTH = {"beam": (0.21, -0.33), "beam_tilt": (3e-4, 1e-4), "na0": 2691.0, "tilt": 2e-4}
SHEET = {"na0": 2691.0, "u_screen_turn_deg": 0.0, "u_path_mm": 0.0, "u_spot_mm": 0.02}


def calibrated(truth=TRUTH, rng=None, reject=False, made=None, **sheet):
    numbers, words = spots(truth, rng, **(made or {}))
    return RECIPE.recipe(table(RECIPE, numbers, words, **{**SHEET, **sheet}), reject)


SECOND = 2.5e-7  # rad: face tilt 2e-4 times beam tilt 3e-4, four times over


def test_traced_spots_give_back_place_and_tilt_of_the_beam_exactly_off_a_straight_face():
    found = calibrated({**TRUTH, "tilt": 0.0})
    assert [found.value(f"beam_{a}_mm") for a in "xy"] == pytest.approx([0.21, -0.33], abs=1e-6)
    assert [found.value(f"beam_tilt_{a}_rad") for a in "xy"] == pytest.approx([3e-4, 1e-4], abs=1e-9)


@pytest.mark.parametrize("screens", [(("near", 0.5), ("far", 4.0)), (("up", -0.4), ("down", -0.05))])
def test_screens_before_and_after_the_mirror_agree_whatever_the_face_does(screens):
    found = calibrated(made={"screens": screens})
    assert [found.value(f"beam_tilt_{a}_rad") for a in "xy"] == pytest.approx([3e-4, 1e-4], abs=SECOND)
    assert [found.value(f"beam_{a}_mm") for a in "xy"] == pytest.approx([0.21, -0.33], abs=4e3 * SECOND)


def test_one_distance_alone_does_not_separate_place_and_tilt():
    with pytest.raises(EstimationError, match=r"rank deficient: .*(beam|tilt)"):
        calibrated(made={"screens": (("far", 4.0),)})


def test_the_effect_is_that_of_traced_rays():
    tilts, beam = np.array([2e-4, 3e-4, -1e-4]), np.array([0.4, -0.2])
    theta, phi = np.array([0.0, 0.8, 2.5]), 1.3
    change, counts = effect(tilts, beam, theta=theta, phi=phi, distance=40.0)
    truth = {"offsets": (0.0, 0.0, 0.4e-3, -0.2e-3), "beam_tilt": (3e-4, -1e-4), "tilt": 2e-4}
    for k, t in enumerate(theta):
        target = pointed(t, phi, 40.0)
        turn, shaft = found_at(target, truth)
        assert change[k] == pytest.approx(range_to(target, truth) - 40.0, abs=1e-11)
        np.testing.assert_allclose(counts[k], PER_RADIAN * np.array([turn - t, shaft - phi / 2]), atol=1e-6)


def test_without_tilts_the_effect_is_that_of_the_mirrors_offsets():
    change, _ = effect(np.zeros(3), np.array([1.5, -0.7]), theta=np.array([0.4]), phi=1.0, distance=5.0)
    expected, _ = path_change(0.4, 1.0, 5.0, [0.0, 0.0, 1.5e-3, -0.7e-3])
    assert change[0] == pytest.approx(float(expected), abs=1e-12)


def test_the_tilt_of_the_face_is_carried_into_record_and_effect():
    found = calibrated(face_tilt_rad=2e-4, u_face_tilt_rad=1e-5)
    assert (found.record["face_tilt_rad"], found.record["u_tilt_rad"]) == (2e-4, 1e-5)
    at_ninety = next(note for note in found.notes if note.startswith("at Phi = 90 degrees and 100 m"))
    assert "azimuth counts" in at_ninety


def test_a_wrong_spot_goes_and_a_moved_screen_is_refused():
    numbers, words = spots(TRUTH, np.random.default_rng(1))
    numbers["q_mm"][3] += 1.0
    found = RECIPE.recipe(table(RECIPE, numbers, words, **SHEET), True)
    assert [k for k, s in enumerate(found.states) if s == "rejected"] == [3]
    numbers["path_m"][3] += 0.01
    with pytest.raises(InputError, match=r"line 5, path_m = -0\.29 of this screen was -0\.3 before"):
        RECIPE.recipe(table(RECIPE, numbers, words, **SHEET), False)
