"""The file of a beam train: what is read, and what is refused in one line."""

import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.beam import BeamTrain
from repository import ROOT

EXAMPLE = ROOT / "examples" / "beams" / "head.toml"


def test_the_example_loads_with_its_defaults():
    train = read_record(EXAMPLE, BeamTrain)
    assert train.wavelength_um == 0.780
    assert [e.kind for e in train.outward[:3]] == ["space", "lens", "lens"]
    assert train.outward[0].transmission == 1.0
    assert train.laser.quality_x == 1.0
    assert train.serial is None


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("wavelength_um = 0.780", "wavelength_um = 780.0", "wavelength_um = 780.0 looks like nanometres"),
        ('format = "catseye-beam-1"', "", "format is missing"),
        ('format = "catseye-beam-1"', 'format = "catseye-beam-7"', "catseye-beam-1"),
        ("divergence_x_deg = 10.0", "divergence_x_deg = 10.0\nwaist_x_um = 2.0", "one of them"),
        ("focal_length_mm = 20.0", "focal_length_mm = 0.0", "focal_length_mm = 0"),
        ("focal_length_mm = 20.0", "focal_length_mm = 20.0\ncoating = 'gold'", "does not belong to kind = 'lens'"),
        ("focal_length_mm = 20.0", "", "focal_length_mm is missing"),
        ("transmission = 0.92", "transmission = 1.92", "transmission = 1.92"),
        ("capacitance_pf = 0.5", "", "go together"),
        ("offset_um = 10.0", "offset_um = 101.0", "offset_um = 101 is outside the disc"),
        ("radius_mm = 25.4", "radius = 25.4", "perhaps radius_mm"),
        ('kind = "isolator"', 'kind = "isolater"', "isolater"),
        ("distance_m = 100.0", "distance_m = nan", "distance_m"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, old, new, text):
    original = EXAMPLE.read_text()
    assert old in original
    file = tmp_path / "bad.toml"
    file.write_text(original.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_record(file, BeamTrain)
    said = str(caught.value)
    assert text in said
    assert said.startswith("bad.toml: ")
    assert "\n" not in said
