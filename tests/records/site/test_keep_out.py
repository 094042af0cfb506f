import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.keep_out import KeepOut
from repository import ROOT

EXAMPLE = ROOT / "examples" / "keep-out.toml"
ROOM = '[[box]]\nname = "room"\nwhy = "people"\n'


def read(tmp_path, text):
    (tmp_path / "keep-out.toml").write_text(text, encoding="utf-8")
    return read_record(tmp_path / "keep-out.toml", KeepOut)


def test_the_example_in_metres_and_radians():
    kept = read_record(EXAMPLE, KeepOut)
    room, path, tower = kept.boxes()
    assert room.centre.tolist() == [147.5, -21.0, 4.5]
    assert room.size.tolist() == [25.0, 18.0, 9.0]
    assert path.turn == pytest.approx(np.pi / 6)
    assert [b.length for b in (room, path, tower)] == [400.0] * 3
    assert kept.sun.half_angle_deg == 5.0
    assert kept.margin_counts == (20.0, 20.0)


def test_missing_values_have_defaults(tmp_path):
    kept = read(tmp_path, ROOM + "low_mm = [0, 0, 0]\nhigh_mm = [1000, 2000, 3000]\n")
    assert kept.sun.half_angle_deg == 5.0
    assert kept.boxes()[0].length == np.inf
    assert kept.boxes()[0].size.tolist() == [1.0, 2.0, 3.0]


def test_why_is_stored_in_one_line(tmp_path):
    text = '[[box]]\nname = "room"\nwhy = """people\n  work"""\nlow_mm = [0, 0, 0]\nhigh_mm = [1000, 2000, 3000]\n'
    assert read(tmp_path, text).boxes()[0].why == "people work"


def test_both_ways_of_giving_a_box_agree(tmp_path):
    a = read(tmp_path, ROOM + "low_mm = [100, 200, 300]\nhigh_mm = [1100, 2200, 3300]\nturn_deg = 10\n").boxes()[0]
    b = read(tmp_path, ROOM + "centre_mm = [600, 1200, 1800]\nsize_mm = [1000, 2000, 3000]\nturn_deg = 10\n").boxes()[0]
    assert a.centre.tolist() == b.centre.tolist()
    assert a.size.tolist() == b.size.tolist()
    assert a.turn == b.turn


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            ROOM + "low_mm = [0, 0, 5000]\nhigh_mm = [1000, 2000, 3000]\n",
            "low_mm = 5000 is not below high_mm = 3000 along z",
        ),
        (ROOM + "low_mm = [0, 0, 0]\nhigh_mm = [10, 20, 3.0]\n", "along x, 10 mm looks like metres"),
        (ROOM + "low_mm = [0, 0, 0]\nhigh_mm = [1000, 2000, 0.01]\n", "along z, 0.01 mm (expected 50 to 1e+06)"),
        (ROOM + "centre_mm = [0, 0, 0]\nsize_mm = [1000, -2000, 500]\n", "along y, -2000 mm"),
        (ROOM + "centre_mm = [0, 2e7, 0]\nsize_mm = [1000, 2000, 500]\n", "y = 2e+07 mm"),
        (ROOM + "low_mm = [0, 0, 0]\nsize_mm = [1000, 2000, 500]\n", "defined by low_mm, size_mm"),
        (ROOM, "defined by nothing"),
        ('[[box]]\nname = "room"\nlow_mm = [0, 0, 0]\nhigh_mm = [1000, 1000, 1000]\n', "why is missing"),
        (2 * (ROOM + "low_mm = [0, 0, 0]\nhigh_mm = [1000, 2000, 3000]\n"), "given twice"),
        ("[sun]\nhalf_angle_deg = 0.0873\n", "half_angle_deg = 0.0873"),
        ("[sun]\nhorizon_deg = 10\n", "horizon_deg"),
        ("beam_length_m = 400000\n", "beam_length_m"),
        ("half_angle_deg = 5\n", "half_angle_deg"),
        ('format = "catseye-keep-out-2"\n', "catseye-keep-out-1"),
        (ROOM + "low_mm = [0, 0, nan]\nhigh_mm = [1000, 2000, 3000]\n", "low_mm"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError) as refused:
        read(tmp_path, text)
    assert said in str(refused.value)
    assert str(refused.value).startswith("keep-out.toml: ")
    assert "\n" not in str(refused.value)
