"""The structural model's file: read, refused with key and value, written back without the loss of a bit."""

import tomllib

import pytest

from catseye.errors import InputError
from catseye.records.site.structural_model import read_structural_model, structural_model_toml
from repository import ROOT

EXAMPLE = ROOT / "examples" / "structural-model" / "telescope.toml"
TEXT = EXAMPLE.read_text(encoding="utf-8")


def read(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    return read_structural_model(path)


def test_example_equals_its_programs_output_and_round_trips(tmp_path):
    model = read_structural_model(EXAMPLE)
    assert structural_model_toml(model) == TEXT
    assert read(tmp_path, structural_model_toml(model)) == model
    assert [frame.name for frame in model.frame] == [
        "alidade", "elevation", "reflector", "feed_arm", "prime_focus", "subreflector",
    ]  # fmt: skip
    assert tomllib.loads(TEXT)["format"] == "catseye-structural-model-1"


REFUSALS = [
    ("u_turn_arcsec = 0.5", "u_turn_arcsec = 0.0", r"frame\['alidade'\]\.motion\.u_turn_arcsec = 0\.0 .*above 0"),
    ("u_turn_arcsec = 0.5", "", r"motion\.u_turn_arcsec is missing"),
    ('terms = ["cosE", "sinE"]', 'terms = ["cosE", "sinF"]', r"'sinF' is not known"),
    ('terms = ["cosE", "sinE"]', 'terms = ["cosE", "cosE"]', r"has a repeated value"),
    ('terms = ["cosE", "sinE"]', 'terms = ["sinE*t", "t * sinE"]', r"has a repeated value"),
    ("origin_mm = [0.0, 0.0, 48260.0]", "origin_mm = [0.0, 0.0, 48.26]", r"'elevation': origin_mm .* 48\.26 .*metres"),
    ("shift_y_mm = [1.5, 0.0]", "shift_y_mm = [1.5]", r"shift_y_mm does not have the shape .*expected 2 values"),
    ("shift_y_mm = [1.5, 0.0]", "shift_y_mm = [15000.0, 0.0]", r"shift_y_mm holds 15000 .*expected -3000 to 3000"),
    ("shift_y_mm = [1.5, 0.0]", "shift_q_mm = [1.5, 0.0]", r"shift_q_mm = .*not a known key.*perhaps shift_"),
    ("elevation_deg = [0.0, 95.0]\n", "elevation_deg = [0.0, 1.6]\n", r"0 to 1\.6 looks like radians"),
    ("elevation_deg = [0.0, 95.0]\n", "elevation_deg = [95.0, 0.0]\n", r"is not increasing"),
    ("temperature_c = [-25.0, 40.0]", "temperature_c = [248.15, 313.15]", r"c\[0\] = 248\.15 looks like kelvin"),
    ("temperature_c = [-25.0, 40.0]", "temperature_c = [-30.0, 40.0]", r"a table that covers the model's range"),
    ('parent = "feed_arm"', 'parent = "boom"', r"'prime_focus': its line of parents ends at 'boom'"),
    ('parent = "reflector"', 'parent = "subreflector"', r"is circular"),
    ('parent = "prime_focus"', 'parent = "reflector"', r"'subreflector': parent = 'reflector' \(expected 'prime_f"),
    ('frame = "alidade"', 'frame = "aldade"', r"group 'bearings': frame = 'aldade' is not a frame"),
    ('name = "ZAG731D"', 'name = "ZAG731P"', r"point 'ZAG731P' occurs 2 times"),
    ('name = "nod"', 'name = "sway"', r"vibration 'sway' occurs 2 times"),
    ("damping_ratio = 0.005", "damping_ratio = 5.0", r"vibration\['sway'\]\.damping_ratio = 5\.0 .*expected"),
    ("pivot_mm = [0.0, 54839.108, -4999.99]", "pivot_mm = [0.0, 54839.108]", r"pivot_mm.*expected"),
    ('format = "catseye-structural-model-1"', 'format = "catseye-structural-model-2"', r"the supported versions"),
    ("reference_temperature_c = 15.0", "reference_temperature_c = inf", r"expected"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), REFUSALS)
def test_a_wrong_value_is_refused_with_file_key_and_value(tmp_path, old, new, message):
    assert old in TEXT
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, TEXT.replace(old, new, 1))
    assert str(caught.value).startswith("model.toml: ")
    assert "\n" not in str(caught.value)


def test_a_table_of_wrong_shape_or_knots_is_refused(tmp_path):
    wrong = TEXT.replace("elevation_deg = [0.0, 15.0, 30.0", "elevation_deg = [0.0, 30.0, 15.0", 1)
    with pytest.raises(InputError, match="is not increasing"):
        read(tmp_path, wrong)
    wrong = TEXT.replace("elevation_deg = [0.0, 15.0, 30.0, ", "elevation_deg = [0.0, 15.0, ", 1)
    with pytest.raises(InputError, match="expected 6 rows of 3 values"):
        read(tmp_path, wrong)


@pytest.mark.parametrize(
    ("row", "message"),
    [("[1.0, 0.0]", "expected 12 by 12"), ("skew", "not symmetric"), ("negative", "negative eigenvalue")],
)
def test_invalid_covariance_is_refused(tmp_path, row, message):
    rows = [[1.0 if i == j else 0.0 for j in range(12)] for i in range(12)]
    if row == "skew":
        rows[0][1] = 0.5
    elif row == "negative":
        rows[0][1] = rows[1][0] = 2.0
    else:
        rows = [[1.0, 0.0]]
    text = TEXT.replace("shift_y_mm = [1.5, 0.0]", f"shift_y_mm = [1.5, 0.0]\ncovariance = {rows}", 1)
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_points_with_shifts_need_a_basis_and_one_u(tmp_path):
    with pytest.raises(InputError, match="but the group has no shifts"):
        read(tmp_path, TEXT.replace('name = "ZAG731P"', 'name = "ZAG731P"\nshift_x_mm = [1.0]', 1))
    with pytest.raises(InputError, match="u_shift_mm belongs to shifts"):
        read(
            tmp_path,
            TEXT.replace('name = "rim"\nframe = "reflector"\nu_shift_mm = 0.3', 'name = "rim"\nframe = "reflector"', 1),
        )
