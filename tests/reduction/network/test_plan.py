"""Plans with a Monte Carlo: the same wherever its chunks run, and a verdict on its covariance."""

import json
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from catseye.errors import ArgumentError
from catseye.estimation.deformation.comparison import compare
from catseye.estimation.network.plan import MOST_RANGES
from catseye.estimation.quality.sample_covariance import covariance_test
from catseye.gateways.network.plan import plan_passages
from catseye.records.network.any_file import read_network
from catseye.reduction.network import plan as plans
from catseye.reduction.network.plan import MonteCarloOptions, PlanOptions, chunk_object, planned
from repository import ROOT

FEED_ARM = ROOT / "examples" / "networks" / "feed-arm.toml"


@pytest.fixture(scope="module")
def network():
    return read_network(FEED_ARM)


def options(**monte_carlo):
    return PlanOptions(monte_carlo=MonteCarloOptions(**monte_carlo))


def same(one, other):
    for name, value in vars(one).items():
        np.testing.assert_array_equal(getattr(other, name), value)


def test_chunks_give_the_same_answer_to_the_last_bit_here_and_in_other_processes(network, monkeypatch):
    monkeypatch.setattr(plans, "WORTH_PROCESSES_S", 0.0)
    monkeypatch.setattr("catseye.estimation.network.monte_carlo.CHUNK_S", 0.02)
    asked = options(runs=360, seed=4)
    here = planned(network, asked).scatter
    calls = []

    def backwards(chunks):
        """Two processes, the last chunk first; as JSON."""
        calls.extend(chunks)
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            found = [pool.submit(chunk_object, *chunk) for chunk in reversed(chunks)]
            return [json.loads(json.dumps(future.result())) for future in reversed(found)]

    there = planned(network, asked, run=backwards).scatter
    assert len(calls) > 3
    same(here, there)
    assert here.runs == 360


def test_a_schedule_that_ends_at_its_limit_says_so(network):
    short, long = (
        dict(plan_passages(planned(network, PlanOptions(budget_s=seconds, shot_s=1.0))))["In the given time"]
        for seconds in (5.0, 1000.0)
    )
    assert "the search ends" not in short
    assert long.startswith(f"{MOST_RANGES} ranges, ")
    assert long.endswith(f"; the search ends at {MOST_RANGES} ranges.")


def test_few_runs_stay_in_the_process(network):
    def refuse(chunks):
        raise AssertionError("not worth a process")

    assert planned(network, options(runs=300), run=refuse).scatter.runs == 300
    with pytest.raises(AssertionError, match="not worth"):
        planned(network, options(runs=300, blunders=0.02), run=refuse)


def test_progress_counts_all_runs(network, monkeypatch):
    monkeypatch.setattr("catseye.estimation.network.monte_carlo.CHUNK_S", 0.05)
    seen = []
    planned(network, options(runs=900), progress=lambda *parts: seen.append(parts))
    assert [done for _, done, _ in seen] == sorted({done for _, done, _ in seen})
    assert {(what, total) for what, _, total in seen} == {("Monte Carlo runs", 900)}
    assert seen[0][1] == 0
    assert seen[-1][1] > 600


def test_a_common_error_of_the_air_makes_a_plan_doubtful_by_its_worst_combination(network):
    """Nothing but the datum's points is left to tell a scale: the sum of squares hardly shows it."""
    fixed = network.groups[0]
    scale_free = replace(network, groups=(replace(fixed, covariance=np.full(1, 1.0)), *network.groups[1:]))
    good = planned(scale_free, options(runs=400))
    assert good.verdict.word == "good"
    told = planned(scale_free, options(runs=400, air_ppm=20.0))
    assert told.verdict.word == "doubtful"
    assert "in the Monte Carlo" in told.verdict.why


def test_a_scatter_that_is_wrong_along_one_combination_alone_is_doubtful(network):
    good = planned(network, options(runs=400))
    assert good.verdict.word == "good"
    k = good.scatter.covariance.combinations
    variances = np.full(k, 1.0)
    variances[0] = 3.0**2
    wrong = replace(good, scatter=replace(good.scatter, covariance=covariance_test(400 * np.diag(variances), 400)))
    assert wrong.verdict.word == "doubtful"
    assert (
        "along one combination of the coordinates are 3.00 times the claim (by chance up to 1.45)" in wrong.verdict.why
    )

    with_blunders = replace(wrong, scatter=replace(wrong.scatter, found=0.9))
    assert with_blunders.verdict.word == "good"


@pytest.mark.parametrize("name", ["runs", "seed"])
def test_negative_numbers_are_refused(name):
    with pytest.raises(ArgumentError, match=rf"{name} = -1 is invalid \(expected 0 or more\)"):
        MonteCarloOptions(**{name: -1})


def test_ten_runs_of_a_small_network_compile_nothing():
    code = (
        "import sys; from catseye.api.planning import plan; "
        f"assert plan({str(FEED_ARM)!r}, runs=10).planned.scatter.runs == 10; "
        "assert not {'numba', 'distributed', 'concurrent.futures.process'} & set(sys.modules), sorted(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["feed-arm.toml", "ground-ring"])
def test_a_plan_says_which_movements_a_second_epoch_would_show(name):
    """The comparison of two such epochs has the same sizes; the sum of squares of one is what its test needs."""
    found = planned(read_network(ROOT / "examples" / "networks" / name))
    solution = found.predicted.solution
    between = compare(solution, solution).deformation
    rows = [solution.index[point] for point in between.names]
    np.testing.assert_allclose(found.detectable[rows], between.detectable, rtol=1e-6)
    assert np.isfinite(found.detectable[found.plan.interest]).any()
    assert (found.detectable > 2.0 * found.plan.weakest)[np.isfinite(found.detectable)].all()  # sqrt(2) u at the least


def test_the_weakest_direction_of_a_plan_is_the_largest_eigenvalue_of_its_covariance():
    found = planned(read_network(FEED_ARM))
    u, share = found.weakest_motion
    values, vectors = np.linalg.eigh(found.predicted.solution.block(found.predicted.names))
    assert u == pytest.approx(values[-1] ** 0.5, rel=1e-9)
    np.testing.assert_allclose(share, np.linalg.norm(vectors[:, -1].reshape(-1, 3), axis=1), atol=1e-6)
    assert u >= found.plan.weakest.max()
    assert np.sum(share**2) == pytest.approx(1.0)
