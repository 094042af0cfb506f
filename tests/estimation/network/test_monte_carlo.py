"""Simulated runs: what is drawn, that runs do not depend on their division, and scatter against the claim."""

import json
from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.least_squares.status import AdjustmentOutcome, Status
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.network.monte_carlo import (
    BLOCK,
    Disturbance,
    NetworkSimulation,
    RunSums,
    chunks,
    scatter_of,
    seconds_per_run,
)
from catseye.estimation.network.plan import predicted
from catseye.estimation.observations.kinds import Directions, Distances, ObservedCoordinates, Vectors, ZenithAngles
from catseye.records.network.any_file import read_network
from repository import ROOT


def solved(network):
    return adjust_network(predicted(network))


def scatter(solution, runs, seed, **disturbance):
    made = NetworkSimulation.of(solution, seed=seed, disturbance=Disturbance(**disturbance))
    return scatter_of(made, made.run(0, runs, adjust_network))


def simulation(network, seed=1, **disturbance):
    return NetworkSimulation.of(solved(network), seed=seed, disturbance=Disturbance(**disturbance))


@pytest.fixture(scope="module")
def feed_arm():
    return solved(read_network(ROOT / "examples" / "networks" / "feed-arm.toml"))


def test_runs_scatter_as_predicted_and_their_covariance_is_the_planned_one(ranging_network):
    network, _ = ranging_network(9)
    result = scatter(solved(network), 2000, 1)
    assert result.runs == result.asked == 2000
    # 54 coordinates less 6 of the datum, independent: the ratio's own standard deviation is above 0.0016
    assert result.ratio == pytest.approx(1.0, abs=0.01)
    assert result.covariance.combinations == 48
    assert result.covariance.agrees
    assert result.covariance.excess < 1.0
    assert np.isnan(result.found)
    assert result.false == 0.0
    np.testing.assert_allclose(result.rms, result.predicted, rtol=4.0 / np.sqrt(2 * 2000))


@pytest.mark.parametrize("runs", [500, pytest.param(10_000, marks=pytest.mark.slow)])
def test_the_feed_arms_covariance_is_the_planned_one(feed_arm, runs):
    result = scatter(feed_arm, runs, 2)
    assert result.covariance.combinations == 24 * 3 - 6
    assert result.covariance.agrees
    assert result.covariance.excess < 1.0


def test_every_tenth_too_small_a_variance_is_noticed_by_the_matrix_alone(ranging_network):
    """Ranges of one station that are 1.3 times as bad as claimed: hardly any change of the sum of squares."""
    network, _ = ranging_network(9, stations=10)
    claimed = solved(network)
    of_one = network.groups[0].origin == 0
    worse = replace(network.groups[0], covariance=network.groups[0].covariance * np.where(of_one, 1.3**2, 1.0))
    plain = NetworkSimulation.of(claimed, seed=4)
    worse_draws = replace(
        plain, network=replace(plain.network, groups=(replace(worse, observed=plain.network.groups[0].observed),))
    )
    result = scatter_of(plain, worse_draws.run(0, 3000, adjust_network))
    assert result.ratio < 1.1
    assert result.covariance.p < 1e-6


@pytest.mark.parametrize("disturbance", [{}, {"common_ppm": 2.0, "station_ppm": 1.0}])
def test_batches_and_single_runs_have_the_same_sums(feed_arm, disturbance):
    made = NetworkSimulation.of(feed_arm, seed=5, disturbance=Disturbance(**disturbance))
    assert made.in_batches
    together = made.run(0, 30, adjust_network)
    alone = replace(made, in_batches=False).run(0, 30, adjust_network)
    assert (together.runs, together.asked, together.good) == (alone.runs, alone.asked, alone.good) == (30, 30, 30 * 130)
    np.testing.assert_allclose(together.squares, alone.squares, rtol=1e-4)
    np.testing.assert_allclose(together.claims, alone.claims, rtol=1e-4)
    assert together.ratios == pytest.approx(alone.ratios, rel=1e-4)
    np.testing.assert_allclose(together.moments, alone.moments, atol=1e-3 * np.abs(alone.moments).max())


def test_runs_are_the_same_however_they_are_divided(feed_arm):
    made = NetworkSimulation.of(feed_arm, seed=6)
    every = made.draw(0, 3 * BLOCK)
    for first, count in ((0, 7), (BLOCK, BLOCK), (BLOCK, BLOCK + 3), (2 * BLOCK, 1)):
        part = made.draw(first, count)
        assert len(part.truth) == count
        for ours, all_ in zip(part.observed, every.observed, strict=True):
            np.testing.assert_array_equal(ours, all_[first : first + count])
        np.testing.assert_array_equal(part.truth, every.truth[first : first + count])
    sums = [made.run(first, count, adjust_network) for first, count in ((0, BLOCK), (BLOCK, 2 * BLOCK))]
    once = made.run(0, 3 * BLOCK, adjust_network)
    np.testing.assert_allclose((sums[0] + sums[1]).moments, once.moments, rtol=1e-9, atol=1e-9)
    other = NetworkSimulation.of(feed_arm, seed=7).draw(0, 1)
    assert not np.any(other.observed[1] == every.observed[1][:1])


