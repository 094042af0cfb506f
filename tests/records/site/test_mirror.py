"""A mirror's sheet: what it may say of axes, amplitude coupling and cyclic deviation, and what belongs together."""

import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.mirror import Mirror
from repository import TESTS

SHEET = (TESTS / "vectors" / "formats" / "mirror-1.toml").read_text(encoding="utf-8")


def sheet(tmp_path, more):
    (tmp_path / "ZP101.toml").write_text(f"{more}\n{SHEET}", encoding="utf-8")
    return read_record(tmp_path / "ZP101.toml", Mirror)


def test_a_sheet_without_these_keys_knows_of_no_effect(tmp_path):
    mirror = sheet(tmp_path, "")
    assert (mirror.axis_offset_mm, mirror.mirror_offset_mm, mirror.beam_x_mm, mirror.beam_y_mm) == (0.0,) * 4
    assert mirror.u_axis_mm is mirror.u_amplitude_to_phase_rad is mirror.u_cyclic_mm is None
    assert mirror.cyclic_cosine_mm == mirror.cyclic_sine_mm == ()


def test_values_with_their_uncertainties_are_read_as_written(tmp_path):
    mirror = sheet(
        tmp_path,
        "axis_offset_mm = -0.12\nmirror_offset_mm = 0.3\nbeam_x_mm = 1\nu_axis_mm = 0.01\n"
        "amplitude_to_phase_rad = -0.002\nu_amplitude_to_phase_rad = 0.0005\n"
        "cyclic_cosine_mm = [0.01, 0]\ncyclic_sine_mm = [-0.02, 0.005]\nu_cyclic_mm = 0.002",
    )
    assert mirror.axis_offset_mm == -0.12
    assert mirror.beam_x_mm == 1.0
    assert mirror.cyclic_sine_mm == (-0.02, 0.005)
    assert Mirror.model_validate(mirror.model_dump()) == mirror


@pytest.mark.parametrize("u", ["u_axis_mm = 0.01", "u_amplitude_to_phase_rad = 1e-3", "u_cyclic_mm = 0.005"])
def test_an_uncertainty_may_stand_alone(tmp_path, u):
    assert getattr(sheet(tmp_path, u), u.split(" ")[0]) > 0.0


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ("axis_offset_mm = 0.3", "axis_offset_mm = 0.3 has no u_axis_mm (expected its standard uncertainty)"),
        ("mirror_offset_mm = -0.3", "mirror_offset_mm = -0.3 has no u_axis_mm (expected"),
        ("beam_x_mm = 0.1", "beam_x_mm = 0.1 has no u_axis_mm"),
        ("beam_y_mm = 0.1\nu_cyclic_mm = 0.1", "beam_y_mm = 0.1 has no u_axis_mm"),
        ("amplitude_to_phase_rad = 1e-3", "amplitude_to_phase_rad = 0.001 has no u_amplitude_to_phase_rad"),
        ("cyclic_cosine_mm = [0, 0.1]\ncyclic_sine_mm = [0, 0]", "cyclic_cosine_mm = [0.0, 0.1] has no u_cyclic_mm"),
        ("cyclic_cosine_mm = [0]\ncyclic_sine_mm = [1e-3]", "cyclic_sine_mm = [0.001] has no u_cyclic_mm"),
        ("detector_lag_rad = 0.02", "detector_lag_rad = 0.02 has no u_image_um (expected its standard uncertainty)"),
        ("u_image_um = 5", "detector_radius_mm is missing beside u_image_um (expected both or none)"),
        ("detector_radius_mm = 0.1", "u_image_um is missing beside detector_radius_mm (expected both or none)"),
        (
            "detector_radius_mm = 0.1\nu_image_um = 5\nimage_offset_um = 90",
            "image_offset_um + 3 u_image_um = 105 um is beyond the disc (expected up to 100, by detector_radius_mm)",
        ),
        (
            "cyclic_cosine_mm = [0.1]\nu_cyclic_mm = 0.01",
            "cyclic_cosine_mm has 1 orders, cyclic_sine_mm 0 (expected as many of each)",
        ),
        ("axis_offset_mm = 30\nu_axis_mm = 0.1", "axis_offset_mm = 30 (expected -10 to 10)"),
        ("u_axis_mm = 0", "u_axis_mm = 0 (expected above 0 to 100)"),
        ("u_amplitude_to_phase_rad = 0.0", "u_amplitude_to_phase_rad = 0.0"),
        ("cyclic_cosine_mm = 0.1", "cyclic_cosine_mm = 0.1 (expected a list)"),
        ("cyclic_cosine_mm = [2.0]\ncyclic_sine_mm = [0.0]\nu_cyclic_mm = 1.0", "cyclic_cosine_mm"),
    ],
)
def test_inconsistent_keys_are_refused_in_one_line(tmp_path, more, problem):
    with pytest.raises(InputError) as caught:
        sheet(tmp_path, more)
    assert str(caught.value).startswith("ZP101.toml: ")
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)
