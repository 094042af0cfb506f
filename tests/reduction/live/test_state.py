"""Filter state against plain matrices: full Kalman update, explicit random walks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.geometry.frames.frame import Transform
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.live.state import (
    DEFAULT_NOISE,
    Carried,
    from_ground,
    marginal,
    predict,
    to_ground,
    update_correlated,
    with_reference,
    with_velocities,
)
from parameter_scene import parameter, parameters

seeds = st.integers(0, 2**32 - 1)
BODIES = {"A": "arm", "B": "arm", "C": "arm", "D": "dish", "E": "alidade"}
NAMES = (
    *(f"{p} {a}" for p in ("A", "B", "C", "D", "E", "ZY1", "ZY1-F") for a in "xyz"),
    "zero ZY1",
    "leakage ZY1 real",
    "leakage ZY1 imaginary",
    "the air WX1",
    "the air bend",
    "normal D 1",
)


def zero(name):
    return Parameter(ParameterKind.ZERO, name)


def spd(rng, n, size=1.0):
    a = rng.normal(size=(n, n + 2))
    return size * (a @ a.T) / n


def state(seed=0, names=NAMES):
    rng = np.random.default_rng(seed)
    return Carried(parameters(names), 10.0 * rng.normal(size=len(names)), spd(rng, len(names), 1e-6), 1000, 0.7)


@settings(max_examples=60)
@given(seed=seeds, shared=st.integers(1, 5), outside=st.integers(1, 5), new=st.integers(0, 4))
def test_unobserved_states_follow_the_full_kalman_update(seed, shared, outside, new):
    rng = np.random.default_rng(seed)
    old = tuple(zero(f"s{k}") for k in rng.permutation(shared + outside))
    before = Carried(old, rng.normal(size=len(old)), spd(rng, len(old)), 0, 0.1)
    seen = (*(old[k] for k in rng.permutation(len(old))[:shared]), *(zero(f"n{k}") for k in range(new)))
    # the full problem: old states, then new ones with a prior of their own, and observations of the seen
    names = (*old, *seen[shared:])
    n = len(names)
    p, x = np.zeros((n, n)), np.concatenate([before.x, rng.normal(size=new)])
    p[: len(old), : len(old)], p[len(old) :, len(old) :] = before.covariance, spd(rng, new) if new else 0.0
    at = [names.index(name) for name in seen]
    h, r = np.zeros((6, n)), spd(rng, 6)
    h[:, at] = rng.normal(size=(6, len(at)))
    z = rng.normal(size=6)

    def updated(x, p, h):
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
        return x + gain @ (z - h @ x), p - gain @ h @ p

    whole_x, whole_p = updated(x, p, h)
    part_x, part_p = updated(x[at], p[np.ix_(at, at)], h[:, at])
    after = update_correlated(before, Carried(seen, part_x, part_p, 5, 0.2))
    order = [after.parameters.index(name) for name in names]
    np.testing.assert_allclose(after.x[order], whole_x, rtol=0, atol=1e-8)
    np.testing.assert_allclose(after.covariance[np.ix_(order, order)], whole_p, rtol=0, atol=1e-8)
    np.testing.assert_allclose(after.covariance, after.covariance.T, rtol=0, atol=1e-10)  # what was seen is by inverses
    assert (after.ticks, after.elevation) == (5, 0.2)


def test_observed_states_are_replaced_by_their_estimate():
    before, seen = state(1, ("zero a", "zero b", "zero c")), state(2, ("zero c", "zero b"))
    after = update_correlated(before, seen)
    np.testing.assert_array_equal(after.covariance[:2, :2], seen.covariance)
    np.testing.assert_array_equal(after.x[:2], seen.x)
    assert update_correlated(seen, before) is before, "everything was seen"


def test_reference_positions_are_fully_correlated_copies_and_replaceable():
    first = with_reference(state(3), ["A", "D"])
    now, then = (first.columns(parameters(t)) for t in (["A x", "D z"], ["A@0 x", "D@0 z"]))
    np.testing.assert_array_equal(first.x[now], first.x[then])
    p = first.covariance
    np.testing.assert_array_equal(p[np.ix_(now, now)], p[np.ix_(now, then)])
    np.testing.assert_array_equal(p[np.ix_(then, then)], p[np.ix_(now, now)])
    moved = Carried(first.parameters, first.x + 1.0, first.covariance, 9, 0.1)
    again = with_reference(moved, ["A"])
    assert sum("@0" in name for name in again.names) == 6, "D keeps its old reference, A has a new one"
    now, then = (again.columns([parameter(t)]) for t in ("A y", "A@0 y"))
    np.testing.assert_array_equal(again.x[then], again.x[now])


def test_marginal_leaves_other_parameters_unchanged():
    whole = state(4)
    left = marginal(whole, set(parameters(["A x", "zero ZY1"])))
    at = [i for i, name in enumerate(whole.names) if name not in {"A x", "zero ZY1"}]
    np.testing.assert_array_equal(left.x, whole.x[at])
    np.testing.assert_array_equal(left.covariance, whole.covariance[np.ix_(at, at)])


def test_velocities_are_added_once_and_are_uncorrelated():
    one = with_velocities(state(5), ["A", "D"], DEFAULT_NOISE)
    assert with_velocities(one, ["A", "D"], DEFAULT_NOISE).names == one.names
    rate = one.columns(parameters(f"{p} rate {a}" for p in "AD" for a in "xyz"))
    np.testing.assert_allclose(one.covariance[np.ix_(rate, rate)], (0.02e-3) ** 2 * np.eye(6), rtol=1e-12, atol=0)
    rest = np.setdiff1d(np.arange(len(one.x)), rate)
    assert not one.covariance[np.ix_(rate, rest)].any()
    assert not one.x[rate].any()


def cross(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


@pytest.mark.parametrize(("seconds", "degrees"), [(0.0, 0.0), (10.0, 0.0), (1800.0, -7.0), (-5.0, 1.0)])
def test_process_noise_agrees_with_explicit_matrices(seconds, degrees):
    before = with_velocities(with_reference(state(6), ["A"]), ["B", "E"], DEFAULT_NOISE)
    elevation = 0.7 + np.radians(degrees)
    after = predict(before, 2000, seconds, elevation=elevation, bodies=BODIES, noise=DEFAULT_NOISE, profile_sigma=0.5)
    t, n = max(seconds, 0.0), len(before.x)
    column = {name: i for i, name in enumerate(before.names)}
    f, q = np.eye(n), np.zeros((n, n))
    for point in ("B", "E"):
        for axis in "xyz":
            i, j = column[f"{point} {axis}"], column[f"{point} rate {axis}"]
            f[i, j] = t
            walk = (0.002e-3) ** 2
            q[i, i] += walk * t**3 / 3
            q[i, j] += walk * t**2 / 2
            q[j, i] += walk * t**2 / 2
            q[j, j] += walk * t
    f[column["the air bend"], column["the air bend"]] = np.exp(-t / 1800.0)
    q[column["the air bend"], column["the air bend"]] = 0.25 * (1.0 - np.exp(-2.0 * t / 1800.0))
    x = f @ before.x
    hours, far = t / 3600.0, abs(degrees)
    for body in ("arm", "dish", "alidade"):
        mine = [p for p in BODIES if BODIES[p] == body]
        places = np.array([[x[column[f"{p} {a}"]] for a in "xyz"] for p in mine])
        shift = np.hypot(DEFAULT_NOISE.body_mm[body], 2.0 * far) * 1e-3
        turn = np.hypot(DEFAULT_NOISE.body_rad[body], 5e-5 * far)
        design = np.vstack([np.hstack([np.eye(3), -cross(p - places.mean(axis=0))]) for p in places])  # w x r = -r x w
        own = (DEFAULT_NOISE.point_mm[body] ** 2 + (0.5 * far) ** 2 + 0.3**2 * hours) * 1e-6
        at = np.array([column[f"{p} {a}"] for p in mine for a in "xyz"])
        q[np.ix_(at, at)] += design @ np.diag([shift**2] * 3 + [turn**2] * 3) @ design.T + own * np.eye(len(at))
    for axis in "xyz":
        both = [column[f"ZY1 {axis}"], column[f"ZY1-F {axis}"]]
        q[np.ix_(both, both)] += (0.02e-3) ** 2 * hours
    q[column["zero ZY1"], column["zero ZY1"]] = (0.01e-3) ** 2 * hours
    for part in ("real", "imaginary"):
        q[column[f"leakage ZY1 {part}"], column[f"leakage ZY1 {part}"]] = 1e-8 * hours
    q[column["the air WX1"], column["the air WX1"]] = 0.05**2 * hours
    np.testing.assert_allclose(after.x, x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(after.covariance, f @ before.covariance @ f.T + q, rtol=1e-12, atol=1e-18)
    assert (after.ticks, after.elevation) == (2000, elevation)
    np.testing.assert_array_equal(
        before.x, with_velocities(with_reference(state(6), ["A"]), ["B", "E"], DEFAULT_NOISE).x
    )


def test_profile_returns_to_its_prior_and_reference_positions_stay():
    before = with_reference(state(7), ["A", "D"])
    after = predict(before, 0, 24 * 3600.0, elevation=0.7, bodies=BODIES, noise=DEFAULT_NOISE, profile_sigma=0.4)
    bend = after.columns([parameter("the air bend")])[0]
    assert after.x[bend] == pytest.approx(0.0, abs=1e-12)
    assert after.covariance[bend, bend] == pytest.approx(0.16, rel=1e-9)
    assert np.abs(np.delete(after.covariance[bend], bend)).max() < 1e-12
    old = [i for i, name in enumerate(before.names) if "@0" in name]
    np.testing.assert_array_equal(after.covariance[np.ix_(old, old)], before.covariance[np.ix_(old, old)])


@settings(max_examples=40)
@given(seed=seeds)
def test_state_survives_the_round_trip_through_the_ground_frame(seed):
    rng = np.random.default_rng(seed)
    before = state(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    frames = {"A": Transform("ground", "reflector", turn * np.sign(np.linalg.det(turn)), rng.normal(size=3))}
    x, p = to_ground(before, frames)
    np.testing.assert_allclose(x[:3], frames["A"].points(before.x[:3]), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(x[3:], before.x[3:])
    back = from_ground(before.parameters, x, p, frames=frames, ticks=1, elevation=0.0)
    np.testing.assert_allclose(back.x, before.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.covariance, before.covariance, rtol=0, atol=1e-18)


@pytest.mark.parametrize("velocities", [False, True])
def test_covariance_stays_symmetric_positive_and_bounded_over_500_epochs(velocities):
    rng, now = np.random.default_rng(9), with_reference(state(8), ["A", "B", "C", "D"])
    if velocities:
        now = with_velocities(now, list("ABCDE"), DEFAULT_NOISE)
    seen_names = [n for n in NAMES if not n.startswith("E ")]
    r = 1e-8
    for epoch in range(500):
        now = predict(
            now, epoch, 10.0, elevation=0.7 + 1e-4 * epoch, bodies=BODIES, noise=DEFAULT_NOISE, profile_sigma=0.4
        )
        at = now.columns(parameters(seen_names))
        p, h = now.covariance[np.ix_(at, at)], rng.normal(size=(40, len(at)))
        gain = np.linalg.solve(h @ p @ h.T + r * np.eye(40), h @ p).T
        after = p - gain @ h @ p
        x = now.x[at] + gain @ rng.normal(0.0, 1e-4, 40)
        now = update_correlated(now, Carried(parameters(seen_names), x, 0.5 * (after + after.T), epoch, now.elevation))
        np.testing.assert_allclose(now.covariance, now.covariance.T, rtol=0, atol=1e-20)
    size = np.sqrt(np.diag(now.covariance))
    low = np.linalg.eigvalsh(now.covariance / np.outer(size, size))[0]
    assert low > 1e-9  # far above the rounding of 500 updates, 500 * 1e-16
    seen = size[: len(seen_names)]
    assert seen.max() < 0.5  # the air's profile at most; nothing seen grows
    points = [i for i, n in enumerate(now.names) if n.startswith(("A ", "B ", "C ", "D "))]
    assert size[points].max() < 2e-3


def test_points_are_indexed_by_name():
    one = state(2)
    assert one.points() == {"A": 0, "B": 3, "C": 6, "D": 9, "E": 12, "ZY1": 15}
    assert one.points(ParameterKind.FIXED_POINT) == {"ZY1": 18}
    with pytest.raises(KeyError):
        one.columns([parameter("nobody x")])


def test_path_index_returns_to_its_prior():
    """Half an hour takes e^-1 of it and gives 1 - e^-2 of its variance back."""
    path = parameters(["path ZY1 A", "normal A 1"])
    before = Carried(path, np.array([0.1, 2.0]), np.array([[4e-4, 1e-4], [1e-4, 1.0]]), 0, 0.5)
    after = predict(
        before, 1, 1800.0, elevation=0.5, bodies={}, noise=DEFAULT_NOISE, profile_sigma=0.5, path_sigma_ppm=0.105
    )
    kept = np.exp(-1.0)
    np.testing.assert_allclose(after.x, [0.1 * kept, 2.0], rtol=1e-12)
    expected = [[4e-4 * kept**2 + (1 - kept**2) * 0.105**2, 1e-4 * kept], [1e-4 * kept, 1.0]]
    np.testing.assert_allclose(after.covariance, expected, rtol=1e-12)
