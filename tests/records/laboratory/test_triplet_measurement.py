"""Sheets of measured triplets: what loads, and what is refused with file, key, value and expectation."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from repository import TESTS
from triplet_scene import SHEET, measurement

FORMATS = TESTS / "vectors" / "formats"


def refused(tmp_path, old, new, count=1):
    """The refusal of the example with a text in it replaced."""
    text = SHEET.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "TR99.toml").write_text(text.replace(old, new, count), encoding="utf-8")
    with pytest.raises(InputError) as problem:
        read_record(tmp_path / "TR99.toml", TripletMeasurement)
    assert str(problem.value).startswith("TR99.toml: ")
    assert "\n" not in str(problem.value)
    return str(problem.value).removeprefix("TR99.toml: ")


@pytest.mark.parametrize("path", sorted((SHEET.parent).glob("*.toml")), ids=lambda path: path.stem)
def test_every_example_loads(path):
    sheet = read_record(path, TripletMeasurement)
    assert sheet.triplet == path.stem
    assert TripletMeasurement.model_validate(sheet.model_dump()) == sheet


def test_the_released_format_still_loads():
    sheet = read_record(FORMATS / "triplet-measurement-1.toml", TripletMeasurement)
    assert sheet.bk7_group_index == 1.527463
    assert sheet.surface_plate.top_surface_mm == (88.91, 88.93, 88.92)
    assert TripletMeasurement.model_validate(sheet.model_dump()) == sheet


def test_readings_of_the_flip_repeat_those_before_it_where_there_are_none():
    before = measurement().placement[0].model_dump()
    own = {k: before[k] for k in before if "flipped" not in k}
    sheet = measurement(placement=[own, own | {"temperature_flipped_c": 0.0, "humidity_flipped_percent": 0.0}])
    assert sheet.placement[0].flipped("temperature", "c") == before["temperature_c"]
    assert sheet.placement[0].flipped("phi_zrg", "rad") == before["phi_zrg_rad"]
    # zero is a reading, not its absence
    assert sheet.placement[1].flipped("temperature", "c") == 0.0
    assert sheet.placement[1].flipped("humidity", "percent") == 0.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "l1_mm = 114.066080",
            "l1_mm = 4.490790",
            "l1_mm = 4.49079 (expected 15 to 500 mm; it looks like inches, which would be 114.066 mm)",
        ),
        (
            "l_post_mm = 88.900000",
            "l_post_mm = 3.5",
            "surface_plate.l_post_mm = 3.5 (expected 20 to 500 mm; it looks like inches, which would be 88.9 mm)",
        ),
        (
            "d12_mm = 635.000000",
            "d12_mm = 25.0",
            "d12_mm = 25.0 (expected 100 to 5000 mm; it looks like inches, which would be 635 mm)",
        ),
        (
            "d12_mm = 635.000000",
            "d12_mm = 0.635",
            "d12_mm = 0.635 (expected 100 to 5000 mm; it looks like metres, which would be 635 mm)",
        ),
        (
            "r1_mm = 50.012600",
            "r1_mm = 1.969",
            "ball.r1_mm = 1.969 (expected 10 to 1000 mm; it looks like inches, which would be 50.0126 mm)",
        ),
        (
            "height_mm = 38.400000",
            "height_mm = 1.5118",
            "left_prism.height_mm = 1.5118 (expected 10 to 500 mm; it looks like inches",
        ),
        (
            "d_toppl_mm = 18150.000000",
            "d_toppl_mm = 714.567",
            "d_toppl_mm = 714.567 (expected 3000 to 200000 mm; it looks like inches, which would be 18150 mm)",
        ),
        (
            "d_toppl_mm = 18150.000000",
            "d_toppl_mm = 18.15",
            "placement[0].d_toppl_mm = 18.15 (expected 3000 to 200000 mm; it looks like metres",
        ),
        (
            "phi_1_rad = 3.182031537",
            "phi_1_rad = 182.317",
            "phi_1_rad = 182.317 (expected 0 to below 2 pi rad; it looks like degrees, which would be 3.18203 rad)",
        ),
        ("phi_1_rad = 3.182031537", "phi_1_rad = -0.1", "placement[0].phi_1_rad = -0.1 (expected 0 to below 2 pi rad)"),
        (
            "phi_bcfp_rad = 0.823385076",
            "phi_bcfp_rad = 6.283185307179587",
            "placement[0].phi_bcfp_rad = 6.283185307179587 (expected 0 to below 2 pi rad",
        ),
        (
            "temperature_c = 20.4",
            "temperature_c = 293.55",
            "placement[0].temperature_c = 293.55 (expected -20 to 50 °C; it looks like kelvin, which would be 20.4 °C)",
        ),
        (
            "temperature_c = 20.4",
            "temperature_c = 68.7",
            "it looks like degrees Fahrenheit, which would be 20.3889 °C)",
        ),
        (
            "pressure_hpa = 931.0",
            "pressure_hpa = 93.1",
            "placement[0].pressure_hpa = 93.1 (expected 500 to 1100 hPa; it looks like kilopascals",
        ),
        ("pressure_hpa = 931.0", "pressure_hpa = 27.49", "it looks like inches of mercury"),
        ("pressure_hpa = 931.0", "pressure_hpa = 93100.0", "it looks like pascals"),
        (
            "humidity_percent = 47.0",
            "humidity_percent = 470.0",
            "placement[0].humidity_percent = 470.0 (expected 0 to 100)",
        ),
        (
            "humidity_percent = 47.0",
            "humidity_percent = 0.47",
            "placement[0].humidity_percent = 0.47 (expected 0 or 1 to 100 %; it looks like a share of one, which would "
            "be 47 %)",
        ),
        ("serial = 101", "serial = -101", "left_prism.serial = -101 (expected"),
        ("modulation_hz = 1500000000.0", "modulation_hz = 1500.0", "modulation_hz = 1500.0 looks like megahertz"),
        ("wavelength_um = 0.780", "wavelength_um = 780.0", "wavelength_um = 780.0 looks like nanometres"),
        ("u_phase_rad = 0.0008", "u_phase_rad = 0.0", "u_phase_rad = 0.0 (expected above 0 to 1)"),
        ("serial = 101", "serial = 102", "left_prism.serial = 102 is even (expected odd, the left prism's)"),
        ("serial = 102", "serial = 103", "right_prism.serial = 103 is odd (expected even, the right prism's)"),
        (
            "hrp_mm = 25.146080",
            "hrp_mm = 25.2",
            "sizes and the index ratio 1.527077 (expected 25.146080, within 0.05 mm)",
        ),
        ("pc_mm = -33.493677", "pc_mm = -1.31865", "left_prism.pc_mm = -1.31865 does not match"),
        ("pc_b_mm = -173.715175", "pc_b_mm = -173.6", "ball.pc_b_mm = -173.6 does not match"),
        ("pc_mm = -33.493677", "pc_mm = 33.493677", "left_prism.pc_mm = 33.493677 has the wrong sign"),
        ("r2_mm = 96.494600", "r2_mm = 46.4946", "ball.r2_mm = 46.4946 is smaller than r1_mm = 50.0126"),
        (
            "l_bt_mm = 38.866900",
            "l_bt_mm = 88.8669",
            "surface_plate.l_bt_mm = 88.8669 puts the point r1_mm above it +49.980 mm from l_post_mm = 88.9",
        ),
        (
            "l1_mm = 114.066080",
            "l1_mm = 88.92",
            "surface_plate.l1_mm = 88.92 puts the point hrp_mm of the left prism below it -25.126 mm",
        ),
        (
            "spacer_mm = 25.4",
            "spacer_mm = 1.0",
            "placement[1].spacer_mm = 1.0 with d_toppl_mm = 18124.6 puts the stops -24.4 mm from where the first",
        ),
        ("spacer_mm = 25.4", "spacer_mm = 1.0", "the spacer looks like inches)"),
        ('air_model = "rueger1990"', 'air_model = "edlen"', "air_model = 'edlen' (expected"),
        ("measured_on = 2003-05-14", "", "measured_on is missing"),
        ("[ball]", "[ball]\nr3_mm = 1.0", "ball.r3_mm = 1.0 is not a known key"),
        ("[ball]", "[ball]\nspacer_mm = 1.0", "ball.spacer_mm = 1.0 is not a known key (expected in another table)"),
        ("phi_2_rad = 3.184779218", 'phi_2_rad = "3.18"', "placement[0].phi_2_rad = '3.18' (expected a number)"),
    ],
)
def test_a_bad_sheet_is_refused_with_key_value_and_expectation(tmp_path, old, new, words):
    assert words in refused(tmp_path, old, new)


def test_swapped_serials_are_named_as_such(tmp_path):
    text = (
        SHEET.read_text(encoding="utf-8").replace("serial = 101", "serial = X").replace("serial = 102", "serial = 101")
    )
    (tmp_path / "T.toml").write_text(text.replace("serial = X", "serial = 102"), encoding="utf-8")
    with pytest.raises(InputError, match=r"left_prism.serial = 102 is even .*left and right look swapped"):
        read_record(tmp_path / "T.toml", TripletMeasurement)


def test_a_sheet_without_placements_is_refused():
    with pytest.raises(ValidationError):
        measurement(placement=[])


@given(phase=st.floats(-100.0, 100.0))
def test_a_phase_is_welcome_exactly_from_0_to_below_2_pi(phase):
    inside = 0.0 <= phase < 6.283185307179586
    try:
        sheet = measurement(placement__1__phi_2_rad=phase)
    except ValidationError:
        assert not inside
    else:
        assert inside
        assert sheet.placement[1].phi_2_rad == phase
