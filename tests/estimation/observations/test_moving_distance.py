"""Distances between carried points against plain distances of points that were carried by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Distances, Linear, MovingDistances

seeds = st.integers(0, 2**32 - 1)
M = 5


def scene(seed):
    """Four points about 50 m apart with three more parameters, shots with turns of any size, and the parameters."""
    rng = np.random.default_rng(seed)
    x = np.concatenate([(30.0 * rng.normal(size=(4, 3))).ravel(), rng.normal(size=3)])
    origin, target = 3 * np.array([0, 0, 1, 2, 3]), 3 * np.array([1, 2, 3, 0, 1])
    turns = [Rotation.random(M, random_state=rng).as_matrix() for _ in range(2)]
    shifts = [20.0 * rng.normal(size=(M, 3)) for _ in range(2)]
    more = {
        "scale": 1.0 + 1e-3 * rng.normal(size=M),
        "offset": rng.normal(size=M),
        "nuisance": np.array([[12, 13], [13, -1], [12, 12], [-1, 13], [13, 12]]),
        "coefficient": rng.normal(size=(M, 2)),
        "scaling": np.array([[14], [14], [-1], [14], [14]]),
        "scaling_coefficient": 1e-3 * rng.normal(size=(M, 1)),
    }
    ends = turns[0], shifts[0], turns[1], shifts[1]
    return MovingDistances("m", np.zeros(M), np.ones(M), origin, target, *ends, **more), x, more


@given(seed=seeds)
def test_it_is_the_distance_of_points_carried_by_hand(seed):
    group, x, more = scene(seed)
    carried, ends = [], []
    for k in range(M):  # a point of its own for each end of each shot
        for column, turn, shift in (
            (group.origin[k], group.origin_turn[k], group.origin_shift[k]),
            (group.target[k], group.target_turn[k], group.target_shift[k]),
        ):
            p = x[column : column + 3]
            carried += [sum(turn[i, j] * p[j] for j in range(3)) + shift[i] for i in range(3)]
            ends.append(3 * len(ends))
    own = dict(more)
    own["nuisance"] = np.where(more["nuisance"] < 0, -1, more["nuisance"] - 12 + len(carried))
    own["scaling"] = np.where(more["scaling"] < 0, -1, more["scaling"] - 12 + len(carried))
    plain = Distances("d", group.observed, group.covariance, np.array(ends[::2]), np.array(ends[1::2]), **own)
    expected, slopes = plain.predict(np.array([*carried, *x[12:]]))
    values, jacobian = group.predict(x)
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-11)  # rounding at 100 m
    # what is not a point's has the same derivative; a point's is that of the carried one, turned back
    np.testing.assert_allclose(jacobian[:, 6:], slopes[:, 6:], rtol=0, atol=1e-11)
    for part, turn in ((slice(0, 3), group.origin_turn), (slice(3, 6), group.target_turn)):
        back = np.array([slopes[k, part] @ turn[k] for k in range(M)])
        np.testing.assert_allclose(jacobian[:, part], back, rtol=0, atol=1e-13)


@settings(max_examples=30)
@given(seed=seeds)
def test_derivatives_are_those_of_the_values(seed):
    group, x, _ = scene(seed)
    jacobian = group.predict(x)[1]
    whole = np.zeros((M, len(x) + 1))
    np.add.at(whole, (np.arange(M)[:, None], group.columns), jacobian)
    assert not np.any(jacobian[group.columns < 0])
    size = np.linalg.norm(np.subtract(*group.ends_at_shots(x)), axis=1).min()
    step = 1e-3 * min(size, 1.0)
    for column in range(len(x)):
        up = (np.arange(len(x)) == column) * step
        f = [group.predict(x + k * up)[0] for k in (-2, -1, 1, 2)]
        slope = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
        np.testing.assert_allclose(whole[:, column], slope, rtol=0, atol=1e-7)


def test_unturned_it_is_distances():
    group, x, more = scene(4)
    still = np.tile(np.eye(3), (M, 1, 1)), np.zeros((M, 3))
    moving = MovingDistances("m", group.observed, group.covariance, group.origin, group.target, *still, *still, **more)
    plain = Distances("d", group.observed, group.covariance, group.origin, group.target, **more)
    for a, b in zip(moving.predict(x), plain.predict(x), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(moving.columns, plain.columns)


def test_points_that_meet_have_no_derivative_and_no_warning():
    still = np.tile(np.eye(3), (1, 1, 1)), np.zeros((1, 3))
    met = MovingDistances("m", np.ones(1), np.ones(1), np.array([0]), np.array([3]), *still, *still)
    assert np.isnan(met.predict(np.zeros(6))[1]).all()


def test_invalid_column_is_refused():
    group, _, more = scene(1)
    bad = {**more, "nuisance": np.zeros((M + 1, 1), dtype=int)}
    ends = group.origin_turn, group.origin_shift, group.target_turn, group.target_shift
    with pytest.raises(EstimationError):
        _ = MovingDistances("m", np.zeros(M), np.ones(M), group.origin, group.target, *ends, **bad).columns


def test_the_adjustment_of_a_moving_scene_is_that_of_the_still_one():
    """Rangers stand, a rigid body with targets turns: the same body, the same misfits, the same answer at the epoch."""
    rng = np.random.default_rng(8)
    rangers = np.array([[60.0, 0, 0], [-50.0, 30, 5], [0, -60.0, 2], [10.0, 55, -3], [-20.0, -30, 40]])
    body = 15.0 * rng.normal(size=(3, 3)) + [0, 0, 30.0]
    n = 3 * 5
    origin, target = (v.ravel() for v in np.meshgrid(3 * np.arange(5), n + 3 * np.arange(3), indexing="ij"))
    turns = Rotation.from_rotvec(rng.normal(size=(15, 3))).as_matrix()
    shifts, noise = 30.0 * rng.normal(size=(15, 3)), 1e-4 * rng.normal(size=15)
    x0 = np.concatenate([rangers.ravel(), body.ravel()])
    still = np.tile(np.eye(3), (15, 1, 1)), np.zeros((15, 3))
    held = Linear("rangers", x0[:n], np.full(n, 1e-10), np.arange(n), np.eye(n))
    start = x0 + 0.01 * rng.normal(size=len(x0))

    def solved(ends):
        exact = MovingDistances("m", np.zeros(15), np.full(15, 1e-8), origin, target, *still, *ends).predict(x0)[0]
        shots = MovingDistances("m", exact + noise, np.full(15, 1e-8), origin, target, *still, *ends)
        return adjust(start, [shots, held])

    moved, stood = solved((turns, shifts)), solved(still)
    assert moved.solved
    # each shot sees the body elsewhere, so geometry and answer differ; what the rangers' shots say of a body that was
    # carried together with them must not
    both = MovingDistances("m", np.zeros(15), np.full(15, 1e-8), origin, target, turns, shifts, turns, shifts)
    shots = MovingDistances(
        "m", both.predict(x0)[0] + noise, np.full(15, 1e-8), origin, target, turns, shifts, turns, shifts
    )
    together = adjust(start, [shots, held])
    np.testing.assert_allclose(together.x, stood.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(together.covariance, stood.covariance, rtol=1e-6, atol=1e-15)
    u = np.sqrt(np.diag(moved.covariance))
    assert np.abs((moved.x - x0) / u)[n:].max() < 4.0  # nine coordinates, 1e-4 m of noise, no outlier
