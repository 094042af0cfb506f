"""`catseye glass`: the table, one glass, and one line for what cannot be."""

import json
from functools import partial
from math import asin, cos, pi, tan

import pytest

from catseye.api.optics import glass as catseye_glass
from catseye.errors import ArgumentError
from catseye.optics.glass import GLASSES, group_index, reference_air
from catseye.optics.retroreflector import prism


@pytest.fixture
def asked(catseye):
    """`catseye glass` run in this process: exit status, what it said, what it complained of."""
    return partial(catseye, "glass")


def test_without_a_name_it_lists_every_glass_with_its_source(asked):
    status, out, err = asked("--json")
    assert (status, err) == (0, "")
    table = json.loads(out)["glasses"]
    assert list(table) == list(GLASSES)
    assert all(entry["source"].startswith("[") for entry in table.values())
    assert all(name in asked()[1] for name in GLASSES)


def test_the_notes_glass_gives_the_notes_numbers(asked):
    status, out, err = asked("BK7-old", "--height-mm", 38.4, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    # the notes put 0.780 um, which the option takes in vacuum, into a formula for the wavelength in air
    assert found["notes_phase_index"] == pytest.approx(1.51118682, abs=5e-9)
    assert found["notes_group_index"] == pytest.approx(1.52746375, abs=5e-9)
    assert found["notes_group_wavelength"] == pytest.approx(0.130845422, abs=1e-9)
    own = found["prism"]
    assert own["notes_group_index_over_air"] == pytest.approx(1.527077, abs=5e-7)
    assert own["notes_range_constant"] * 1e3 == pytest.approx(-33.4937, abs=5.1e-5)
    assert (own["notes_range_constant"] - own["range_constant"]) * 1e6 == pytest.approx(23.6, abs=0.1)
    # 5.19 with the air's half wavelength 99.905519 mm (1.30 halved): 2 pi 33.4937/99.905519 by hand
    assert own["notes_phase_offset"] == pytest.approx(2.0 * 3.141592653589793 * 33.4937 / 99.905519, abs=2e-5)
    assert own["phase_offset"] == pytest.approx(
        2.0 * 3.141592653589793 * -own["range_constant"] / 0.099905519, abs=2e-6
    )
    cost = found["others"]["N-BK7"]
    assert cost["range_too_long_about_face"] * 1e6 == pytest.approx(0.44, abs=0.005)
    text = asked("BK7-old", "--height-mm", 38.4)[1]
    assert "half of it 65.422711 mm" in " ".join(text.split())


def test_a_kelvin_changes_the_range_constant_as_told(asked):
    constants, slope = [], None
    for temperature in (19.5, 20.0, 20.5):
        own = json.loads(asked("N-BK7", "--temperature-c", temperature, "--json")[1])["prism"]
        expanded = own["height"] * (1 + GLASSES["N-BK7"].expansion * (temperature - 20.0))
        constants.append(float(prism.range_constant(expanded, own["group_index_over_air"])))
        slope = own["range_constant_per_c"] if temperature == 20.0 else slope
    assert constants[2] - constants[0] == pytest.approx(slope, rel=1e-4, abs=0.0)


def test_the_range_constant_at_minus_20_is_that_of_the_shrunk_prism(asked):
    """By hand: -(n - 1/n) h with h = 38.1 mm (1 - 40 x 7.1e-6); the height as at 20 °C would be 9.4 um off."""
    own = json.loads(asked("N-BK7", "--temperature-c=-20", "--json")[1])["prism"]
    n, h = own["group_index_over_air"], 0.0381 * (1.0 - 40.0 * 7.1e-6)
    assert own["range_constant"] == pytest.approx(-(n - 1.0 / n) * h, abs=1e-12)
    assert own["range_constant"] + (n - 1.0 / n) * 0.0381 == pytest.approx(9.44e-6, abs=5e-8)
    assert own["reference_depth"] == pytest.approx(h / n, abs=1e-12)
    assert own["range_constant_per_c"] == pytest.approx(-0.30e-6, abs=5e-9)


def test_the_point_about_which_a_turn_leaves_the_range_lies_higher_by_the_square_of_the_indices_difference(asked):
    """By hand h (2 n_p - n_g)/n_p^2 = h/n_g - h (n_g - n_p)^2/(n_g n_p^2): 2.9 um higher in a 38.1 mm prism."""
    own = json.loads(asked("N-BK7", "--json")[1])["prism"]
    n_p, n_g = own["phase_index_over_air"], own["group_index_over_air"]
    higher = own["height_at_temperature"] * (n_g - n_p) ** 2 / (n_g * n_p**2)
    assert own["reference_depth"] - own["flat_depth"] == pytest.approx(higher, rel=1e-6)
    assert higher == pytest.approx(2.9e-6, abs=0.1e-6)
    assert f"{1e3 * own['flat_depth']:.4f} mm changes no range" in " ".join(asked("N-BK7")[1].split())


def test_the_wavelength_is_in_vacuum_as_the_help_says(asked):
    """A mercury line: 0.5462268 um in vacuum is the e line, 0.5460740 um in air of 15 °C, of the data sheet."""
    found = json.loads(asked("N-BK7", "--wavelength-um", 0.5462268, "--json")[1])
    assert found["wavelength_in_air_um"] == pytest.approx(0.5460740, abs=5e-6)  # 5 °C: 2.6e-6
    square = 1.0 + sum(
        b * found["wavelength_in_air_um"] ** 2 / (found["wavelength_in_air_um"] ** 2 - c)
        for b, c in ((1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653))
    )
    assert found["phase_index"] == pytest.approx(square**0.5, abs=1e-12)
    air = float(reference_air(0.5462268).phase)
    assert found["absolute_phase_index"] == pytest.approx(found["phase_index"] * air, abs=1e-12)


@pytest.mark.parametrize("temperature_c", [-100, 140])
def test_at_the_ends_of_the_formula_there_is_an_answer_and_a_doubt(asked, temperature_c):
    found = json.loads(asked("N-BK7", f"--temperature-c={temperature_c}", "--json")[1])
    assert found["verdict"]["word"] == "doubtful"
    assert "-30 to 70 °C" in found["verdict"]["why"]
    assert -5e-7 < found["prism"]["range_constant_per_c"] < -2e-7


def test_the_other_glass_is_reckoned_at_the_wavelength_asked_for(asked):
    found = json.loads(asked("N-BK7", "--wavelength-um", 1.55, "--json")[1])
    assert found["others"]["BK7-old"] is None  # the old series ends at 1.014 um
    in_air = 1.55 / float(reference_air(1.55).phase)  # 1.55 um is asked for in vacuum, both makers' air is at 20 °C
    difference = float(group_index(in_air, "fused-silica") - group_index(in_air, "N-BK7"))
    assert found["others"]["fused-silica"]["group_index"] == pytest.approx(difference, abs=1e-15)
    assert "not valid at" in asked("N-BK7", "--wavelength-um", 1.55)[1]


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("BK8",), 1, "glass 'BK8' is unknown; known are BK7-old, N-BK7, fused-silica, S-LAH79"),
        (("N-BK7", "--wavelength-um", 10.6), 1, "wavelength 10.6"),
        (("N-BK7", "--temperature-c", 500), 1, "temperature 500"),
        (("N-BK7", "--height-mm", 0), 2, "not a prism's height"),
        (("N-BK7", "--height-mm", "nan"), 2, "not a prism's height"),
    ],
)
def test_what_cannot_be_is_one_line(asked, arguments, status, said):
    found, out, err = asked(*arguments)
    assert (found, out) == (status, "")
    assert said in " ".join(err.split())
    assert status == 2 or err.count("\n") == 1


