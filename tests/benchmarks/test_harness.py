"""The benchmarks' harness: whose seconds are whose, what a ratio means, what comes back from a script's file."""

import doctest
import json
import time
from dataclasses import asdict

import numpy as np
import pytest

import guard
import harness
import table
from harness import LIMIT, Contender, Curve, Row, race, raced, read_lines, spread


def scripted(*seconds, share=1.0):
    """Contender that answers with these seconds, one a call, the last for ever."""
    left = list(seconds)
    return Contender(lambda: left.pop(0) if len(left) > 1 else left[0], share=share, timed=True)


def row(**changes):
    fields = {"path": "sum", "what": "n", "ours_s": 2.0, "beside": {"numpy": 5.0}, "limit_s": 1.0, "spread": 0.1}
    return Row(**fields | changes)


@pytest.mark.parametrize("module", [harness, guard, table])
def test_the_examples_run(module):
    found = doctest.testmod(module)
    assert found.attempted
    assert not found.failed


def test_a_ratio_is_how_many_times_our_time_another_takes_and_the_share_of_the_limit():
    assert row().ratios() == {"numpy": 2.5, LIMIT: 0.5}
    assert row(limit_s=None).ratios() == {"numpy": 2.5}


def test_the_first_contender_is_ours_and_each_counts_for_the_whole_work():
    found = raced(
        "sum",
        "n",
        {"catseye": scripted(2.0), "numpy": scripted(1.0, share=0.1), LIMIT: scripted(0.5)},
        quick=True,
        note="exact",
        skipped={"gtsam": "not installed"},
    )
    assert (found.ours_s, found.beside, found.limit_s) == (2.0, {"numpy": 10.0}, 0.5)
    assert (found.spread, found.note, found.skipped) == (0.0, "exact", {"gtsam": "not installed"})


def test_first_calls_do_not_count_and_the_median_does():
    # one call to compile, one to see how long it takes, then the rounds
    seconds = race({"catseye": scripted(90.0, 80.0, 3.0, 1.0, 2.0)}, quick=True)["catseye"]
    np.testing.assert_array_equal(seconds, [3.0, 1.0, 2.0])


def test_a_slow_contender_runs_in_fewer_rounds_and_in_quick_mode_once():
    slow = {"catseye": scripted(0.5), "scipy": scripted(8.0)}
    whole, quick = race(slow, quick=False), race(slow, quick=True)
    assert np.isfinite(whole["scipy"]).sum() == harness.QUICK_ROUNDS < np.isfinite(whole["catseye"]).sum()
    assert np.isfinite(quick["scipy"]).sum() == 1
    assert raced("a", "b", slow, quick=True).beside == {"scipy": 8.0}


def test_rounds_are_taken_in_turn():
    order = []
    contenders = {name: Contender(lambda name=name: order.append(name) or 0.5, timed=True) for name in "abc"}
    race(contenders, quick=True)
    assert "".join(order) == "aabbcc" + "abc" * harness.QUICK_ROUNDS


def test_short_work_is_timed_in_a_loop_by_the_clock_asked_for():
    calls, ticks = [], iter(range(10**6))
    seconds = race({"catseye": Contender(lambda: calls.append(1))}, quick=True, clock=lambda: 0.001 * next(ticks))
    # each look at this clock is 1 ms after the last, so that a call seems to take 1 ms and 20 fill a timing
    assert len(calls) == 2 + 20 * harness.QUICK_ROUNDS
    np.testing.assert_allclose(seconds["catseye"], 0.001 / 20)


def test_work_is_timed():
    seconds = race({"catseye": Contender(lambda: time.sleep(0.03))}, quick=True)["catseye"]
    assert (seconds >= 0.03).all()  # a sleep is never shorter


def test_spread_is_the_quartile_distance_of_ratios_over_their_median():
    ours, other = np.array([1.0, 2.0, 4.0, np.nan]), np.array([2.0, 6.0, 16.0, 1.0])  # ratios 2, 3, 4
    assert spread(ours, other) == pytest.approx(1.0 / 3.0)
    assert spread(ours) == pytest.approx((3.0 - 1.5) / 2.0)
    assert spread(np.array([np.nan])) == 0.0


@pytest.mark.parametrize("power", [0.5, 1.0, 2.7])
def test_the_exponent_is_the_slope_of_the_logarithms(power):
    sizes = (10.0, 20.0, 50.0, 400.0)
    exact = Curve("a", "b", "n", sizes, tuple(3e-4 * n**power for n in sizes))
    assert exact.exponent() == (pytest.approx(power, abs=1e-3), 0.0)
    bent = Curve("a", "b", "n", sizes, tuple(n**power * f for n, f in zip(sizes, (1.0, 1.5, 0.8, 1.0), strict=True)))
    off, u = bent.exponent()
    assert abs(off - power) < 3.0 * u


def test_the_last_exponent_is_that_of_the_two_largest_sizes():
    """A constant part hides the growth of small sizes."""
    sizes = (1.0, 10.0, 1e4, 1e5)
    curve = Curve("a", "b", "n", sizes, tuple(1.0 + 1e-2 * n**2 for n in sizes))
    assert curve.last_exponent() == pytest.approx(2.0, abs=1e-3)
    assert curve.exponent()[0] < 1.9


def test_lines_of_a_script_come_back(tmp_path, monkeypatch, capsys):
    curve = Curve("sum", "GB", "n", (1.0, 2.0), (0.5, 1.0), "GB")
    monkeypatch.setattr("sys.argv", ["bench_sum.py", "--quick", "--curves", "--lines", str(tmp_path / "lines")])
    harness.main(lambda quick: iter([row(note=f"quick {quick}")]), lambda quick: iter([curve]))
    assert read_lines(tmp_path / "lines") == ([row(note="quick True")], [curve])
    said = capsys.readouterr().out
    assert "2.5 x" in said
    assert "0.5 of it" in said
    assert "0.5 GB" in said
    assert read_lines(tmp_path / "none") == ([], [])


def test_a_row_is_plain_json():
    assert Row(**json.loads(json.dumps(asdict(row(skipped={"a": "b"}))))) == row(skipped={"a": "b"})
