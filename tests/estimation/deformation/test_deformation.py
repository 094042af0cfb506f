"""Movements between epochs are found at the level claimed and with the power claimed, whatever the datum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import Epochs, VarianceFactor
from catseye.estimation.deformation.deformation import detectable_displacement, moved_points
from draws import draws
from epoch_scene import FIELD, SIGMA, congruence_test, movement


def test_displacements_are_those_of_one_adjustment_where_stable_points_are_common():
    """Every moved point has coordinates of its own in the second epoch, all others one set for both; plain numpy."""
    true = movement({2: [3e-4, 1e-4, 0], 6: [0, -4e-4, 2e-4]})
    ranges = FIELD.ranges(np.random.default_rng(2), true)
    found = moved_points(FIELD.epochs(ranges))
    assert [found.names[i] for i in np.flatnonzero(found.moved)] == ["P2", "P6"]
    extra = FIELD.design[:, [6, 7, 8, 18, 19, 20]]
    both = np.block([[FIELD.design, np.zeros_like(extra)], [FIELD.design, extra]])
    x = np.linalg.pinv(both) @ np.concatenate(ranges)
    q = SIGMA**2 * np.linalg.pinv(both.T @ both)
    np.testing.assert_allclose(found.displacement[[2, 6]].ravel(), x[-6:], rtol=0, atol=2e-9)
    np.testing.assert_allclose(found.covariance[2], q[-6:-3, -6:-3], rtol=0, atol=1e-5 * q[-1, -1])
    np.testing.assert_allclose(found.covariance[6], q[-3:, -3:], rtol=0, atol=1e-5 * q[-1, -1])
    np.testing.assert_allclose(found.statistic[2], x[-6:-3] @ np.linalg.solve(q[-6:-3, -6:-3], x[-6:-3]), rtol=1e-4)
    for i in (0, 8):  # a stable point's is what a column of its own would find
        own = np.concatenate([np.zeros((len(FIELD.design), 3)), FIELD.design[:, 3 * i : 3 * i + 3]])
        more = np.concatenate([both, own], axis=1)
        x = np.linalg.pinv(more) @ np.concatenate(ranges)
        q = SIGMA**2 * np.linalg.pinv(more.T @ more)[-3:, -3:]
        np.testing.assert_allclose(found.displacement[i], x[-3:], rtol=0, atol=2e-9)
        np.testing.assert_allclose(found.covariance[i], q, rtol=0, atol=1e-5 * q[0, 0])
    np.testing.assert_allclose(found.p, stats.chi2.sf(found.statistic, 3), rtol=1e-9)
    np.testing.assert_allclose(found.p_adjusted, np.minimum(9 * found.p, 1.0))
    assert found.stable.sum() == 7
    assert found.before.p < 1e-6 < 0.05 < found.after.p
    assert found.after.degrees_of_freedom == found.before.degrees_of_freedom - 6 == 15
    assert found.status.startswith("moved: P2, P6; the other 7 points are congruent")
    assert found.steps[-1].rest_p == pytest.approx(found.after.p)


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.booleans())
def test_no_decision_depends_on_how_either_epoch_was_held(seed, turned):
    rng = np.random.default_rng(seed)
    ranges = FIELD.ranges(rng, movement({int(rng.integers(9)): rng.normal(size=3) * 6e-5}))
    plain = moved_points(FIELD.epochs(ranges))
    other = FIELD.epochs(ranges, first=FIELD.held([0, 1, 2, 4, 5, 8]), second=FIELD.held([26, 25, 24, 12, 14, 9]))
    if turned:  # the second epoch in other axes altogether
        turn = Rotation.random(rng=rng).as_matrix()
        block = np.kron(np.eye(9), turn)
        other = Epochs(
            other.names, other.first, other.second @ turn.T + [5e3, 0, 7.0], other.covariance_first,
            block @ other.covariance_second @ block.T,
        )  # fmt: skip
    held = moved_points(other)
    assert held.status.partition("(")[0] == plain.status.partition("(")[0]
    np.testing.assert_array_equal(held.moved, plain.moved)
    np.testing.assert_allclose(held.before.pvv, plain.before.pvv, rtol=1e-3)  # curvature of 0.2 mm of datum in 40 m
    np.testing.assert_allclose(held.statistic, plain.statistic, rtol=0, atol=2e-3 * plain.statistic.max())
    np.testing.assert_allclose(held.displacement, plain.displacement, rtol=0, atol=2e-8)
    np.testing.assert_allclose(held.detectable, plain.detectable, rtol=1e-4)


@draws(400)
@pytest.mark.parametrize("rule", ["global", "local"])
def test_search_rarely_alarms_without_movement(rule, runs):
    rng = np.random.default_rng(5)
    alarms = sum(moved_points(FIELD.epochs(FIELD.ranges(rng)), rule=rule).moved.any() for _ in range(runs))
    assert alarms / runs < 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / runs)
    assert alarms / runs > 0.01  # a test that never speaks has no power


@draws(300)
def test_the_detectable_displacement_is_detected_with_its_power(runs):
    rng = np.random.default_rng(6)
    empty = FIELD.epochs((np.zeros(len(FIELD.design)),) * 2)
    size, direction = detectable_displacement(empty)
    hits = 0
    true = movement({5: size[5] * direction[5]})
    for _ in range(runs):
        epochs = FIELD.epochs(FIELD.ranges(rng, true))
        hits += congruence_test(epochs).p < 0.05
    assert abs(hits / runs - 0.8) < 3.5 * np.sqrt(0.8 * 0.2 / runs)
    np.testing.assert_allclose(size, moved_points(empty).detectable)


@draws(40)
@pytest.mark.parametrize("rule", ["global", "local"])
@pytest.mark.parametrize("moved", [1, 2, 3])
def test_planted_movements_of_one_to_three_points_are_found(moved, rule, runs):
    rng = np.random.default_rng([7, moved])
    right = 0
    size = detectable_displacement(FIELD.epochs((np.zeros(len(FIELD.design)),) * 2))[0].max()
    for _ in range(runs):
        which = rng.choice(9, moved, replace=False)
        vectors = rng.normal(size=(moved, 3))
        vectors *= 3.0 * size / np.linalg.norm(vectors, axis=1)[:, None]
        found = moved_points(
            FIELD.epochs(FIELD.ranges(rng, movement(dict(zip(which, vectors, strict=True))))), rule=rule
        )
        right += set(np.flatnonzero(found.moved)) == set(which)
    assert right >= 0.85 * runs  # the level itself costs 5 %


@draws(300)
def test_the_claimed_covariance_of_a_movement_holds_in_scatter(runs):
    rng = np.random.default_rng(8)
    true = movement({3: [4e-4, 0, 4e-4]})
    errors = []
    for _ in range(runs):
        found = moved_points(FIELD.epochs(FIELD.ranges(rng, true)), level=1e-4)
        assert found.moved[3]
        errors.append(np.linalg.solve(np.linalg.cholesky(found.covariance[3]), found.displacement[3] - true[3]))
    np.testing.assert_allclose(np.cov(np.array(errors).T), np.eye(3), atol=4.5 * np.sqrt(2.0 / runs))
    assert np.abs(np.mean(errors, axis=0)).max() < 4.0 / np.sqrt(runs)


@pytest.mark.parametrize("rule", ["global", "local"])
@pytest.mark.parametrize(("seed", "innocent"), [(63, "P3"), (398, "P4")])
def test_point_removed_because_of_others_is_readmitted(seed, innocent, rule):
    """Seeds where three movements make a fourth point look worst at first."""
    rng = np.random.default_rng([seed, 1])
    which, vectors = rng.choice(9, 3, replace=False), rng.normal(size=(3, 3))
    vectors *= 3e-4 / np.linalg.norm(vectors, axis=1)[:, None]
    ranges = FIELD.ranges(rng, movement(dict(zip(which, vectors, strict=True))))
    found = moved_points(FIELD.epochs(ranges), level=0.01, rule=rule)
    assert innocent in [step.name for step in found.steps]
    assert set(np.flatnonzero(found.moved)) == set(which)


def test_points_carried_from_the_first_epoch_are_held_and_define_the_datum():
    """The second epoch's datum points are the first's, covariance and all: their difference has none."""
    rng = np.random.default_rng(9)
    n, m = 6, 18
    root = rng.normal(size=(m, m)) * 5e-5
    q = root @ root.T
    own = np.concatenate([np.zeros(9), np.full(9, 1e-4**2)])  # of the second epoch's last three points
    gain = np.zeros((m, m))
    gain[:9, :9] = np.eye(9)
    gain[9:, :9] = 0.1 * rng.normal(size=(9, 9))  # they hang on the carried ones
    first = rng.uniform(-10, 10, (n, 3))
    second = first.copy()
    second[4, 2] += 2e-3
    names = tuple("ABCDEF")
    epochs = Epochs(names, first, second, q, gain @ q @ gain.T + np.diag(own), cross=q @ gain.T)
    found = moved_points(epochs, datum="rigid")
    np.testing.assert_array_equal(found.held, [True] * 3 + [False] * 3)
    assert not found.displacement[:3].any()
    assert not found.covariance[:3].any()
    assert np.isnan(found.p[:3]).all()
    np.testing.assert_array_equal(found.moved, [False] * 4 + [True, False])
    d = np.eye(m)[9:] @ (gain - np.eye(m)) @ q @ (gain - np.eye(m)).T @ np.eye(m)[:, 9:] + np.diag(own[9:])
    shift = (second - first)[3:].ravel()
    np.testing.assert_allclose(found.before.pvv, shift @ np.linalg.solve(d, shift), rtol=1e-6)
    assert found.before.degrees_of_freedom == 9  # three held points leave no motion of the datum
    second[1, 0] += 1e-5
    with pytest.raises(EstimationError, match=r"B is fixed: the difference of its x has no variance, but is 1e-05 m"):
        congruence_test(Epochs(names, first, second, q, gain @ q @ gain.T + np.diag(own), cross=q @ gain.T))


def test_a_coordinate_that_is_not_common_takes_no_part():
    rng = np.random.default_rng(10)
    first = rng.uniform(-10, 10, (7, 3))
    compared = np.ones((7, 3), dtype=bool)
    compared[6, :2] = False  # a benchmark
    q = np.eye(21) * 1e-10
    second = first + rng.normal(size=(7, 3)) * 1e-5
    second[6] += [5.0, -3.0, 1e-3]
    found = moved_points(Epochs(tuple("ABCDEFG"), first, second, q, q, compared=compared), datum="translation")
    np.testing.assert_array_equal(found.moved, [False] * 6 + [True])
    assert np.isnan(found.displacement[6, :2]).all()
    assert found.displacement[6, 2] == pytest.approx(1e-3, abs=1e-4)
    np.testing.assert_allclose(found.p[6], stats.chi2.sf(found.statistic[6], 1))
    assert found.before.degrees_of_freedom == 19 - 3
    spoiled = first + [0, 0, 1e-3] * np.cross([0, 0, 1.0], first)[:, ::-1] + 0.01 * np.cross([1.0, 0, 0], first)
    with pytest.raises(EstimationError, match="axes differ by"):
        moved_points(Epochs(tuple("ABCDEFG"), first, spoiled, q, q, compared=compared), datum="rigid")


def test_undecidable_cases_are_reported():
    q = np.eye(15) * 1e-10
    heights = np.zeros((5, 3), dtype=bool)
    heights[:, 2] = True
    flat = np.array([[0, 5, 0], [0, -5, 0], [-5, 0, 0], [0, 0, 0], [5, 0, 0]], dtype=float)
    risen = flat + 1e-4 * np.eye(5)[:, :1] * [0, 0, 1]
    tie = moved_points(Epochs(tuple("ABCDE"), flat, risen, q, q, compared=heights))  # C D E hold no tilt about x
    assert tie.status == "undecided: A or B moved, the observations cannot tell which"
    assert not tie.moved.any()
    rng = np.random.default_rng(11)
    wild = FIELD.epochs(FIELD.ranges(rng, rng.normal(size=(9, 3)) * 1e-2))
    assert moved_points(wild).status.startswith("undecided: without ")
    first = rng.uniform(-9, 9, (7, 3))
    apart = first + np.array([[0.01, 0, 0]] * 3 + [[0, 0, 0]] * 4) * [[1], [2], [3], [0], [0], [0], [0]]
    q = np.eye(21) * 1e-10
    few = moved_points(Epochs(tuple("ABCDEFG"), first, apart, q, q), datum="absolute")
    assert few.status.startswith("moved: A, B, C;")
    apart[3] += [0, 0.02, 0]
    many = moved_points(Epochs(tuple("ABCDEFG"), first, apart, q, q), datum="absolute")
    assert "those may have moved instead" in many.status


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"datum": "floating"}, "unknown datum 'floating'"),
        ({"datum": "absolute"}, "has zero variance, and no free motion explains it; free more of the datum"),
        ({"rule": "best"}, "unknown rule 'best'"),
    ],
)
def test_what_makes_no_sense_is_refused(options, said):
    with pytest.raises(EstimationError, match=said):
        moved_points(FIELD.epochs(FIELD.ranges(np.random.default_rng(0))), **options)


def test_of_two_points_the_distance_alone_is_compared():
    first = np.array([[0.0, 0, 0], [30.0, 40.0, 0]])
    second = np.array([[0.0, 0, 0], [0, 0, 50.0 + 1e-4]])
    epochs = Epochs(("A", "B"), first, second, np.eye(6) * 1e-10, np.eye(6) * 1e-10)
    test = congruence_test(epochs)
    assert test.degrees_of_freedom == 1
    assert test.pvv == pytest.approx(1e-8 / 4e-10, rel=1e-6)  # 100 um, four times 10 um squared
    assert moved_points(epochs).status.startswith(
        "undecided: without any point the other points are still not congruent"
    )


def test_with_a_variance_factor_covariance_and_power_follow_it():
    ranges = FIELD.ranges(np.random.default_rng(12), movement({1: [3e-4, 0, 0]}))
    plain = moved_points(FIELD.epochs(ranges))
    doubled = moved_points(FIELD.epochs(ranges), variance_factor=VarianceFactor(4.0))
    np.testing.assert_allclose(doubled.covariance[1], 4.0 * plain.covariance[1])
    np.testing.assert_allclose(doubled.statistic[1], plain.statistic[1] / 4.0)
    np.testing.assert_allclose(doubled.detectable, 2.0 * plain.detectable)
