"""The ranging engine against the general ones: same network, same answer, down to every number a report shows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import random_array

from catseye.errors import EstimationError
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.model import NetworkParameter
from catseye.estimation.observations.kinds import Distances, HeightDifferences, ObservedCoordinates

FIELDS = ("active", "residual", "sigma", "redundancy", "standardised", "estimated_error", "detectable_error")


def with_everything(network, true):
    """Zeros and scales, some with priors, one held; surveyed points; a range between two plain stations."""
    ranges, n = network.groups[0], true.size
    origin = ranges.origin // 3
    zero = np.where(origin < 4, n + origin, -1)[:, None]
    scale = np.where(origin < 4, n + 4 + origin, -1)[:, None]
    parameters = [NetworkParameter(f"zero {i}", 1e-3, s, "m") for i, s in enumerate((np.inf, 1e-4, 0.0, np.inf))]
    parameters += [NetworkParameter(f"scale {i}", 0.0, s) for i, s in enumerate((1e-6, np.inf, 1e-6, 0.0))]
    observed = ranges.observed + np.where(origin < 4, 1e-3, 0.0)
    length = np.linalg.norm(true[6] - true[5])
    between = Distances("between", np.array([length + 2e-5]), np.array([1e-9]), np.array([15]), np.array([18]))
    survey = ObservedCoordinates.of_points(
        "survey", true[[1, 2, 12]] + 1e-4, np.array([np.diag([1e-8, 2e-8, 3e-8]) + 5e-9] * 3), 3 * np.array([1, 2, 12])
    )
    changed = replace(ranges, observed=observed, nuisance=zero, scaling=scale)
    return replace(network, parameters=tuple(parameters), groups=(changed, between, survey))


def same(a, b):
    """Every number of two solutions."""
    assert a.status == b.status == "converged"
    size = np.abs(b.covariance).max()
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=0, atol=1e-5 * size)
    np.testing.assert_allclose(a.parameters, b.parameters, rtol=0, atol=1e-9)
    np.testing.assert_allclose(a.u_parameters, b.u_parameters, rtol=1e-4, atol=1e-12)
    assert a.degrees_of_freedom == b.degrees_of_freedom
    assert a.variance_factor == pytest.approx(b.variance_factor, rel=1e-7)
    for mine, other in zip(a.fits, b.fits, strict=True):
        assert mine.name == other.name
        assert mine.pvv == pytest.approx(other.pvv, rel=1e-6, abs=1e-6)
        checked = other.redundancy > 1e-6
        for field in FIELDS:
            one, two = getattr(mine, field)[checked], getattr(other, field)[checked]
            np.testing.assert_allclose(one, two, rtol=1e-4, atol=1e-5 * np.abs(two).max(initial=1e-9), err_msg=field)


@pytest.mark.parametrize("targets_too", [False, True])
def test_a_plain_network(ranging_network, targets_too):
    network, _ = ranging_network(1, stations=8, targets=20, seen=0.8)
    if targets_too:
        datum = network.points.datum.copy()
        datum[10:14] = True
        network = replace(network, points=replace(network.points, datum=datum))
    same(adjust_network(network, engine="ranging"), adjust_network(network, engine="dense"))


def test_zeros_scales_priors_and_ranges_between_stations(ranging_network):
    network, true = ranging_network(2, stations=8, targets=20)
    full = with_everything(network, true)
    same(adjust_network(full, engine="ranging"), adjust_network(full, engine="dense"))


def test_held_points_and_what_is_left_out(ranging_network):
    network, true = ranging_network(3, stations=8, targets=20)
    fixed = np.zeros_like(network.points.fixed)
    fixed[:3] = True
    fixed[9, 2] = True
    points = replace(network.points, xyz=np.where(fixed, true, network.points.xyz), fixed=fixed)
    held = replace(network, points=replace(points, datum=np.zeros_like(fixed)))
    m = len(held.groups[0].observed)
    active = np.ones(m, dtype=bool)
    active[[5, 40]] = False
    inflation = np.linspace(1.0, 3.0, m)
    one, two = (adjust_network(held, active=[active], inflation=[inflation], engine=e) for e in ("ranging", "dense"))
    same(one, two)


@pytest.mark.parametrize("targets_too", [False, True])
def test_every_part_of_the_joint_covariance(ranging_network, targets_too):
    network, true = ranging_network(4, stations=8, targets=20)
    network = with_everything(network, true)
    if targets_too:  # a datum of stations and targets, without the survey
        datum = network.points.datum.copy()
        datum[10:14] = True
        network = replace(network, points=replace(network.points, datum=datum), groups=network.groups[:2])
    ranging, dense = (adjust_network(network, engine=e) for e in ("ranging", "dense"))
    full = dense.q.matrix()
    size = 1e-5 * np.abs(full).max()
    np.testing.assert_allclose(ranging.q.matrix(), full, rtol=0, atol=size)
    some = np.array([0, 5, 30, 31, 62, 85, 90])
    np.testing.assert_allclose(ranging.q.within(some), full[np.ix_(some, some)], rtol=0, atol=size)
    np.testing.assert_allclose(ranging.q.across(some), full[:, some], rtol=0, atol=size)
    np.testing.assert_allclose(ranging.q.diagonal(), np.diag(full), rtol=0, atol=size)
    weights = random_array(shape=(5, len(full)), density=0.2, rng=np.random.default_rng(4), format="csr")
    np.testing.assert_allclose(ranging.q.solve(weights.toarray().T), full @ weights.T, rtol=0, atol=size * len(full))
    np.testing.assert_allclose(ranging.q.carried(weights), weights @ full @ weights.T, rtol=0, atol=size * len(full))
    others = random_array(shape=(3, len(full)), density=0.2, rng=np.random.default_rng(5), format="csr")
    for q in (ranging.q, dense.q):
        found = q.carried(weights, others)
        np.testing.assert_allclose(found, weights @ full @ others.T, rtol=0, atol=size * len(full))
    names = ["T003", "S02", "T011"]
    np.testing.assert_allclose(ranging.block(names), dense.block(names), rtol=0, atol=size)
    columns = network.groups[0].columns
    rng = np.random.default_rng(0)
    a = rng.standard_normal(columns.shape)
    found, expected = (np.where(columns < 0, 0.0, s.q.products(columns, a)) for s in (ranging, dense))
    np.testing.assert_allclose(found, expected, rtol=0, atol=100 * size)


def test_other_networks_are_refused_by_name(ranging_network):
    network, _ = ranging_network(5)
    level = HeightDifferences("level", np.zeros(1), np.ones(1), np.array([0]), np.array([3]))
    with pytest.raises(EstimationError, match="'level' is not of independent ranges"):
        adjust_network(replace(network, groups=(*network.groups, level)), engine="ranging")
    shared = replace(network.groups[0], nuisance=np.full((72, 1), 54))
    with pytest.raises(EstimationError, match="each one station's"):
        adjust_network(
            replace(network, parameters=(NetworkParameter("refractivity"),), groups=(shared,)), engine="ranging"
        )


def test_large_networks_use_the_ranging_engine_and_fall_back_on_failure(ranging_network):
    network, _ = ranging_network(6, stations=10, targets=220)
    assert type(adjust_network(network).q).__name__ == "RangingCovariance"
    ranges = network.groups[0]
    keep = (ranges.target != 3 * 50) | (ranges.origin < 6)
    part = {k: getattr(ranges, k)[keep] for k in ("observed", "covariance", "origin", "target")}
    lost = adjust_network(replace(network, groups=(replace(ranges, **part),)))
    assert lost.status.startswith("rank deficient: T041 (2 observations) floats")