def test_zero_degrees_is_a_temperature(asked):
    assert json.loads(asked("N-BK7", "--temperature-c", 0, "--json")[1])["temperature_c"] == 0.0


def test_a_glass_beyond_the_notes_air_is_told_in_the_makers_air(catseye):
    status, out, err = catseye("glass", "fused-silica", "--wavelength-um", 0.25, "--json")
    assert (status, err) == (0, "")
    told = json.loads(out)
    assert told["prism"]["air"] == "20 °C, 1013.25 hPa, dry"
    # [MALITSON65] at 0.25 um of his own formula, in air; 0.25 um in vacuum is 75 pm less, by -0.49/um 3.7e-5 more
    assert told["notes_phase_index"] == pytest.approx(1.50745, abs=2e-5)
    assert told["phase_index"] == pytest.approx(1.50745 + 3.7e-5, abs=2e-5)
    assert told["prism"]["group_index_over_air"] == pytest.approx(told["group_index"], abs=2e-4)
    assert json.loads(catseye("glass", "N-BK7", "--json")[1])["prism"]["air"] == "20 °C, 933 hPa, 50 %"


def test_metres_typed_as_millimetres_are_refused_by_command_and_call(asked):
    """A prism of 0.0381 mm was "good"."""
    status, out, err = asked("N-BK7", "--height-mm", 0.0381)
    assert (status, out) == (2, "")
    assert "--height-mm = 0.0381 is not a prism's height (expected 1 to 1000)" in err
    with pytest.raises(ArgumentError, match=r"^height_mm = 0\.0381 is not"):
        catseye_glass("N-BK7", height_mm=0.0381)


def test_a_prism_in_the_back_of_a_mirror_has_the_constant_of_its_geometry(asked):
    """Unfolded slab: half the group path to a plane through the mirror's face, by Snell, at 0 and 30 degrees."""
    status, out, err = asked("BK7-old", "--height-mm", 12.7, "--plate-mm", 20, "--json")
    assert (status, err) == (0, "")
    answer = json.loads(out)
    plate, body = answer["plate"], answer["prism"]
    assert plate["notes_range_constant"] == pytest.approx(0.6061e-3, abs=5e-8)
    height, n, group = 0.0127, body["phase_index_over_air"], body["group_index_over_air"]
    assert plate["range_constant"] == pytest.approx(0.020 - group * height, abs=1e-12)
    inside = asin(0.5 / n)
    through = group * height / cos(inside) - height * tan(inside) * 0.5
    oblique = 0.020 * cos(pi / 6.0) - through  # to be added to the measured length
    assert plate["change_at_30_deg"] == pytest.approx(oblique - plate["range_constant"], abs=1e-9)
    assert "+0.6007 mm from" in asked("BK7-old", "--height-mm", 12.7, "--plate-mm", 20)[1]


def test_a_plate_that_is_none_or_has_no_glass_is_wrong_usage(asked):
    assert asked("BK7-old", "--plate-mm", 0)[0] == 2
    assert asked("--plate-mm", 20)[0] == 2
    assert json.loads(asked("BK7-old", "--json")[1])["plate"] is None
