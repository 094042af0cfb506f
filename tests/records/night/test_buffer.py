"""One buffer read from every kind of file, or refused in one line."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.buffer import buffer_of, read_buffer
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


def test_a_table_has_volts_or_codes(tmp_path):
    for text, kind, values in (
        ("volt\n0.5\n-1\n2e-3\n", "f", [0.5, -1.0, 0.002]),
        ("code\n5\n-1\n2\n", "i", [5, -1, 2]),
        ("time_s,Volt\n0,1\n1,2\n2,3\n", "f", [1.0, 2.0, 3.0]),
        ("5\n-1\n2\n", "i", [5, -1, 2]),
        ("5\n-1.0\n2\n", "f", [5.0, -1.0, 2.0]),
    ):
        file = tmp_path / "b.csv"
        file.write_text(text)
        read = read_buffer(file)
        assert read.samples.dtype.kind == kind
        assert read.samples.tolist() == values
        assert list(read.hashes) == ["b.csv"]


def test_arrays_are_read_by_row(tmp_path):
    array = np.arange(12, dtype=np.float32).reshape(3, 4)
    np.save(tmp_path / "two.npy", array)
    assert read_buffer(tmp_path / "two.npy", row=1).samples.tolist() == [4.0, 5.0, 6.0, 7.0]
    np.save(tmp_path / "one.npy", array[0])
    assert read_buffer(tmp_path / "one.npy").name == "one.npy"
    assert buffer_of(array, row=2).samples.tolist() == [8.0, 9.0, 10.0, 11.0]


def test_a_shot_is_the_campaigns_buffer():
    shot = read_buffer(NIGHT, shot=120)
    assert shot.name == "night-01, shot 120: ZY115 to DP059"
    assert shot.is_codes
    assert "shots.csv" in shot.hashes
    assert shot.volts_per_code == 10.0 / 32768


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("volt\n1\nx\n3\n", "row 2, 'x' is not a number in column 1"),
        ("volt\n1\nnan\n3\n", "row 2, 'nan' is not a number"),
        ("code\n1\n2.5\n3\n", "not a whole number"),
        ("a,b\n1,2\n", "no column of samples"),
        ("volt,code\n1,2\n", "expected one of them"),
        ("volt\n1\n2\n", "holds 2 samples"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "b.csv").write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_buffer(tmp_path / "b.csv")
    assert "\n" not in str(refused.value)


def test_a_bad_array_is_refused(tmp_path):
    np.save(tmp_path / "words.npy", np.array(["a", "b"]))
    np.save(tmp_path / "things.npy", np.array([{}, {}], dtype=object), allow_pickle=True)
    np.save(tmp_path / "cube.npy", np.zeros((2, 2, 2)))
    (tmp_path / "no.npy").write_bytes(b"not an array")
    (tmp_path / "cut.npy").write_bytes((NIGHT / "frames.npy").read_bytes()[:5000])
    for name, said in (
        ("words", "expected numbers"),
        ("things", "expected numbers"),
        ("cube", "has 3 dimensions"),
        ("no", "expected the .npy signature"),
        ("cut", "cannot be read as an array"),
    ):
        with pytest.raises(InputError, match=said):
            read_buffer(tmp_path / f"{name}.npy", row=0)


@pytest.mark.parametrize(
    ("path", "arguments", "said"),
    [
        (NIGHT, {}, "expected a shot of it"),
        (NIGHT, {"shot": 9999}, "shot 9999 is not there"),
        (NIGHT / "frames.npy", {}, "holds 759 buffers, no row was asked for"),
        (NIGHT / "frames.npy", {"row": 759}, "expected 0 to 758"),
        (NIGHT / "frames.npy", {"row": 0, "shot": 1}, "expected no shot"),
        (ROOT / "examples" / "buffers" / "clipped.csv", {"row": 1}, "row of a .npy file alone"),
        (NIGHT / "nothing.csv", {}, "missing"),
    ],
)
def test_a_row_or_a_shot_that_is_not_there_is_refused(path, arguments, said):
    with pytest.raises(InputError, match=said):
        read_buffer(path, **arguments)


def test_an_array_of_words_is_refused():
    with pytest.raises(InputError, match="expected numbers"):
        buffer_of(np.array(["a"]))
