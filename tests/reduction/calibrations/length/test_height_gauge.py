"""The height gauge: offsets by the notes' sign, reversal against a lean, blocks, warmth, refusals."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.length.height_gauge import RECIPE
from lab_scene import ARC, BALL, PLACES, PLUG, heights, table

OFFSET = (-0.075, 247.459, -0.762)  # mm, ZP3
SHEET = {
    "ball_diameter_mm": BALL,
    "mirror_diameter_mm": PLUG,
    "u_lean_arcsec": 0.0,
    "u_scale_ppm": 0.0,
    "u_reading_mm": 0.001,
}
KEYS = ("dx_mm", "dy_mm", "dz_mm")


def calibrated(truth, reject=False, made=None, **sheet):
    numbers, words = heights(truth, **(made or {}))
    return RECIPE.recipe(table(RECIPE, numbers, words, **{**SHEET, **sheet}), reject)


def test_heights_give_the_notes_offsets_from_the_ball_to_the_mirror():
    found = calibrated({"offset": OFFSET})
    assert [found.value(key) for key in KEYS] == pytest.approx(OFFSET, abs=1e-9)
    assert found.record["u_offset_mm"] == max(found.u(key) for key in KEYS)


def test_one_set_up_by_hand():
    # y up: the mirror's plug, 12 mm thick, is touched on top at 380 mm, the ball, 19.05 mm, at 136 mm
    words = {"setup": "aa", "up": ["+y"] * 2, "front": ["+z"] * 2, "feature": ("mirror", "ball"), "touch": ["top"] * 2}
    sheet = {**SHEET, "dx_mm": 0.0, "dz_mm": 0.0, "u_offset_mm": 0.01}
    found = RECIPE.recipe(table(RECIPE, {"height_mm": [380.0, 136.0]}, words, **sheet), False)
    assert found.value("dy_mm") == pytest.approx((380 - 6) - (136 - 9.525), abs=1e-9)
    assert found.u("dy_mm") == pytest.approx(0.001 * np.sqrt(2), rel=1e-6)
    assert set(found.record) == {"dy_mm", "u_offset_mm"}


@pytest.mark.parametrize("lean", [(20 * ARC, 0.0), (0.0, 20 * ARC), (-15 * ARC, 8 * ARC)])
def test_turned_over_with_the_long_offset_as_before_the_lean_falls_out(lean):
    truth = {"offset": OFFSET, "lean": {"x": lean, "z": lean}}
    found = calibrated(truth, u_lean_arcsec=60.0)
    assert [found.value(key) for key in KEYS] == pytest.approx(OFFSET, abs=1e-4)  # to the front only dz, 0.8 mm, lies
    assert found.u("dx_mm") < 0.001
    some = {name: PLACES[name] for name in ("a", "b", "d")}
    once = calibrated(truth, made={"places": some}, u_lean_arcsec=60.0)
    assert once.u("dx_mm") == pytest.approx(60 * ARC * 247.459, rel=0.01)  # 72 um: nothing tells it


def test_turned_over_the_other_way_the_lean_stays():
    places = {"a": PLACES["a"], "b": ("+x", "+z"), "c": ("-x", "+z")}  # about z: the long offset turns round too
    truth = {"offset": OFFSET, "lean": {"x": (20 * ARC, 0.0)}}
    found = calibrated(truth, made={"places": places}, u_lean_arcsec=60.0, dz_mm=-0.762, u_offset_mm=0.01)
    assert found.u("dx_mm") > 0.9 * 60 * ARC * 247.459


def test_blocks_films_and_a_warm_gauge_are_added_as_they_are():
    numbers, words = heights({"offset": OFFSET}, places={"a": PLACES["a"]}, touches=("centre",), times=2)
    h = np.array(numbers["height_mm"])
    warm = 1.0 + 11.5e-6 * 3.0  # 23 degrees: each millimetre of the scale is longer than it says
    stack = np.where(np.array(words["feature"]) == "mirror", 347.0, 100.0)
    words["blocks"] = ["300+47" if f == "mirror" else "100" for f in words["feature"]]
    films = np.where(stack == 347.0, 1e-4, 0.0)
    blocks = [{"name": n, "length_mm": float(n), "u_mm": 2e-4} for n in ("300", "47", "100")]
    readings = table(
        RECIPE, {"height_mm": np.zeros(4), "indicator_mm": h / warm - stack - films}, words, **SHEET, block=blocks,
        film_um=0.1, gauge_temperature_c=23.0, dx_mm=0.0, dz_mm=0.0, u_offset_mm=0.01,
    )  # fmt: skip
    found = RECIPE.recipe(readings, False)
    assert found.value("dy_mm") == pytest.approx(247.459, abs=1e-6)
    assert found.u("dy_mm") == pytest.approx(np.sqrt(2 * 0.001**2 / 2 + 3 * 2e-4**2), rel=1e-3)


def test_the_lean_of_a_single_set_up_is_in_u():
    found = calibrated({"offset": OFFSET}, u_seating_arcsec=4.0)
    alone = 4 * ARC * 247.459
    assert found.u("dx_mm") == pytest.approx(alone / np.sqrt(2), rel=0.02)  # two set-ups show x


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("up", "y", "line 2, up = 'y' is no axis"),
        ("front", "-y", r"up = '\+y' and front = '-y' are one axis"),
        ("feature", "box", "feature = 'box' is unknown"),
        ("touch", "side", "touch = 'side' is unknown"),
        ("setup", "b", "setup = 'b' stands another way than before"),
    ],
)
def test_unknown_words_are_refused(name, value, said):
    numbers, words = heights({"offset": OFFSET})
    words[name][0] = value
    with pytest.raises(InputError, match=said):
        RECIPE.recipe(table(RECIPE, numbers, words, **SHEET), False)


def test_an_unobserved_offset_must_be_in_the_sheet():
    with pytest.raises(InputError, match=r"dz_mm is missing .* has z up"):
        calibrated({"offset": OFFSET}, made={"places": {name: PLACES[name] for name in ("a", "b", "c")}})
    numbers, words = heights({"offset": OFFSET})
    balls = [k for k, f in enumerate(words["feature"]) if f == "ball"]
    only = {name: [w[k] for k in balls] for name, w in words.items()}
    readings = table(RECIPE, {"height_mm": [numbers["height_mm"][k] for k in balls]}, only, **SHEET)
    with pytest.raises(EstimationError, match="rank deficient"):
        RECIPE.recipe(readings, False)
    with pytest.raises(InputError, match="ball_diameter_mm is missing"):
        calibrated({"offset": OFFSET}, ball_diameter_mm=None)