def test_sums_survive_json_to_the_last_bit(feed_arm):
    made = NetworkSimulation.of(feed_arm, seed=8)
    sums = made.run(0, 40, adjust_network)
    back = RunSums.from_object(json.loads(json.dumps(sums.to_object())))
    for name, value in vars(sums).items():
        np.testing.assert_array_equal(getattr(back, name), value)


@pytest.mark.parametrize("runs", [1, BLOCK, BLOCK + 1, 10_000, 123_456])
def test_chunks_are_all_runs_once_and_begin_blocks(feed_arm, runs):
    for blunders in (0.0, 0.02):
        made = NetworkSimulation.of(feed_arm, seed=1, disturbance=Disturbance(blunders=blunders))
        parts = chunks(made, runs)
        assert parts[0][0] == 0
        assert sum(count for _, count in parts) == runs
        assert all(first % BLOCK == 0 and count > 0 for first, count in parts)
        assert [a + n for a, n in parts[:-1]] == [a for a, _ in parts[1:]]
        longest = max(count for _, count in parts) * seconds_per_run(made)
        assert longest < 2.0 or max(count for _, count in parts) <= BLOCK


def test_wrong_air_increases_scatter_over_claim(ranging_network):
    network, _ = ranging_network(10)
    wrong = scatter(solved(network), 100, 2, common_ppm=3.0)
    assert wrong.ratio > 1.5
    assert not wrong.covariance.agrees
    assert wrong.covariance.excess > 2.0  # along the scale


def test_common_and_stations_scales_are_those_of_their_standard_deviations(ranging_network):
    network, _ = ranging_network(10)
    silent = replace(network.groups[0], covariance=np.full(len(network.groups[0].observed), 1e-16))
    network = replace(network, groups=(silent,))
    for common, station in ((3.0, 0.0), (0.0, 3.0)):
        drawn = simulation(network, common_ppm=common, station_ppm=station).draw(0, 2000)
        x = network.points.xyz.ravel()
        scale = drawn.observed[0] / silent.predict(x)[0] - 1.0
        assert np.std(scale) == pytest.approx(3e-6, rel=0.06)  # four standard deviations of 2000
        one, two = scale[:, silent.origin == 0], scale[:, silent.origin == 3]
        assert np.ptp(one, axis=1).max() < 1e-8
        assert np.corrcoef(one[:, 0], two[:, 0])[0, 1] == pytest.approx(1.0 if common else 0.0, abs=0.09)


def test_blunders_are_as_many_and_as_large_as_said(ranging_network):
    network, _ = ranging_network(10)
    made = simulation(network, blunders=0.2)
    assert not made.in_batches
    drawn = made.draw(0, 200)
    bad = drawn.wrong[0]
    assert bad.mean() == pytest.approx(0.2, abs=4 * 0.4 / np.sqrt(bad.size))
    off = (drawn.observed[0] - network.groups[0].predict(network.points.xyz.ravel())[0]) / 5e-5
    assert np.std(np.abs(off[bad]) - 20.0) == pytest.approx(1.0, abs=0.06)
    assert np.mean(off[bad] > 0.0) == pytest.approx(0.5, abs=2.0 / np.sqrt(bad.sum()))
    assert np.abs(off[~bad]).max() < 6.0
    clean = simulation(network).draw(0, 200)
    assert not clean.wrong[0].any()


