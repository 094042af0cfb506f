"""A night, a shot and the examples from Python: pages, examples copied, arguments refused by name."""

import io
from dataclasses import replace

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from catseye.gateways.epoch.record_tests import listed_tests
from gateways.record_scene import with_checks


@pytest.fixture(scope="module")
def doubted():
    """Night-01 with contradictions, unchecked points and an unmeasured target."""
    night = catseye.reduce("night-01")
    return replace(night, reduction=with_checks(night.reduction))


def test_records_are_a_table_with_the_unit_of_each_row(doubted):
    records = doubted.records
    tests = listed_tests(doubted.reduction.coordinates)
    assert list(records["record"]) == [test.record for test in tests]
    assert list(records["unit"]) == [test.unit for test in tests]
    np.testing.assert_array_equal(records["error"], [test.error for test in tests])
    tested = np.isfinite(records["u_error"])
    np.testing.assert_allclose(records["w"][tested], (records["error"] / records["u_error"])[tested])
    assert records.colnames == doubted.to_table("records").colnames
    assert list(doubted.to_table("contradictions")["contradiction"]) == [1, 1, 1, 2, 2]


def test_contradictions_and_checks_of_a_night(doubted):
    first, second = doubted.contradictions
    assert first.named.record == "monument ZY103"
    assert second.named is None
    assert doubted.unchecked == ("DP003", "ZEG41040L")
    assert doubted.unmeasured == ("ZEG41099L",)
    assert [scatter.name for scatter in doubted.scatter] == ["dish", "feed arm"]
    points = doubted.to_table("points")
    np.testing.assert_array_equal(points["lines"], doubted.lines)
    assert set(points["point"][points["status"] == "unchecked"]) == set(doubted.unchecked)


def test_a_contradicted_night_says_so_in_its_paragraph_and_shows_it(doubted):
    assert "Contradicted by the ranges: monument ZY103; benchmark" in " ".join(repr(doubted).split())
    assert "records" not in repr(replace(doubted, reduction=catseye.reduce("night-01").reduction))
    picture = io.BytesIO()
    catseye.show(doubted, "records")["records"].savefig(picture, format="png")
    assert picture.getvalue().startswith(b"\x89PNG")


def test_a_shot_s_page_and_its_table(tmp_path):
    shot = catseye.explain("night-01", 3, monte_carlo=0)
    assert shot.save_page(tmp_path / "shot.html").read_text().startswith("<!DOCTYPE html>")
    assert shot.lines()[-1].endswith("together")
    with pytest.raises(InputError, match="a page is HTML"):
        shot.save_page(tmp_path / "shot.pdf")
    (tmp_path / "other.html").write_text("mine")
    with pytest.raises(InputError, match="is not a catseye file"):
        shot.save_page(tmp_path / "other.html")
    assert (tmp_path / "other.html").read_text() == "mine"


@pytest.mark.parametrize(("more", "name"), [({"monte_carlo": 10}, "monte_carlo"), ({"seed": -1}, "seed")])
def test_draws_that_show_no_interval_are_refused(more, name):
    with pytest.raises(ArgumentError, match="expected 0") as refused:
        catseye.explain("night-01", 3, **more)
    assert refused.value.names == (name,)


def test_examples_are_copied(tmp_path):
    written = catseye.examples("networks/template", directory=tmp_path / "mine")
    assert sorted(path.name for path in written) == ["README.md", "points.csv", "ranges.csv"]
    with pytest.raises(InputError, match="not empty"):
        catseye.examples(directory=tmp_path / "mine")
