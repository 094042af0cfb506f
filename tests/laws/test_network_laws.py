"""Laws of networks: more observations never hurt, order and place do not matter, redundancy is what is left over."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import (
    Directions,
    Distances,
    HeightDifferences,
    Joint,
    ObservedCoordinates,
    Vectors,
    ZenithAngles,
)

seeds = st.integers(0, 2**32 - 1)
quick = settings(deadline=None, max_examples=25)


def mixed(seed, *, datum="fixed"):
    """Two total stations and some vectors on nine points: six kinds, some correlated, heights, a scale with a prior."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(-60, 60, (9, 3)) * [1.0, 1.0, 0.3]
    origin, target = np.repeat([0, 1], 7), np.tile(np.arange(2, 9), 2)
    up = np.zeros((14, 3))
    up[:, 2] = rng.uniform(-1.8, 0.2, 14)
    along = true[target] - true[origin] + up
    level = np.hypot(along[:, 0], along[:, 1])
    sigma = {"d": 1e-3, "a": 1e-5, "z": 1e-5, "h": 5e-4}

    def noisy(values, u):
        return values + u * rng.standard_normal(len(values))

    bearing = np.arctan2(along[:, 0], along[:, 1]) - 0.4
    directions = Directions(
        "directions", noisy(bearing, sigma["a"]), np.full(14, sigma["a"] ** 2), 3 * origin, 3 * target, 27 + origin, up
    )
    zenith = ZenithAngles(
        "zenith", noisy(np.arctan2(level, along[:, 2]), sigma["z"]), np.full(14, sigma["z"] ** 2),
        3 * origin, 3 * target, up,
    )  # fmt: skip
    root = np.tril(rng.uniform(-0.3, 0.3, (14, 14)), -1) + np.eye(14)
    ranges = Distances(
        "ranges", noisy(np.linalg.norm(along, axis=1), sigma["d"]), sigma["d"] ** 2 * root @ root.T,
        3 * origin, 3 * target, shift=up, scaling=np.full((14, 1), 29),
    )  # fmt: skip
    heights = HeightDifferences(
        "heights", noisy(true[5:8, 2] - true[2:5, 2], sigma["h"]), np.full(3, sigma["h"] ** 2),
        3 * np.arange(2, 5), 3 * np.arange(5, 8),
    )  # fmt: skip
    lever = rng.uniform(-1, 1, (2, 3, 3))
    cofactor = 1e-6 * (np.eye(3) + lever @ lever.transpose(0, 2, 1))
    vectors = Vectors(
        "vectors", (true[[3, 8]] - true[[2, 4]] + 1e-3 * rng.standard_normal((2, 3))).ravel(), cofactor,
        3 * np.array([2, 4]), 3 * np.array([3, 8]),
    )  # fmt: skip
    survey = ObservedCoordinates.of_points("survey", true[[6]] + 1e-3, np.full(3, 4e-6), np.array([18]))
    fixed, marked = np.zeros((9, 3), dtype=bool), np.zeros((9, 3), dtype=bool)
    (fixed if datum == "fixed" else marked)[[2, 5, 8]] = True
    given_ = true + 0.02 * rng.standard_normal(true.shape) * ~fixed
    parameters = (
        *(NetworkParameter(f"orientation {i}", 0.4, unit="rad") for i in range(2)),
        NetworkParameter("scale", 0.0, 1e-5),
    )
    groups = (directions, zenith, ranges, heights, vectors, *((survey,) if datum == "fixed" else ()))
    return ObservationNetwork(
        NetworkPoints(tuple(f"P{i}" for i in range(9)), given_, fixed, marked), parameters, groups
    )


def subset(group, keep):
    """A group of independent observations cut to some rows."""
    names = ("observed", "covariance", "origin", "target", "orientation", "shift")
    return replace(group, **{n: getattr(group, n)[keep] for n in names if getattr(group, n, None) is not None})


@quick
@given(seeds, st.integers(0, 4))
def test_a_further_group_never_grows_a_covariance(seed, left_out):
    network = mixed(seed)
    less = replace(network, groups=tuple(g for k, g in enumerate(network.groups) if k != left_out + 1))
    more, fewer = (adjust_network(n) for n in (network, less))
    if not np.isfinite(fewer.covariance).all():
        return
    place = 3 * 9
    # at the same linearisation up to millimetres in tens of metres: the comparison is exact to some 1e-4
    shrunk = fewer.q.matrix()[:place, :place] - more.q.matrix()[:place, :place]
    assert np.linalg.eigvalsh(shrunk).min() > -2e-3 * np.linalg.eigvalsh(fewer.q.matrix()[:place, :place]).max()


