"""A night, a shot and the examples from Python: pages, examples copied, arguments refused by name."""

import pytest

import catseye
from catseye.errors import ArgumentError, InputError


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
