"""Registry of parameters: legal values, and its table in the documentation."""

import re

import pytest

from catseye.coordinator.control.registry import LONGEST_VALUE, ROWS, number_text
from catseye.errors import InputError
from repository import ROOT


def test_numbers_read_back_in_their_usual_form():
    for text, expected in (("20.0", "20"), ("2.50", "2.5"), ("6e2", "600")):
        assert ROWS["round_s"].normalised(text) == expected
        assert float(number_text(float(expected))) == float(text)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("round_s", "1", "round_s 1 is not legal (expected 2 to 600 s)"),
        ("round_s", "nan", "round_s nan is not legal (expected 2 to 600 s)"),
        ("round_s", "ten", "round_s 'ten' is not a number (expected 2 to 600 s)"),
        ("cycles", "1.5", "cycles 1.5 is not legal (expected 1 to 65536, an integer)"),
        ("air_model", "mine", "air_model 'mine' (expected "),
        ("scan_list", "A" * (LONGEST_VALUE + 1), f"scan_list: {LONGEST_VALUE + 1} characters (limit {LONGEST_VALUE})"),
    ],
)
def test_illegal_value_is_refused_with_value_and_limit(name, text, words):
    with pytest.raises(InputError) as refused:
        ROWS[name].normalised(text)
    assert words in str(refused.value)


def test_page_has_a_row_for_each_parameter():
    page = (ROOT / "docs" / "formats" / "ziy.md").read_text(encoding="utf-8")
    section = page.partition("## Parameters\n")[2].partition("\n## ")[0]
    rows = {
        row[0]: row[1:] for row in re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \| (.*?) \|$", section, re.M)
    }
    expected = {n: (r.unit.replace("deg", "°"), r.legal, r.changes, r.meaning) for n, r in ROWS.items()}
    assert rows == expected
