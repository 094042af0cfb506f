"""The test that nothing moved keeps its level and sees only what no datum explains."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import (
    Epochs,
    VarianceFactor,
    differences,
    pooled_variance_factor,
)
from draws import draws
from epoch_scene import FIELD, SIGMA, congruence_test, movement


def test_the_congruence_test_is_that_of_one_adjustment_of_both_epochs():
    """Sum of squares of a joint least squares with common points, less those of the epochs alone; plain numpy."""
    ranges = FIELD.ranges(np.random.default_rng(1), movement({4: [1e-4, 0, 0]}))

    def squares(a, b):
        left = b - a @ np.linalg.lstsq(a, b, rcond=None)[0]
        return left @ left / SIGMA**2

    apart = sum(squares(FIELD.design, r) for r in ranges)
    joint = squares(np.concatenate([FIELD.design] * 2), np.concatenate(ranges))
    test = congruence_test(FIELD.epochs(ranges))
    np.testing.assert_allclose(test.pvv, joint - apart, rtol=1e-6)  # curvature of 0.1 mm in 40 m
    assert test.degrees_of_freedom == 21
    np.testing.assert_allclose(test.p, stats.chi2.sf(test.pvv, 21), rtol=1e-9)
    estimated = congruence_test(FIELD.epochs(ranges), variance_factor=VarianceFactor(1.3, 17))
    np.testing.assert_allclose(estimated.p, stats.f.sf(test.pvv / 21 / 1.3, 21, 17), rtol=1e-9)


def p_values(runs, seed, factor):
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(runs):
        known = VarianceFactor() if factor is None else VarianceFactor(rng.chisquare(factor) / factor, factor)
        found.append(congruence_test(FIELD.epochs(FIELD.ranges(rng)), variance_factor=known).p)
    return np.array(found)


def check_level(p):
    for level in (0.05, 0.3):
        assert abs(np.mean(p < level) - level) < 3.5 * np.sqrt(level * (1 - level) / len(p))
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@draws(400)
@pytest.mark.parametrize("factor", [None, 12])
def test_false_alarms_come_at_their_level_in_a_few_runs(factor, runs):
    check_level(p_values(runs, 3, factor))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [None, 12])
def test_false_alarms_come_at_their_level_in_2000_runs(factor):
    check_level(p_values(2000, 4, factor))


def test_a_scale_or_a_levelled_datum_is_taken_out_and_no_more():
    first = FIELD.points
    q = np.eye(27) * SIGMA**2
    scaled = Epochs(FIELD.names, first, 1.001 * first, q, q)
    assert congruence_test(scaled, datum="similarity").pvv < 1e-6
    assert congruence_test(scaled, datum="rigid").p < 1e-12
    plumb = Epochs(FIELD.names, first, first @ Rotation.from_rotvec([0, 0, 0.3]).as_matrix(), q, q)
    assert congruence_test(plumb, datum="levelled").pvv < 1e-6
    tilted = Epochs(FIELD.names, first, first @ Rotation.from_rotvec([1e-4, 0, 0]).as_matrix(), q, q)
    assert congruence_test(tilted, datum="levelled").p < 1e-12
    assert congruence_test(tilted, datum="rigid").pvv < 1e-6
    assert congruence_test(tilted, datum="levelled").degrees_of_freedom == 23


def test_epochs_of_wrong_shape_or_name_are_refused():
    q = np.eye(6)
    with pytest.raises(EstimationError, match="names must be unique"):
        Epochs(("A", "A"), np.zeros((2, 3)), np.zeros((2, 3)), q, q)
    with pytest.raises(EstimationError, match=r"second epoch has shape \(3, 3\), expected \(2, 3\)"):
        Epochs(("A", "B"), np.zeros((2, 3)), np.zeros((3, 3)), q, q)
    with pytest.raises(EstimationError, match="nothing to test"):
        congruence_test(Epochs(("A",), np.eye(3)[:1], np.eye(3)[:1], np.eye(3), np.eye(3)))


def test_covariance_in_the_datum_of_stable_points_is_that_of_inner_constraints():
    """Against the bordered normal equations with the conditions of the chosen points; plain numpy."""
    chosen = np.arange(9) < 5
    e = np.repeat(chosen, 3)[:, None] * FIELD.g
    normal = FIELD.design.T @ FIELD.design / SIGMA**2
    scale = np.abs(normal).max() / np.abs(e).max()
    bordered = np.linalg.inv(np.block([[normal, scale * e], [scale * e.T, np.zeros((6, 6))]]))[:27, :27]
    still = (np.zeros(len(FIELD.design)),) * 2
    for start in ((FIELD.solve, FIELD.q), FIELD.held([0, 1, 2, 4, 5, 8])):
        found = differences(FIELD.epochs(still, first=start), "rigid", chosen).in_datum(chosen)[1]
        np.testing.assert_allclose(found, 2 * bordered, rtol=0, atol=1e-8 * np.abs(bordered).max())


def test_tests_are_scipys_and_power_is_that_of_the_tables():
    known, estimated = VarianceFactor(), VarianceFactor(1.0, 10)
    for rank in (1, 3, 20):
        nc = known.noncentrality(rank, 0.01, 0.9)
        assert stats.ncx2.sf(stats.chi2.isf(0.01, rank), rank, nc) == pytest.approx(0.9, abs=1e-9)
        nc = estimated.noncentrality(rank, 0.05, 0.8)
        assert stats.ncf.sf(stats.f.isf(0.05, rank, 10), rank, 10, nc) == pytest.approx(0.8, abs=1e-6)
    assert known.noncentrality(1, 0.001, 0.8) == pytest.approx(17.075, abs=1e-3)  # Baarda's nomogram
    assert known.noncentrality(3, 0.05, 0.8) == pytest.approx(10.903, abs=1e-3)  # common power tables
    pooled, p = pooled_variance_factor((0.7, 12.0), (2.1, 30.0))
    assert pooled == VarianceFactor((0.7 * 12 + 2.1 * 30) / 42, 42.0)
    assert p == pytest.approx(2 * stats.f.cdf(0.7 / 2.1, 12, 30))
    with pytest.raises(EstimationError, match="must be positive"):
        pooled_variance_factor((1.0, 0.0), (1.0, 5.0))


@draws(400, 200)
@pytest.mark.parametrize("turned", [False, True])
def test_plain_differences_in_the_datum_of_stable_points_scatter_as_claimed(turned, runs):
    """Each epoch held in a way of its own, the second in other axes: inner constraints on five points, by hand."""
    rng = np.random.default_rng(16)
    turn = Rotation.from_rotvec([0.3, -0.5, 1.0] if turned else [0.0, 0, 0]).as_matrix()
    stable, block = np.arange(9) < 5, np.kron(np.eye(9), turn)
    first, second = FIELD.held([0, 1, 2, 4, 5, 8]), FIELD.held([26, 25, 24, 12, 14, 9])
    chosen = np.repeat(stable, 3)[:, None] * FIELD.g
    onto = np.eye(27) - FIELD.g @ np.linalg.solve(chosen.T @ FIELD.g, chosen.T)
    errors = []
    for _ in range(runs):
        plain = FIELD.epochs(FIELD.ranges(rng), first=first, second=second)
        q2 = block @ plain.covariance_second @ block.T
        epochs = Epochs(plain.names, plain.first, plain.second @ turn.T + turned, plain.covariance_first, q2)
        found = differences(epochs, "rigid", stable)
        d, q = found.in_datum(stable)
        np.testing.assert_allclose(d, onto @ (plain.second - plain.first).ravel(), rtol=0, atol=2e-9)
        np.testing.assert_allclose(epochs.second @ found.turned.T + found.shifted - epochs.first, found.d.reshape(9, 3),
                                   rtol=0, atol=1e-12)  # fmt: skip
        errors.append(d)
    np.testing.assert_allclose(q, onto @ (first[1] + second[1]) @ onto.T, rtol=0, atol=1e-4 * q.max())
    white = np.linalg.solve(np.linalg.cholesky(q[15:, 15:]), np.array(errors).T[15:])
    np.testing.assert_allclose(white @ white.T / runs, np.eye(12), atol=5.0 * np.sqrt(2.0 / runs))
    other = differences(epochs, "rigid", np.ones(9, dtype=bool))  # aligned on all, seen from five
    np.testing.assert_allclose(other.in_datum(stable)[0], d, rtol=0, atol=2e-9)
    assert np.abs(other.d - d).max() > 1e-6
    with pytest.raises(EstimationError, match="2 stable points do not determine a rigid datum"):
        found.in_datum(np.arange(9) < 2)
