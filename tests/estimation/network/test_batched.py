"""Batches of sets of observed values are solved as each set by itself: every kind, datum, prior and correlation."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.estimation.least_squares.adjustment import STEP_IN_SIGMAS, SolverSettings
from catseye.estimation.network import batched
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network, fixed_parts
from catseye.estimation.network.batched import BatchedNetwork
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.network.monte_carlo import NetworkSimulation
from catseye.estimation.network.plan import predicted
from catseye.estimation.observations.kinds import Distances, ObservedCoordinates
from catseye.records.network.any_file import read_network
from estimation.kinds_scene import OTHERS, POINTS, P, groups
from laws.network_scene import DATUMS, DIMENSIONS, scene
from repository import ROOT

RUNS = 12
PLAIN = NetworkSettings(diagnose=False)


def compare(network, *, runs=RUNS, seed=3):
    """Solve drawn sets both ways; the solution and the batch."""
    solution = adjust_network(predicted(network))
    assert BatchedNetwork.suits(solution)
    drawn = NetworkSimulation.of(solution, seed=seed).draw(0, runs)
    moving = np.flatnonzero(fixed_parts(solution).free)
    batch = BatchedNetwork(fixed_parts(solution)).solve(drawn.observed)
    assert batch.accepted.all()
    for r in range(runs):
        alone = adjust_network(with_observed(solution.network, [o[r] for o in drawn.observed]), settings=PLAIN)
        u = np.sqrt(alone.q.diagonal()[moving])
        np.testing.assert_array_less(np.abs(batch.x[r] - alone.state)[moving] / u, STEP_IN_SIGMAS)  # of each step
        np.testing.assert_allclose(np.sqrt(batch.variance[r]), u, rtol=1e-4)  # the slopes change by u over the size
    return solution, batch


def with_observed(network, observed):
    pairs = zip(network.groups, observed, strict=True)
    return replace(network, groups=tuple(replace(group, observed=o) for group, o in pairs))


@pytest.mark.parametrize("datum", DATUMS)
@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_networks_of_every_dimension_and_datum(tmp_path, dimension, datum):
    made = scene(4, dimension, datum)
    made.given = np.where(made.there, made.truth, np.nan)
    file = tmp_path / "network.toml"
    file.write_text(made.toml("datum" if datum == "datum" else "fixed"), encoding="utf-8")
    compare(read_network(file))


@pytest.mark.parametrize("name", ["feed-arm.toml", "ground-ring", "total-station.dat", "total-station.gkf"])
def test_the_examples(name):
    compare(read_network(ROOT / "examples" / "networks" / name))


@pytest.mark.parametrize("seed", range(3))
def test_a_network_of_every_kind_with_priors_and_correlations(seed):
    """Points that are observed as such, and all kinds between them, correlated in blocks and as a whole."""
    made, x = groups(seed)
    rng = np.random.default_rng(seed)
    observed = []
    for group in made:
        shape = group.covariance.shape
        covariance = np.full(shape, 1e-8) if len(shape) == 1 else correlated(rng, shape) * 1e-8
        observed.append(replace(group, observed=group.predict(x)[0], covariance=covariance))
    points = x[: 3 * POINTS].reshape(-1, 3)
    stochastic = ObservedCoordinates.of_points("points", points, np.full(3 * POINTS, 1e-6), P)
    nothing = np.zeros((POINTS, 3), dtype=bool)
    network = ObservationNetwork(
        NetworkPoints(tuple("ABCDEF"), points, nothing, nothing),
        tuple(NetworkParameter(f"p{i}", value, 1e-4 * (i + 1)) for i, value in enumerate(x[3 * POINTS :])),
        (*observed, stochastic),
    )
    assert len(network.parameters) == OTHERS
    compare(network)


def correlated(rng, shape):
    n = shape[-1]
    lever = np.eye(n) + 0.3 * rng.standard_normal((*shape[:-2], n, n)) / np.sqrt(n)
    return lever @ np.swapaxes(lever, -1, -2)


def test_parameters_may_be_held_free_and_repeated(ranging_network):
    network, _ = ranging_network(3)
    ranges = network.groups[0]
    columns = 3 * len(network.points.names) + np.stack([ranges.origin // 3, ranges.origin // 3], axis=1) % 3
    columns[::5, 1] = -1
    scaled = replace(ranges, nuisance=columns, coefficient=0.5)
    parameters = tuple(NetworkParameter(f"zero {i}", 1e-3 * i, sigma) for i, sigma in enumerate((0.0, 1e-4, np.inf)))
    compare(replace(network, groups=(scaled,), parameters=parameters))


def test_a_datum_is_met_exactly_and_its_covariance_is_that_of_the_bordered_matrix(ranging_network):
    network, _ = ranging_network(5, stations=5, targets=7)
    solution, batch = compare(network)
    parts = fixed_parts(solution)
    assert len(parts.conditions) == 6
    off = (batch.x - parts.reference) @ parts.conditions.T
    assert np.abs(off).max() < 1e-11  # m, of rounding over 100 m
    ranges = parts.groups[0]
    for x, variance in zip(batch.x[:3], batch.variance, strict=False):
        a = np.zeros((len(ranges.observed), len(x)))
        np.put_along_axis(a, ranges.columns, ranges.predict(x)[1], axis=1)
        weighted = a / np.sqrt(ranges.covariance)[:, None]
        g = parts.conditions * np.sqrt(np.mean(weighted**2))
        bordered = np.block([[weighted.T @ weighted, g.T], [g, np.zeros((6, 6))]])
        right = np.diag(np.linalg.inv(bordered))[: len(x)]
        np.testing.assert_allclose(variance, right, rtol=1e-6)


@pytest.fixture
def near_line():
    """A point that two ranges place all but on the line between their ends: a strongly curved problem."""
    true = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 0.02, 0.0]])
    fixed = np.array([[True] * 3, [True] * 3, [False, False, True]])
    ranges = Distances("r", np.zeros(2), np.full(2, 1e-8), np.array([0, 3]), np.array([6, 6]))
    points = NetworkPoints(("A", "B", "P"), true, fixed, np.zeros_like(fixed))
    return predicted(ObservationNetwork(points, (), (ranges,)))


def test_what_does_not_converge_at_once_is_refused_and_never_wrong(near_line):
    solution = adjust_network(near_line)
    observed = [near_line.groups[0].observed + 1e-4 * np.random.default_rng(1).standard_normal((200, 2))]
    batch = BatchedNetwork(fixed_parts(solution)).solve(observed)
    refused = ~batch.accepted
    assert 20 < refused.sum() < 180
    assert np.isnan(batch.variance[refused]).all()
    ranges, both = near_line.groups[0], 0
    for r in np.flatnonzero(batch.accepted):
        alone = adjust_network(with_observed(near_line, [observed[0][r]]), settings=PLAIN)
        misfit = [np.sum((observed[0][r] - ranges.predict(x)[0]) ** 2) / 1e-8 for x in (batch.x[r], alone.state)]
        assert misfit[0] <= misfit[1] + STEP_IN_SIGMAS**2  # some accepted ones do not converge by themselves
        if alone.status.usable:
            u = np.sqrt(alone.q.diagonal())[6:8]
            assert np.all(np.abs(batch.x[r, 6:8] - alone.x[2, :2]) < 2 * STEP_IN_SIGMAS * u)  # of both solutions
            np.testing.assert_allclose(np.sqrt(batch.variance[r]), u, rtol=0.1)  # that step changes it by percents
            both += 1
    assert both > 20


def test_a_value_that_is_no_number_refuses_its_own_set_only(ranging_network):
    solution = adjust_network(predicted(ranging_network(6)[0]))
    network = BatchedNetwork(fixed_parts(solution))
    observed = np.repeat(solution.network.groups[0].observed[None], 5, axis=0)
    observed[2, 7] = np.nan
    batch = network.solve([observed])
    assert batch.accepted.tolist() == [True, True, False, True, True]
    np.testing.assert_allclose(batch.x[0], solution.state, atol=1e-9)


@pytest.mark.parametrize("numbers", [1, 30_000, 10**9])
def test_the_size_of_a_batch_changes_nothing(ranging_network, monkeypatch, numbers):
    solution = adjust_network(predicted(ranging_network(7)[0]))
    drawn = NetworkSimulation.of(solution, seed=1).draw(0, 40)
    usual = BatchedNetwork(fixed_parts(solution)).solve(drawn.observed)
    monkeypatch.setattr(batched, "BATCH_NUMBERS", numbers)
    other = BatchedNetwork(fixed_parts(solution)).solve(drawn.observed)
    np.testing.assert_allclose(other.x, usual.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(other.variance, usual.variance, rtol=1e-9)


def test_large_networks_of_ranges_are_left_to_their_own_engine(ranging_network):
    small, large = (ranging_network(1, stations=6, targets=t)[0] for t in (12, 200))
    quick = NetworkSettings(SolverSettings(tests=True), diagnose=False)
    assert [BatchedNetwork.suits(adjust_network(predicted(n), settings=quick)) for n in (small, large)] == [True, False]
