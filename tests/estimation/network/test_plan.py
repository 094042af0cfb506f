"""Plans: predicted worth against adjusting with one observation more or less, and against measuring on paper."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.model import NetworkParameter
from catseye.estimation.network.plan import plan, predicted, schedule


def mean_u(network, interest):
    """Adjusted anew, nothing of the plan's algebra."""
    covariance = adjust_network(network).covariance[interest]
    return float(np.sqrt(np.trace(covariance.sum(axis=0)) / (3 * interest.sum())))


def with_more(network, pairs, sigma):
    """The network with further ranges, as predicted at its coordinates."""
    ranges, index = network.groups[0], {n: i for i, n in enumerate(network.points.names)}
    more = np.array([[3 * index[a], 3 * index[b]] for a, b in pairs])
    longer = replace(
        ranges,
        observed=np.concatenate([ranges.observed, np.zeros(len(pairs))]),
        covariance=np.concatenate([ranges.covariance, np.asarray(sigma) ** 2]),
        origin=np.concatenate([ranges.origin, more[:, 0]]),
        target=np.concatenate([ranges.target, more[:, 1]]),
    )
    return predicted(replace(network, groups=(longer,)))


def test_predicted_gain_of_a_candidate_equals_gain_of_adjusting_with_it(ranging_network):
    network, _ = ranging_network(1, stations=8, seen=0.8)
    worth = plan(network, most=200)
    assert len(worth.candidates) == 8 * 12
    for candidate in (worth.candidates[0], worth.candidates[30], worth.candidates[-1]):
        bigger = with_more(network, [(candidate.from_, candidate.to)], [candidate.u])
        assert candidate.u == pytest.approx(5e-5, rel=1e-9)
        assert candidate.mean_u == pytest.approx(mean_u(bigger, worth.interest), rel=1e-7)
        assert candidate.gain == pytest.approx(worth.mean_u - candidate.mean_u, rel=1e-9)
    gains = [c.gain for c in worth.candidates]
    assert gains == sorted(gains, reverse=True)
    assert gains[-1] > 0.0


def test_worth_of_an_observation_is_the_loss_without_it(ranging_network):
    network, _ = ranging_network(2, stations=7)
    network = predicted(network)
    worth = plan(network)
    for row in (0, 17, 50):
        active = np.ones(len(network.groups[0].observed), dtype=bool)
        active[row] = False
        without = adjust_network(network, active=[active]).covariance
        left = float(np.sqrt(np.trace(without.sum(axis=0)) / (3 * len(without))))
        assert worth.worth[0][row] == pytest.approx(left - worth.mean_u, rel=1e-6)


def test_parameters_count_in_the_worth_of_an_observation(ranging_network):
    network, _ = ranging_network(3, stations=8)
    ranges, n = network.groups[0], network.points.xyz.size
    zeros = replace(ranges, nuisance=(n + ranges.origin // 3)[:, None])
    network = predicted(
        replace(network, parameters=tuple(NetworkParameter(f"zero {i}", sigma=1e-3) for i in range(8)), groups=(zeros,))
    )
    worth = plan(network)
    active = np.ones(len(ranges.observed), dtype=bool)
    active[5] = False
    without = adjust_network(network, active=[active]).covariance
    left = float(np.sqrt(np.trace(without.sum(axis=0)) / (3 * len(without))))
    assert worth.worth[0][5] == pytest.approx(left - worth.mean_u, rel=1e-6)


def test_a_range_without_which_a_point_floats_is_worth_everything(ranging_network):
    network, _ = ranging_network(4)
    keep = (network.groups[0].target != 3 * 10) | (network.groups[0].origin < 9)
    part = {k: getattr(network.groups[0], k)[keep] for k in ("observed", "covariance", "origin", "target")}
    worth = plan(replace(network, groups=(replace(network.groups[0], **part),)))
    needed = part["target"] == 3 * 10
    assert np.isinf(worth.worth[0][needed]).all()
    assert np.isfinite(worth.worth[0][~needed]).all()


def test_schedule_keeps_the_time_of_every_ranger_and_its_predicted_uncertainty(ranging_network):
    network, _ = ranging_network(5, stations=8, seen=0.8)
    worth = plan(network)
    picked = schedule(worth, budget_s=10.0, shot_s=3.0)
    assert len(picked) == 8 * 3
    for station in {c.from_ for c in picked}:
        assert max(c.at_s for c in picked if c.from_ == station) <= 10.0
    bigger = with_more(network, [(c.from_, c.to) for c in picked], [c.u for c in picked])
    assert picked[-1].mean_u == pytest.approx(mean_u(bigger, worth.interest), rel=1e-6)
    assert all(a.mean_u > b.mean_u for a, b in pairwise(picked))
    new = schedule(worth, budget_s=1e6, shot_s=1.0, repeats=False)
    measured_now = set(zip(network.groups[0].origin // 3, network.groups[0].target // 3, strict=True))
    names = network.points.names
    assert not measured_now & {(names.index(c.from_), names.index(c.to)) for c in new}
    assert len({(c.from_, c.to) for c in new}) == len(new) == 96 - len(measured_now)


def test_the_first_of_a_schedule_is_the_best_candidate(ranging_network):
    network, _ = ranging_network(6, stations=9, seen=0.8)
    worth = plan(network)
    first = schedule(worth, budget_s=1.0, shot_s=1.0, most=1)[0]
    assert (first.from_, first.to) == (worth.candidates[0].from_, worth.candidates[0].to)
    assert first.gain == pytest.approx(worth.candidates[0].gain, rel=1e-9)


def test_the_points_of_interest_decide_what_is_best(ranging_network):
    network, _ = ranging_network(7)
    for name in ("T003", "T009"):
        assert plan(network, interest=[name]).candidates[0].to == name
    with pytest.raises(EstimationError, match="'X' is not in the network"):
        plan(network, interest=["X"])


def test_floating_plan_names_the_floating_points(ranging_network):
    network, _ = ranging_network(8)
    keep = (network.groups[0].target != 3 * 10) | (network.groups[0].origin < 6)
    part = {k: getattr(network.groups[0], k)[keep] for k in ("observed", "covariance", "origin", "target")}
    with pytest.raises(EstimationError, match=r"T005 \(2 observations\) floats"):
        plan(replace(network, groups=(replace(network.groups[0], **part),)))
    xyz = network.points.xyz.copy()
    xyz[3] = np.nan
    with pytest.raises(EstimationError, match="S04: no coordinates"):
        plan(replace(network, points=replace(network.points, xyz=xyz)))
