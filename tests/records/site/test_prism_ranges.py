"""Ranges to prisms: a table of one's own, ranges.csv of a reduced night, and refusals with their line."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.site.prism_ranges import read_prism_ranges

HEAD = "ranger,target,range_m,u_range_mm\n"


@pytest.fixture
def table(tmp_path):
    def written(text):
        path = tmp_path / "r.csv"
        path.write_text(text)
        return path

    return written


def test_a_table_has_its_claims_and_empty_ones(table):
    found = read_prism_ranges(table(HEAD + "ZY113,TR01-L,97.5,0.02\nZY113,TR01-R,97.25,\n"))
    assert found.target == ("TR01-L", "TR01-R")
    np.testing.assert_array_equal(found.distance, [97.5, 97.25])
    np.testing.assert_allclose(found.u, [20e-6, np.nan])
    assert found.lines == (2, 3)
    assert np.isnan(read_prism_ranges(table("target,ranger,range_m\nTR01-L,ZY113,97.5\n")).u).all()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ranger,target\nA,B\n", "column 'range_m' is missing"),
        (HEAD + "ZY113,TR01-L,97500,0.02\n", "line 2, range_m = 97500 (expected 0.5 to 2000 m)"),
        (HEAD + "ZY113,TR01-L,97.5,0\n", "line 2, u_range_mm = 0 (expected above 0"),
        (HEAD + "ZY113,,97.5,1\n", "line 2, target is empty"),
        (HEAD + "ZY113,TR01-L,far,1\n", "range_m = 'far' (expected a finite number)"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(table, text, said):
    with pytest.raises(InputError) as problem:
        read_prism_ranges(table(text))
    assert said in str(problem.value)
