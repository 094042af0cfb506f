"""Scatter of many simulated runs against their claims."""

import math

import numpy as np
import pytest

from catseye.service.many.scatter import last_epoch, scatter_of, scatter_text, scatter_verdict
from catseye.verdict import Verdict

RUNS = 400
COORDINATES = 30


def values(seed, size=1.0, *, bias=0.0):
    """Values of runs whose errors are `size` times what is claimed, the beam's with a bias in u."""
    random = np.random.default_rng(seed)
    made = []
    for _ in range(RUNS):
        square = np.sum((size * random.standard_normal(COORDINATES)) ** 2)
        error = size * random.standard_normal() + bias
        part = {"found": 0.2 + 0.3 * error, "u": 0.3, "true": 0.2}
        made.append(
            {
                "coordinates": COORDINATES,
                "chi2_per_coordinate": float(square) / COORDINATES,
                "beam": {"focus_mm": part},
            }
        )
    return made


def test_two_runs_by_hand():
    """chi² 8 of 4 and 1 of 5 coordinates: √(9/9); beam errors of 2 u and -1 u: √(5/2), mean 1/2."""
    runs = [
        {"coordinates": 4, "chi2_per_coordinate": 2.0, "beam": {"focus_mm": {"found": 0.5, "u": 0.1, "true": 0.3}}},
        {"coordinates": 5, "chi2_per_coordinate": 0.2, "beam": {"focus_mm": {"found": 0.2, "u": 0.1, "true": 0.3}}},
    ]
    points, focus = scatter_of(runs)
    assert (points.quantity, points.runs, points.terms) == ("points", 2, 9)
    assert points.ratio == pytest.approx(1.0)
    assert math.isnan(points.mean)
    assert (focus.quantity, focus.runs) == ("focus", 2)
    assert focus.ratio == pytest.approx(math.sqrt(2.5))
    assert focus.mean == pytest.approx(0.5)


@pytest.mark.parametrize("seed", range(3))
def test_right_claims_lie_in_the_band(seed):
    rows = scatter_of(values(seed))
    assert all(row.band[0] < row.ratio < row.band[1] for row in rows)
    assert scatter_verdict(rows, Verdict("good", "all")).word == "good"


def test_claims_too_small_by_a_fifth_are_doubtful():
    rows = scatter_of(values(1, 1.2))
    verdict = scatter_verdict(rows, Verdict("good", "all"))
    assert [row.exceeds for row in rows] == [True, True]
    assert verdict.word == "doubtful"
    assert "errors of points are 1.2" in verdict.why
    assert scatter_verdict(rows, Verdict("failed", "one of them")).word == "failed"


def test_a_biased_beam_shows_in_its_mean():
    _, focus = scatter_of(values(2, bias=0.5))
    assert focus.mean == pytest.approx(0.5, abs=4.0 / math.sqrt(RUNS))
    assert "mean +0." in scatter_text(focus)


def test_last_epoch_that_was_compared_counts():
    beam = {
        "focus_mm": {"found": 0.1, "u": 0.2, "true": 0.0},
        "elevation_arcsec": {"found": None, "u": None, "true": 0},
    }
    compared = {"compared": 7, "rms_mm": 0.1, "mean_u_mm": 0.2, "chi2_per_coordinate": 0.9, "beam": beam}
    epochs = [{"number": 1, **compared}, {"number": 3, **compared, "rms_mm": 0.3}, {"number": 4}]
    last = last_epoch(epochs, reference=2)
    assert (last["coordinates"], last["rms_mm"], set(last["beam"])) == (21, 0.3, {"focus_mm"})
    assert last_epoch(epochs[:1], reference=2)["beam"] == {}
    assert last_epoch([{"number": 4}], reference=2) == {}
    assert scatter_of([{}]) == ()