def test_rejected_blunders_are_counted(ranging_network):
    network, _ = ranging_network(10)
    made = simulation(network, blunders=0.1)
    wrong = made.draw(0, 10).wrong[0]

    def solve(drawn):
        """Half of the blunders, and one good observation a run, are left out."""
        run = next(r for r, o in enumerate(every) if np.array_equal(o, drawn.groups[0].observed))
        active = ~wrong[run]
        active[np.flatnonzero(wrong[run])[::2]] = True
        active[np.flatnonzero(~wrong[run])[0]] = False
        return adjust_network(drawn, active=[active], settings=NetworkSettings(diagnose=False))

    every = made.draw(0, 10).observed[0]
    result = scatter_of(made, made.run(0, 10, solve))
    left_out = sum(int(w.sum()) // 2 for w in wrong)
    assert result.found == left_out / wrong.sum()
    assert result.false == 10 / np.sum(~wrong)


def test_runs_without_an_answer_do_not_count_and_none_is_an_error(ranging_network):
    network, _ = ranging_network(11)
    made = replace(simulation(network), in_batches=False)
    calls = []

    def solve(drawn):
        calls.append(drawn)
        solution = adjust_network(drawn)
        failed = Status(AdjustmentOutcome.NOT_CONVERGED, "planted")
        return replace(solution, status=failed) if len(calls) % 3 == 0 else solution

    result = scatter_of(made, made.run(0, 30, solve))
    assert (result.runs, result.asked) == (20, 30)
    assert result.ratio == pytest.approx(1.0, abs=0.2)
    broken = made.run(0, 5, lambda drawn: replace(adjust_network(drawn), status=Status(AdjustmentOutcome.NOT_TRIED)))
    with pytest.raises(EstimationError, match="none of 5 Monte Carlo runs converged: not tried"):
        scatter_of(made, broken)


def test_what_a_batch_refuses_is_solved_by_itself(ranging_network, monkeypatch):
    network, _ = ranging_network(12)
    made = simulation(network)
    usual = made.run(0, 10, adjust_network)
    plain = made.batches.solve
    alone = []

    def refusing(observed):
        solved = plain(observed)
        solved.accepted[::2] = False
        return solved

    monkeypatch.setattr(made.batches, "solve", refusing)
    mixed = made.run(0, 10, lambda drawn: alone.append(drawn) or adjust_network(drawn))
    assert len(alone) == 5
    assert (mixed.runs, mixed.good) == (10, usual.good)
    np.testing.assert_allclose(mixed.squares, usual.squares, rtol=1e-4)


def test_refraction_lifts_targets_by_its_square_of_distance():
    true = np.array([[0.0, 0.0, 0.0], [300.0, 400.0, 20.0]])
    zenith = ZenithAngles("z", np.zeros(1), np.full(1, 1e-30), np.array([0]), np.array([3]))
    seen = ObservedCoordinates.of_points("b", true[1:], np.full(3, 1e-4), np.array([3]))
    fixed = np.array([[True] * 3, [False] * 3])
    network = ObservationNetwork(NetworkPoints(("A", "B"), true, fixed, np.zeros_like(fixed)), (), (zenith, seen))
    drawn = simulation(network, refraction=0.2).draw(0, 2000).observed[0][:, 0]
    k = (zenith.predict(true.ravel())[0] - drawn) * 2 * 6_371_000.0 / 500.0  # k > 0 lifts: the angle shrinks
    assert np.std(k) == pytest.approx(0.2, rel=0.06)
    assert np.mean(k) == pytest.approx(0.0, abs=4 * 0.2 / np.sqrt(2000))


def test_correlated_observations_are_drawn_with_their_correlations():
    lever = np.array([[1.0, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.5, 0.4, 0.8]])
    covariance = lever @ lever.T
    vectors = Vectors("v", np.zeros(6), np.stack([covariance, 4 * covariance]), np.array([0, 0]), np.array([3, 3]))
    fixed = np.array([[True] * 3, [False] * 3])
    points = NetworkPoints(("A", "B"), np.zeros((2, 3)), fixed, np.zeros_like(fixed))
    for group in (vectors, replace(vectors, covariance=np.kron(np.diag([1.0, 4.0]), covariance))):
        found = np.cov(simulation(ObservationNetwork(points, (), (group,)), seed=5).draw(0, 3000).observed[0].T)
        assert found[:3, :3] == pytest.approx(covariance, abs=0.12)  # four standard deviations of a covariance near 1
        assert found[3:, 3:] == pytest.approx(4 * covariance, abs=0.48)
        assert found[:3, 3:] == pytest.approx(np.zeros((3, 3)), abs=0.16)


def test_parameters_are_drawn_from_their_priors_and_turns_of_angles_are_no_departure():
    true = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], [70.0, 70.0, 0.0]])
    fixed = np.zeros((4, 3), dtype=bool)
    fixed[:3], fixed[3, 2] = True, True
    ends = np.zeros(3, dtype=int), np.array([3, 6, 9])
    directions = Directions("d", np.zeros(3), np.full(3, 1e-10), *ends, np.full(3, 12))
    ranges = Distances("r", np.zeros(3), np.full(3, 1e-8), *ends, nuisance=np.full((3, 1), 13))
    parameters = NetworkParameter("orientation", 3.14159, unit="rad"), NetworkParameter("zero", 0.001, 2e-4, "m")
    network = ObservationNetwork(
        NetworkPoints(tuple("ABCD"), true, fixed, np.zeros_like(fixed)), parameters, (directions, ranges)
    )
    made = simulation(network, seed=3)
    drawn = made.draw(0, 2000)
    assert np.std(drawn.truth[:, 13]) == pytest.approx(2e-4, rel=0.07)
    assert np.mean(drawn.truth[:, 13]) == pytest.approx(1e-3, abs=4 * 2e-4 / np.sqrt(2000))
    np.testing.assert_array_equal(drawn.truth[:, :13], np.append(true.ravel(), 3.14159)[None].repeat(2000, axis=0))
    alone = replace(made, in_batches=False).run(0, 50, adjust_network)
    together = made.run(0, 50, adjust_network)
    np.testing.assert_allclose(alone.squares, together.squares, rtol=1e-4)
    assert np.all(together.squares / together.claims < 2.0)