@quick
@given(seeds)
def test_the_order_of_observations_groups_and_points_does_not_matter(seed):
    network = mixed(seed)
    rng = np.random.default_rng(seed)
    order = rng.permutation(9)
    place = np.argsort(order)

    def column(c):
        c = np.asarray(c)
        return np.where(c < 27, 3 * place[np.minimum(c, 26) // 3] + c % 3, c)

    groups = []
    for group in network.groups:
        changes = {n: column(getattr(group, n)) for n in ("origin", "target", "point") if hasattr(group, n)}
        moved = replace(group, **changes)
        shuffled = rng.permutation(len(group.observed))
        groups.append(subset(moved, shuffled) if isinstance(group, Directions | ZenithAngles) else moved)
    p = network.points
    points = NetworkPoints(tuple(p.names[i] for i in order), p.xyz[order], p.fixed[order], p.datum[order])
    groups = [groups[i] for i in rng.permutation(len(groups))]
    one, two = adjust_network(network), adjust_network(replace(network, points=points, groups=tuple(groups)))
    assert one.status.split(":")[0] == two.status.split(":")[0]
    np.testing.assert_allclose(two.x, one.x[order], rtol=0, atol=1e-8)
    np.testing.assert_allclose(two.covariance, one.covariance[order], rtol=1e-6, atol=1e-6 * one.covariance.max())
    assert np.isclose(two.variance_factor, one.variance_factor, rtol=1e-6)


@quick
@given(seeds, st.sampled_from(["fixed", "datum"]))
def test_redundancy_numbers_sum_to_the_degrees_of_freedom(seed, datum):
    network = mixed(seed, datum=datum)
    solution = adjust_network(network)
    own = sum(float(f.redundancy.sum()) for f in solution.fits)
    prior = 1.0 - (solution.u_parameters[2] / 1e-5) ** 2  # of the scale's prior, one observation more
    assert np.isclose(own + prior, solution.degrees_of_freedom, atol=1e-5)


@quick
@given(seeds)
def test_a_network_of_ranges_and_vectors_moves_and_turns_as_a_whole(seed):
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed % 2**31).as_matrix(), rng.uniform(-1000, 1000, 3)
    true = rng.uniform(-50, 50, (12, 3))
    origin, target = np.repeat(np.arange(5), 7), np.tile(np.arange(5, 12), 5)
    length = np.linalg.norm(true[target] - true[origin], axis=1) + 1e-4 * rng.standard_normal(35)
    ranges = Distances("ranges", length, np.full(35, 1e-8), 3 * origin, 3 * target)
    given_ = true + 1e-3 * rng.standard_normal(true.shape)
    vector, cofactor = true[1] - true[0] + 1e-4, 1e-8 * np.diag([1.0, 2.0, 3.0])[None]
    datum = np.zeros((12, 3), dtype=bool)
    datum[:4] = True

    def made(r, s):
        along = Vectors("vector", r @ vector, r @ cofactor @ r.T, np.array([0]), np.array([3]))
        names = tuple(f"P{i}" for i in range(12))
        return ObservationNetwork(
            NetworkPoints(names, given_ @ r.T + s, np.zeros_like(datum), datum), (), (ranges, along)
        )

    here, there = adjust_network(made(np.eye(3), np.zeros(3))), adjust_network(made(turn, shift))
    if not np.isfinite(here.covariance).all():
        return
    np.testing.assert_allclose(there.x, here.x @ turn.T + shift, rtol=0, atol=2e-8)
    np.testing.assert_allclose(
        there.covariance, turn @ here.covariance @ turn.T, rtol=0, atol=1e-5 * here.covariance.max()
    )
    np.testing.assert_allclose(there.fits[0].standardised, here.fits[0].standardised, atol=1e-3)


@quick
@given(seeds)
def test_observations_joined_with_a_diagonal_covariance_are_the_separate_ones(seed):
    network = mixed(seed)
    directions, zenith = network.groups[:2]
    joint = Joint.of("both", (directions, zenith), np.diag(np.concatenate([directions.covariance, zenith.covariance])))
    one, two = adjust_network(network), adjust_network(replace(network, groups=(joint, *network.groups[2:])))
    np.testing.assert_allclose(two.x, one.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(two.covariance, one.covariance, rtol=0, atol=1e-7 * one.covariance.max())
    w = np.concatenate([f.standardised for f in one.fits[:2]])
    np.testing.assert_allclose(two.fits[0].standardised, w, atol=1e-4)


@quick
@given(seeds)
def test_inflation_scales_a_covariance_and_keeps_or_dilutes_its_correlations(seed):
    network, rng = mixed(seed), np.random.default_rng(seed)
    inflation = [rng.uniform(1.0, 3.0, len(g.observed)) for g in network.groups]

    def by_hand(alone):
        groups = []
        for group, f in zip(network.groups, inflation, strict=True):
            c = group.covariance
            if c.ndim == 1:
                groups.append(replace(group, covariance=c * f**2))
                continue
            f = f.reshape(c.shape[:-1])
            larger = c * f[..., :, None] * f[..., None, :]
            if alone:
                own = np.diagonal(c, axis1=-2, axis2=-1) * (f**2 - 1.0)
                larger = c + own[..., None] * np.eye(c.shape[-1])
            groups.append(replace(group, covariance=larger))
        return adjust_network(replace(network, groups=tuple(groups)))

    for alone in (False, True):
        found, expected = adjust_network(network, inflation=inflation, alone=alone), by_hand(alone)
        np.testing.assert_allclose(found.x, expected.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.covariance, expected.covariance, rtol=0, atol=1e-7 * expected.covariance.max())
        assert np.isclose(found.variance_factor, expected.variance_factor, rtol=1e-7)
