"""Phases at several frequencies, read or refused in one line."""

import pytest

from catseye.errors import InputError
from catseye.records.night.phase_table import read_phases

HEADER = "shot,modulation_hz,phase_rad,u_phase_rad\n"


def test_rows_are_by_shot(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text(HEADER + "A,1.5e9,1,0.001\nB,1.5e9,2,0.001\nA,1.6e9,3,0.001\nB,1.7e9,4,0.001\n")
    shots, hashes = read_phases(file)
    assert {name: [row.phase_rad for row in rows] for name, rows in shots.items()} == {"A": [1, 3], "B": [2, 4]}
    assert list(hashes) == ["t.csv"]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("A,1.5e9,1,0.001\n", "shot A has one frequency"),
        ("A,1.5e9,1,0.001\nA,1.5e9,2,0.001\n", "is in shot A already"),
        ("A,1500,1,0.001\nA,1.5e9,2,0.001\n", "modulation_hz"),
        ("A,1.5e9,1,0\nA,1.6e9,2,0.001\n", "u_phase_rad"),
        ("A,1.5e9,nan,0.001\nA,1.6e9,2,0.001\n", "phase_rad"),
        ("", "has no row"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path, rows, said):
    (tmp_path / "t.csv").write_text(HEADER + rows)
    with pytest.raises(InputError, match=said) as refused:
        read_phases(tmp_path / "t.csv")
    assert "\n" not in str(refused.value)
