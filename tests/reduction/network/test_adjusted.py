"""An adjusted network judges itself: agreement, claims, blunders, no answer; and its treatment says what it did."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f, norm

from catseye.errors import ArgumentError, EstimationError
from catseye.estimation.network.adjustment import adjust_network
from catseye.gateways.network.summary import passages
from catseye.records.network.any_file import read_network
from catseye.reduction.network.adjusted import adjusted, adjusted_network
from catseye.reduction.network.comparison import compared
from catseye.reduction.network.plan import MonteCarloOptions, PlanOptions, planned
from catseye.reduction.network.treatment import AdjustmentOptions
from repository import ROOT, TESTS

NETWORKS = TESTS / "vectors" / "networks"
EXAMPLES = ROOT / "examples" / "networks"


@pytest.fixture(scope="module")
def tunnel():
    return adjusted_network(adjust_network(read_network(NETWORKS / "monitoring" / "phase-0-1TK.gkf")))


@pytest.fixture(scope="module")
def ranging():
    return adjusted_network(adjust_network(read_network(NETWORKS / "ranging-18x500")))


@pytest.fixture(scope="module")
def ring():
    return read_network(EXAMPLES / "ground-ring")


def with_error(network, row, error):
    """The same ranges with an error in one of them."""
    ranges, *others = network.groups
    observed = ranges.observed.copy()
    observed[row] += error
    return replace(network, groups=(replace(ranges, observed=observed), *others))


def test_a_good_network_is_called_good(ranging, tunnel):
    assert ranging.verdict.word == "good"
    assert "checked by others" not in ranging.verdict.why
    assert "but 3 of them are not checked by others" in tunnel.verdict.why  # 211 was sighted once


@pytest.mark.parametrize(("factor", "word"), [(0.5, "101 % more"), (3.0, "66 % less")])
def test_wrong_claims_are_detected_by_the_scatter(tunnel, factor, word):
    groups = tuple(replace(g, covariance=g.covariance * factor**2) for g in tunnel.network.groups)
    found = adjusted_network(adjust_network(replace(tunnel.network, groups=groups)))
    assert found.verdict.word == "doubtful"
    ratio = np.sqrt(found.global_test.factor)
    assert ratio * factor == pytest.approx(np.sqrt(tunnel.global_test.factor), rel=1e-6)
    assert word.split()[-1] in found.verdict.why
    # a [pvv] so small comes by chance less often than once in ten thousand: the claim, or its unit, is in doubt
    assert ("unit" in found.verdict.why) == (factor == 3.0)
    assert f"{abs(100 * (ratio - 1)):.0f} %" in found.verdict.why


def test_a_blunder_is_named_with_its_size(ranging):
    found = adjusted_network(adjust_network(with_error(ranging.network, 1234, 0.002)))
    word, text = found.verdict
    assert word == "doubtful"
    assert found.suspects[0] == 1234
    assert ranging.label(1234) in text
    size = float(re.search(r"as if it were wrong by ([-\d.]+) mm", text).group(1))
    assert size == pytest.approx(2.0, abs=0.4)


def test_a_network_without_an_answer_says_why(tunnel):
    points = tunnel.network.points
    loose = replace(tunnel.network, points=replace(points, datum=np.zeros_like(points.datum)))
    found = adjusted(loose)
    assert not found.answered
    assert found.verdict.word == "failed"
    assert found.verdict.why == f"no answer: {found.solution.status}"


def test_one_blunder_is_likely_as_claimed_and_left_out_on_request(ring):
    network = with_error(ring, 5, 0.01)
    claimed, without = adjusted(network), adjusted(network, AdjustmentOptions(reject=True))
    assert claimed.treatment.method == "plain"
    assert claimed.table.active.all()
    assert claimed.likely.tolist() == without.likely.tolist() == [5]
    assert without.treatment.method == "rejected"
    assert not without.table.active[5]
    assert (claimed.verdict.word, without.verdict.word) == ("doubtful", "good")
    assert without.verdict.why.endswith(", 1 left out")


def test_a_constant_left_out_is_an_error_that_all_ranges_share(tmp_path):
    """With --reject no single range is to blame; the large sigmas of the last solution are no claim of their maker."""
    stations = {"A": (0, 0, 0), "B": (60, 2, 1), "C": (55, 48, -0.5), "D": (-3, 50, 2), "E": (30, 25, 15)}
    targets = {"S": (20.5, 31.2, 6.1), "T": (41.3, 12.7, 8.4)}
    points = [f"{name},{x},{y},{z},fixed" for name, (x, y, z) in stations.items()]
    ranges = [
        f"{one},{other},{np.linalg.norm(np.subtract(stations[one], targets[other])) + 0.0345:.4f},0.0005"
        for one in stations
        for other in targets
    ]
    (tmp_path / "points.csv").write_text("\n".join(["point,x,y,z,role", *points]) + "\n")
    (tmp_path / "ranges.csv").write_text("\n".join(["from,to,distance,sigma", *ranges]) + "\n")
    found = adjusted(read_network(tmp_path), AdjustmentOptions(reject=True))
    assert found.verdict.word == "doubtful"
    assert found.verdict.why.startswith("10 of 10 observations contradict each other, and which are wrong")
    assert "such as a constant" in found.verdict.why
    assert found.treatment.notes[0].startswith("which of the contradicting observations are wrong is undecided")


def test_a_weight_tells_how_far_each_observation_counts(ring):
    found = adjusted(with_error(ring, 5, 0.01), AdjustmentOptions(robust="igg3"))
    weights = found.in_table(found.treatment.weights)
    assert found.treatment.method == "igg3"
    assert weights[5] < 1e-3 < 0.1 < np.median(weights)


@pytest.mark.parametrize(
    ("options", "kind", "said"),
    [
        ({"robust": "strange"}, EstimationError, "robust method 'strange' is unknown"),
        ({"components": "strange"}, EstimationError, "expected rangers or groups"),
        ({"level": 0.0}, ArgumentError, "level = 0 is invalid"),
        ({"power": 1.0}, ArgumentError, "power = 1 .expected probabilities"),
        ({"power": 0.04, "mdb_level": 0.05}, ArgumentError, "the power above the level"),
        ({"reject": True, "robust": "huber"}, ArgumentError, "either weigh or leave out"),
    ],
)
def test_invalid_options_are_refused_before_any_work(options, kind, said):
    with pytest.raises(kind, match=said):
        AdjustmentOptions(**options)


def test_detectable_errors_are_those_of_the_level_and_the_power(ring):
    """An error is found when it moves w by the sum of both quantiles, where one tail counts; its effects follow."""
    usual, found = adjusted(ring), adjusted(ring, AdjustmentOptions(power=0.95, mdb_level=0.01))
    shift = norm.isf(0.005) + norm.isf(0.05)
    assert found.detectability.noncentrality == pytest.approx(shift, rel=1e-3)  # 4.13 stands for 4.1321
    t = found.table
    np.testing.assert_allclose(t.mdb * np.sqrt(t.redundancy) / t.u, shift, rtol=1e-3)
    for name in ("bias_to_noise", "effect"):
        ratio = getattr(t, name) / getattr(usual.table, name)
        np.testing.assert_allclose(ratio, shift / (norm.isf(0.0005) + norm.isf(0.2)), rtol=1e-4)
    row = 7
    wrong = adjusted(with_error(ring, row, t.mdb[row]))
    moved = np.linalg.norm(wrong.x - found.x, axis=1)
    assert moved[t.ends[row, :2]].max() == pytest.approx(t.effect[row], rel=1e-3)
    shifted = wrong.table.standardised[row] - found.table.standardised[row]
    assert shifted == pytest.approx(shift, rel=2e-3)
    assert "(1 %, power 95 %)" in " ".join(p.text for p in passages(found))


def test_an_ellipse_in_plan_holds_its_axes_and_its_bearing_in_any_axes_of_the_file(tunnel, ring):
    for found in (tunnel, adjusted(ring)):
        plan = found.solution.covariance[:, :2, :2]
        turn = found.ellipse.bearing[:, None]
        for along, axis in ((0.0, found.ellipse.major), (0.5 * np.pi, found.ellipse.minor)):
            unit = np.stack([np.sin(turn + along), np.cos(turn + along)], axis=-1)[:, 0]
            variance = np.einsum("ni,nij,nj->n", unit, plan, unit)
            np.testing.assert_allclose(variance, axis**2, rtol=1e-6, atol=1e-20)
        np.testing.assert_allclose(found.u_position**2, np.nansum(found.u**2, axis=1), rtol=1e-12)


def test_a_point_is_within_its_ellipse_as_often_as_is_said(tunnel):
    assert tunnel.coverage(3) == pytest.approx((0.1987, 2.7955), abs=6e-5)  # chi-square tables
    scaled = adjusted_network(tunnel.solution, scaled=True)
    inside, factor = scaled.coverage(2)
    freedom = tunnel.solution.degrees_of_freedom
    assert inside == pytest.approx(f.cdf(0.5, 2, freedom))
    assert f.cdf(factor**2 / 2, 2, freedom) == pytest.approx(0.95)


def test_a_network_without_heights_has_its_ellipses_in_plan():
    plane = adjusted(read_network(NETWORKS / "dimensions" / "plane-datum.gkf"))
    free = ~plane.network.points.fixed.any(axis=1)
    assert np.isnan(plane.covariance[:, 2, 2]).all()
    assert (plane.ellipse.major[free] > 0.0).all()
    np.testing.assert_allclose(plane.ellipse.major, plane.ellipsoid.semi_axes[:, 0], rtol=1e-9)


def test_a_comparison_is_at_most_as_good_as_its_epochs(ring):
    good, bad = adjusted(ring), adjusted(with_error(ring, 5, 0.01))
    names = ring.points.names[:6]
    assert compared(good, good, points=names).verdict.word == "good"
    verdict = compared(good, bad, points=names).verdict
    assert verdict.word == "doubtful"
    assert verdict.why == f"the second epoch: {bad.verdict.why}"


def test_a_plan_says_which_observation_is_indispensable_and_what_is_unchecked(tunnel):
    network = read_network(EXAMPLES / "feed-arm.toml", planned=True)
    found = planned(network, PlanOptions(most=3, budget_s=10.0, monte_carlo=MonteCarloOptions(runs=2)))
    assert (found.verdict.word, len(found.plan.candidates), found.scatter.asked) == ("good", 3, 2)
    assert found.picked
    scattered = replace(found, scatter=replace(found.scatter, ratio=1.5))
    assert scattered.verdict.why == "in the Monte Carlo the departures are 1.50 times the claimed uncertainties"
    needed = replace(found, plan=replace(found.plan, worth=tuple(np.full_like(w, np.inf) for w in found.plan.worth)))
    assert "observations are indispensable" in needed.verdict.why


def test_nothing_of_gateways_is_needed_for_an_answer_and_its_verdict():
    """The recipe runs and judges in a process in which no writer of a network was ever imported."""
    code = (
        "import sys, catseye\n"
        "answer = catseye.adjust('networks/ground-ring', 'networks/ground-ring')\n"
        "assert answer.verdict.word and answer.first.verdict.word and catseye.plan('networks/feed-arm.toml').verdict\n"
        "print([name for name in sys.modules if name.startswith('catseye.gateways.network')])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"
