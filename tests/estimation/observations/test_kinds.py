"""Laws of all observation kinds: derivatives match values, -1 is no parameter, invalid input is refused."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from catseye.errors import EstimationError
from catseye.estimation.observations import kinds
from draws import examples
from estimation.kinds_scene import N, P, groups, of_kinds

seeds = st.integers(0, 2**32 - 1)

NAMES = [type(g).__name__ for g in groups(0)[0]]


def wide(group, jacobian):
    """The Jacobian over all parameters."""
    if group.columns.ndim == 1:
        columns = np.broadcast_to(group.columns, jacobian.shape)
    else:
        columns = group.columns
    assert not np.any(jacobian[columns < 0]), "a derivative by no parameter"
    whole = np.zeros((len(jacobian), N + 1))
    np.add.at(whole, (np.arange(len(jacobian))[:, None], columns), jacobian)
    return whole[:, :N]


def by_difference(group, x, step=1e-3):
    """Derivatives of the values by differences of fourth order."""
    slopes = np.empty((len(group.observed), N))
    for column in range(N):
        up = (np.arange(N) == column) * step
        f = [group.predict(x + k * up)[0] for k in (-2, -1, 1, 2)]
        slopes[:, column] = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
    return slopes


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
@examples(12)
@given(seed=seeds)
def test_derivatives_are_those_of_the_values(which, seed):
    made, x = groups(seed)
    group = replace(made[which], observed=made[which].predict(x)[0])  # so that no angle changes its turn on the way
    values, jacobian = group.predict(x)
    if isinstance(group, kinds.ObservedTilts):  # near the vertical an axis bends faster than differences can follow
        assume(np.abs(np.sin(values - np.where(group.zero < 0, 0.0, x[group.zero]))).max() < 0.99)
    expected = by_difference(group, x)
    steep = np.maximum(1.0, np.abs(expected).max(axis=1, keepdims=True))
    np.testing.assert_allclose(wide(group, jacobian) / steep, expected / steep, rtol=0, atol=1e-8)


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
def test_a_report_can_name_every_row(which):
    made, x = groups(3)
    group = made[which]
    m = len(group.observed)
    assert group.kind
    assert len(group.units) == len(group.kinds) == len(group.component) == m
    assert set(group.component) <= {"", "x", "y", "z", "1", "2"}
    assert all(end.shape == (m,) for end in group.ends)
    assert set(group.units) <= ({"m", "rad", ""} if type(group).__name__ in ("Linear", "Joint") else {"m", "rad"})
    values, jacobian = group.predict(x)
    assert values.shape == (m,)
    assert jacobian.shape == ((m, len(group.columns)) if group.columns.ndim == 1 else group.columns.shape)


def test_every_kind_is_held_to_the_laws():
    """`kinds_scene.py` has a group of each; moving ranges have laws of their own."""
    others = {"ObservationGroup", "ObservationKind", "Reported", "MovingDistances"}
    assert set(NAMES) == set(kinds.__all__) - others


def test_kinds_have_names_of_their_own():
    made, _ = groups(0)
    assert len({g.kind for g in made}) == len(made)


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
def test_rows_are_independent_of_each_other(which):
    """Values follow from the parameters of a row alone: changing others leaves them, so columns are complete."""
    made, x = groups(5)
    group = made[which]
    values = group.predict(x)[0]
    columns = np.broadcast_to(group.columns, (len(values), group.columns.shape[-1]))
    for row in range(len(values)):
        changed = x + 0.3
        mine = columns[row][columns[row] >= 0]
        changed[mine] = x[mine]
        np.testing.assert_allclose(group.predict(changed)[0][row], values[row], rtol=0, atol=1e-12)


DIRECTED = (
    kinds.Distances, kinds.HorizontalDistances, kinds.DistanceDifferences, kinds.FixedDistances, kinds.Directions,
    kinds.Azimuths, kinds.HorizontalAngles, kinds.ZenithAngles, kinds.Inclinations,
)  # fmt: skip


@pytest.mark.parametrize("which", range(len(NAMES) - 1), ids=NAMES[:-1])
def test_coinciding_points_give_nan_only_in_their_row(which):
    made, x = groups(4)
    shifts = {name: None for name in vars(made[which]) if "shift" in name}
    group = replace(made[which], **shifts)
    x[3:6] = x[0:3]  # the ends of row 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values, jacobian = group.predict(x)
    assert not np.isinf(values).any()
    assert not np.isinf(jacobian).any()
    undefined = np.isnan(jacobian).any(axis=1)
    assert undefined[0] == isinstance(group, DIRECTED)
    assert not undefined[1:].any()
    assert not np.isnan(values[1:]).any()


def test_a_point_at_the_centre_of_its_sphere_and_an_upright_axis_have_no_derivative():
    sphere = kinds.PointsOnSphere("s", np.zeros(1), np.ones(1), P[:1], P[1:2], 1.0)
    assert np.isnan(sphere.predict(np.ones(6))[1][0, :6]).all()
    upright = kinds.ObservedTilts("t", np.zeros(1), np.ones(1), np.array([0.0, 0.0, 1.0]), np.arange(3), np.eye(3))
    values, jacobian = upright.predict(np.zeros(3))
    assert np.isnan(values).all()
    assert np.isnan(jacobian[:, :3]).all()


def test_a_vertical_sight_has_no_azimuth_and_no_slope():
    x = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 50.0, 0.0])
    at = np.array([0]), np.array([3])
    for group in (
        kinds.Directions("d", np.zeros(1), np.ones(1), *at, np.array([6])),
        kinds.Azimuths("a", np.zeros(1), np.ones(1), *at),
        kinds.ZenithAngles("z", np.zeros(1), np.ones(1), *at),
        kinds.Inclinations("i", np.zeros(1), np.ones(1), *at),
    ):
        values, jacobian = group.predict(x)
        assert np.isnan(values).all()
        assert np.isnan(jacobian).any()


def test_a_parameter_that_is_absent_counts_as_zero():
    at = np.array([0]), np.array([3])
    x = np.array([0.0, 0.0, 0.0, 3.0, 4.0, 5.0, 0.0])
    one = np.ones(1)
    unknown, absent = np.array([6]), np.array([-1])
    for make in (
        lambda c: kinds.Directions("a", one, one, *at, c),
        lambda c: kinds.ZenithAngles("a", one, one, *at, refraction_column=c),
        lambda c: kinds.Inclinations("a", one, one, *at, zero=c),
        lambda c: kinds.LevelPlanes("a", one, one, at[0], c),
        lambda c: kinds.PointsOnSphere("a", one, one, *at, 1.0, c),
        lambda c: kinds.Distances("a", one, one, *at, nuisance=c[:, None]),
        lambda c: kinds.Distances("a", one, one, *at, scaling=c[:, None]),
    ):
        there, gone = make(unknown), make(absent)
        values, jacobian = there.predict(x)
        np.testing.assert_array_equal(values, gone.predict(x)[0])
        expected = np.where(there.columns == 6, 0.0, jacobian)
        assert np.any(expected != jacobian)
        np.testing.assert_array_equal(gone.predict(x)[1], expected)


def test_joint_group_stacks_its_parts():
    made, x = groups(9)
    parts = of_kinds(made, "Distances", "Directions", "Linear")
    joint = kinds.Joint.of("j", parts, np.eye(12))
    values, jacobian = joint.predict(x)
    expected = [wide(p, p.predict(x)[1]) for p in parts]
    np.testing.assert_array_equal(values, np.concatenate([p.predict(x)[0] for p in parts]))
    np.testing.assert_allclose(wide(joint, jacobian), np.concatenate(expected), rtol=0, atol=0)
    assert joint.units.tolist() == ["m"] * 4 + ["rad"] * 4 + [""] * 4
    assert joint.kinds.tolist() == ["slope_distance"] * 4 + ["direction"] * 4 + ["linear"] * 4
    origin, target = joint.ends
    assert origin.tolist() == [*P[:4], *P[:4], -1, -1, -1, -1]
    assert target.tolist() == [*P[[1, 2, 3, 0]], *P[[1, 2, 3, 0]], -1, -1, -1, -1]


def test_the_angles_of_a_joint_group_choose_their_turn_by_its_own_observed_values():
    azimuth = kinds.Azimuths("a", np.zeros(1), np.ones(1), P[:1], P[1:2])
    x = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 0.0])
    joint = replace(kinds.Joint.of("j", (azimuth,), np.eye(1)), observed=np.array([6.5]))
    np.testing.assert_allclose(joint.predict(x)[0], 2.25 * np.pi, rtol=1e-15)


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
def test_a_covariance_that_does_not_fit_is_refused(which):
    group = groups(0)[0][which]
    m = len(group.observed)
    with pytest.raises(EstimationError, match=rf"a: the covariance has shape .* there are {m} observations"):
        replace(group, covariance=np.ones(m + 1))


def test_indices_that_do_not_fit_are_refused():
    two, one = np.array([0, 3]), np.ones(1)
    with pytest.raises(EstimationError, match=r"d: indices of shape \(2, 3\) for 1 rows"):
        kinds.Distances("d", one, one, two, two + 3)
    with pytest.raises(EstimationError, match=r"d: indices of shape \(1,\) for 1 rows"):
        kinds.Distances("d", one, one, two[:1], two[1:], nuisance=np.array([6]))
    with pytest.raises(EstimationError, match=r"row 0 names no point \(column -1\)"):
        kinds.Distances("d", one, one, np.array([-1]), two[1:])
    with pytest.raises(EstimationError, match="an axis is 3, expected 0, 1 or 2"):
        kinds.ObservedCoordinates("c", one, one, two[:1], np.array([3]))


def test_a_start_that_is_no_rotation_or_no_direction_is_refused():
    point, pose, nine = P[:1], np.arange(3, 9), (np.zeros(3), np.ones(3))
    with pytest.raises(EstimationError, match="b: the start R0 is not orthonormal"):
        kinds.RigidBodies("b", *nine, point, pose, 1.001 * np.eye(3))
    with pytest.raises(EstimationError, match="b: the start R0 has determinant -1"):
        kinds.FramePoints("b", *nine, point, pose, np.diag([1.0, 1.0, -1.0]), np.array([9]))
    with pytest.raises(EstimationError, match="p: the normal has zero length"):
        kinds.PointsOnPlane("p", np.zeros(1), np.ones(1), point, np.zeros(3), np.zeros(3), np.array([3, 4, 5]))
    with pytest.raises(EstimationError, match="p: the line has zero length"):
        kinds.PointsOnLine("p", np.zeros(2), np.ones(2), point, np.zeros(3), np.zeros(3), np.array([3, 4, 5, 6]))


def test_forty_thousand_distances_keep_their_own_columns():
    rng = np.random.default_rng(1)
    m = 40_000
    origin, target = 3 * rng.integers(0, 18, m), 3 * rng.integers(18, 2227, m)
    x = 50.0 * rng.normal(size=3 * 2227 + 18)
    group = kinds.Distances("d", np.zeros(m), np.ones(m), origin, target, nuisance=3 * 2227 + origin[:, None] // 3)
    values, jacobian = group.predict(x)
    assert jacobian.shape == group.columns.shape == (m, 7)
    xyz = x[: 3 * 2227].reshape(-1, 3)
    np.testing.assert_allclose(
        values, np.linalg.norm(xyz[target // 3] - xyz[origin // 3], axis=1) + x[3 * 2227 + origin // 3], rtol=1e-14
    )
