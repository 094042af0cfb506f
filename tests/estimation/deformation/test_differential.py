"""Movements come from changes of ranges, with all that the approximate places and the constraints cost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from catseye.errors import EstimationError
from catseye.estimation.deformation.differential import (
    DETERMINED,
    allowed_directions,
    change_of_range,
    constrained,
    rigid_group,
)

SIGMA = 20e-6  # m
STATIONS = np.array([[90, 0, 0], [45, 78, 2], [-45, 78, -1], [-90, 0, 1], [-45, -78, 0], [45, -78, 3]], dtype=float)


def displacements(stations, points, changes, *, sigma, **places):
    """Movements of single points, each a group of one that may move anywhere."""
    own = sigma if np.ndim(sigma) < 2 else sigma[..., None, :]
    return constrained(stations, points[..., None, :], changes[..., None, :], sigma=own, basis=np.eye(3), **places)


GROUP = np.array([[5, 0, 40], [-5, 2, 42], [0, -6, 45], [3, 8, 50]], dtype=float)


@settings(max_examples=60)
@given(st.integers(0, 2**31), st.floats(1e-6, 3.0))
def test_without_noise_a_movement_of_any_size_is_recovered_exactly(seed, size):
    """Metres too: no term of the second order is left out. The change is a plain difference of two norms."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-20, -20, 20], [20, 20, 60], (7, 3))
    true = rng.normal(size=(7, 3)) * size
    before, after = (np.linalg.norm(p[:, None] - STATIONS, axis=-1) for p in (points, points + true))
    found = displacements(STATIONS, points, after - before, sigma=SIGMA)
    assert set(found.status) == {DETERMINED}
    np.testing.assert_allclose(found.displacement[:, 0], true, rtol=0, atol=1e-10)  # the step where it stops
    np.testing.assert_allclose(change_of_range(STATIONS, points, true), after - before, rtol=0, atol=5e-13)


def test_it_is_the_weighted_least_squares_that_scipy_finds():
    rng = np.random.default_rng(1)
    sigma = np.array([1, 2, 3, 4, 5, 6.0]) * 1e-4
    change = change_of_range(STATIONS, GROUP[0], np.array([0.5, -0.3, 0.2])) + rng.normal(size=6) * sigma
    found = displacements(STATIONS, GROUP[0], change, sigma=sigma)

    def residuals(dx):
        both = (np.linalg.norm(p - STATIONS, axis=1) for p in (GROUP[0] + dx, GROUP[0]))
        return (change - next(both) + next(both)) / sigma

    theirs = least_squares(residuals, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(found.displacement[0], theirs.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.pvv, 2 * theirs.cost, rtol=1e-6)
    np.testing.assert_allclose(found.noise, np.linalg.inv(theirs.jac.T @ theirs.jac), rtol=1e-5)
    assert found.degrees_of_freedom == 3
    np.testing.assert_allclose(found.residual[0] / sigma, residuals(theirs.x), atol=1e-4)


def test_missing_channels_are_ignored_and_too_few_are_reported():
    changes = change_of_range(STATIONS, GROUP, np.full((4, 3), 1e-3))
    changes[0, :2] = np.nan
    changes[1, 2:] = np.nan
    found = displacements(STATIONS, GROUP, changes, sigma=SIGMA)
    np.testing.assert_allclose(found.displacement[[0, 2, 3], 0], 1e-3, rtol=0, atol=1e-12)
    assert np.isnan(found.displacement[1]).all()
    assert np.isnan(found.covariance[1]).all()
    assert found.status[1] == "undetermined: 2 of 3 directions observed by 2 channels"
    np.testing.assert_array_equal(found.rank, [3, 2, 3, 3])
    np.testing.assert_array_equal(found.degrees_of_freedom, [1, 0, 3, 3])
    assert np.isnan(found.residual[0, 0, :2]).all()
    alone = displacements(STATIONS[2:], GROUP[:1], changes[:1, 2:], sigma=SIGMA)
    np.testing.assert_allclose(found.covariance[0], alone.covariance[0], rtol=1e-12)
    flat = displacements(STATIONS * [1, 1, 0], GROUP[0] * [1, 1, 0], np.full(6, 1e-4), sigma=SIGMA)
    assert flat.status == "undetermined: 2 of 3 directions observed by 6 channels"
    nothing = displacements(STATIONS, GROUP[0], np.full(6, np.nan), sigma=SIGMA)
    assert nothing.status == "undetermined: 0 of 3 directions observed by 0 channels"
    lost = displacements(STATIONS, GROUP[0], np.full(6, -200.0), sigma=SIGMA)  # further than the stations are
    assert str(lost.status).startswith("not converged")
    assert np.isnan(lost.displacement).all()


def test_epochs_and_points_broadcast_and_each_is_as_if_alone():
    rng = np.random.default_rng(2)
    true = rng.normal(size=(5, 4, 3)) * 1e-3
    sigma = rng.uniform(1, 3, (4, 6)) * SIGMA
    changes = change_of_range(STATIONS, GROUP, true) + rng.normal(size=(5, 4, 6)) * sigma
    found = displacements(STATIONS, GROUP, changes, sigma=sigma, u_stations=0.1, u_points=0.2)
    assert found.displacement.shape == (5, 4, 1, 3)
    one = displacements(STATIONS, GROUP[3], changes[2, 3], sigma=sigma[3], u_stations=0.1, u_points=0.2)
    np.testing.assert_allclose(found.displacement[2, 3], one.displacement, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.covariance[2, 3], one.covariance, rtol=1e-9, atol=1e-25)


def test_sensitivities_are_the_derivatives_by_the_approximate_places():
    true, h = np.array([0.4, -0.3, 0.6]), 1e-4
    change = change_of_range(STATIONS, GROUP[0], true)
    found = displacements(STATIONS, GROUP[0], change, sigma=SIGMA)
    for i, e in enumerate(np.eye(3) * h):
        ends = [displacements(STATIONS, GROUP[0] + s * e, change, sigma=SIGMA).displacement[0] for s in (1, -1)]
        np.testing.assert_allclose(found.sensitivity_points[:, i], (ends[0] - ends[1]) / (2 * h), atol=1e-7)
    for k in range(18):
        e = np.zeros(18)
        e[k] = h
        ends = [
            displacements(STATIONS + s * e.reshape(6, 3), GROUP[0], change, sigma=SIGMA).displacement[0]
            for s in (1, -1)
        ]
        np.testing.assert_allclose(found.sensitivity_stations[:, k], (ends[0] - ends[1]) / (2 * h), atol=1e-7)
    size = np.abs(found.sensitivity_points).max()
    assert 1e-3 < size < 0.05  # the movement over the distance, times the geometry: 0.8 m in 100 m


def check_budget(runs, seed):
    """Places wrong by 5 cm, a movement of 50 mm: their part is about that of the noise, and the budget holds."""
    rng = np.random.default_rng(seed)
    true, u = np.array([0.03, -0.02, 0.035]), 0.05
    found_errors = []
    for _ in range(runs):
        stations, point = STATIONS + rng.normal(size=(6, 3)) * u, GROUP[0] + rng.normal(size=3) * u
        changes = change_of_range(STATIONS, GROUP[0], true) + rng.normal(size=6) * SIGMA
        found_errors.append(displacements(stations, point, changes, sigma=SIGMA).displacement[0] - true)
    claimed = displacements(STATIONS, GROUP[0], change_of_range(STATIONS, GROUP[0], true), sigma=SIGMA,
                            u_stations=u, u_points=u)  # fmt: skip
    assert 0.2 < np.trace(claimed.approximation) / np.trace(claimed.noise) < 5.0
    white = np.linalg.solve(np.linalg.cholesky(claimed.covariance), np.array(found_errors).T)
    np.testing.assert_allclose(white @ white.T / runs, np.eye(3), atol=5.0 * np.sqrt(2.0 / runs))


def test_noise_and_approximate_places_scatter_as_claimed():
    check_budget(400, 3)


@pytest.mark.slow
def test_noise_and_approximate_places_scatter_as_claimed_in_2000_runs():
    check_budget(2000, 4)


def test_approximate_places_err_alike_in_all_epochs():
    """Twice the movement, twice the error, and the sensitivities of both epochs say that it is the same error."""
    true = np.array([0.02, 0.01, -0.03])
    wrong = np.random.default_rng(5).normal(size=(6, 3)) * 0.05
    changes = change_of_range(STATIONS, GROUP[0], np.array([true, 2 * true]))
    found = displacements(STATIONS + wrong, GROUP[0], changes, sigma=SIGMA)
    error = found.displacement[:, 0] - [true, 2 * true]
    np.testing.assert_allclose(error, found.sensitivity_stations @ wrong.ravel(), rtol=0, atol=5e-8)
    np.testing.assert_allclose(error[1], 2 * error[0], rtol=0, atol=5e-8)  # second order in 10 cm and 70 mm over 100 m
    assert np.abs(error).max() > 5e-6


FLAT = allowed_directions(4, forbidden=np.array([[0, 0, 1.0]]))


def test_valid_constraint_improves_and_its_covariance_is_right():
    rng = np.random.default_rng(6)
    true = np.concatenate([rng.normal(size=(4, 2)) * 1e-3, np.zeros((4, 1))], axis=1)
    changes = change_of_range(STATIONS, GROUP, true) + rng.normal(size=(500, 4, 6)) * SIGMA
    found = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=FLAT)
    free = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=np.eye(12))
    assert np.all(found.displacement[..., 2] == 0.0)
    np.testing.assert_allclose(free.displacement[:, 1], displacements(STATIONS, GROUP[1], changes[:, 1], sigma=SIGMA)
                               .displacement[:, 0], rtol=0, atol=1e-13)  # fmt: skip
    error = (found.displacement - true)[..., :2].reshape(500, 8)
    root = np.linalg.cholesky(found.parameters_covariance[0])
    white = np.linalg.solve(root, (found.parameters - found.parameters.mean(axis=0)).T)
    np.testing.assert_allclose(white @ white.T / 500, np.eye(8), atol=5.0 * np.sqrt(2.0 / 500))
    along = np.linalg.solve(np.linalg.cholesky(found.covariance[0][np.ix_(*[[0, 1, 3, 4, 6, 7, 9, 10]] * 2)]), error.T)
    np.testing.assert_allclose(along @ along.T / 500, np.eye(8), atol=5.0 * np.sqrt(2.0 / 500))
    won = np.linalg.eigvalsh(free.covariance[0] - found.covariance[0])
    assert won.min() > -1e-6 * won.max()  # the two are linear about places 1 mm apart in 100 m
    assert won.max() > 0.5 * free.covariance[0, 2, 2]
    statistic = found.pvv - free.pvv  # of a valid constraint: chi-square of the four directions that it excludes
    assert abs(statistic.mean() - 4.0) < 4.0 * np.sqrt(8.0 / 500)
    assert abs(statistic.var() - 8.0) < 4.0 * np.sqrt((12.0 * 4.0 * 8.0 + 2.0 * 8.0**2) / 500)


def test_violated_constraint_causes_the_predicted_bias_and_is_detected():
    true = np.array([[1e-3, 0, 3e-4], [0, 1e-3, 0], [0, 0, -2e-4], [0, 0, 0]])
    changes = change_of_range(STATIONS, GROUP, true)
    found = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=FLAT, u_violation=3e-4)
    outside = true * [0, 0, 1]
    error = found.displacement - true
    np.testing.assert_allclose(found.bias(outside), error, rtol=0, atol=2e-8)  # second order of 1 mm in 100 m
    assert np.abs(error[:, :2]).max() > 1e-6
    np.testing.assert_allclose(found.bias(true * [1, 1, 0]), 0.0, atol=1e-18)
    unit = np.array([found.bias(e.reshape(4, 3)).ravel() for e in np.eye(12)[2::3]])
    np.testing.assert_allclose(found.violation, 3e-4**2 * unit.T @ unit, atol=1e-20)
    np.testing.assert_allclose(found.covariance, found.noise + found.violation, atol=1e-22)
    free = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=np.eye(12))
    assert found.pvv - free.pvv > 33.0  # p below 1e-6 with four degrees of freedom


def test_body_is_determined_although_no_single_point_is():
    """Six channels over four points: none has three, together they hold six motions."""
    motion = np.array([1e-3, -5e-4, 2e-4, 1e-5, 2e-5, -1e-5])
    basis = rigid_group(GROUP)
    true = (basis @ motion).reshape(4, 3)
    changes = change_of_range(STATIONS, GROUP, true)
    seen = np.array([[1, 1, 0, 0, 0, 0], [0, 0, 1, 1, 0, 0], [0, 0, 0, 0, 1, 1], [1, 0, 0, 1, 0, 0]], dtype=bool)
    changes[~seen] = np.nan
    assert (displacements(STATIONS, GROUP, changes, sigma=SIGMA).rank == 2).all()
    found = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=basis)
    assert found.status == DETERMINED
    np.testing.assert_allclose(found.parameters, motion, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.displacement, true, rtol=0, atol=1e-12)
    assert found.degrees_of_freedom == 2
    lift = constrained(STATIONS, GROUP, changes, sigma=SIGMA, basis=rigid_group(GROUP, motions=[2]))
    assert lift.parameters.shape == (1,)


def test_directions_are_those_named():
    np.testing.assert_allclose(allowed_directions(2, allowed=np.array([[0, 0, 2.0]])).T ** 2, np.eye(6)[[2, 5]])
    across = allowed_directions(1, forbidden=np.array([[1.0, 1.0, 0.0]]))
    np.testing.assert_allclose(across.T @ across, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(np.array([1, 1, 0]) @ across, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sigma": 0.0}, "standard uncertainty 0 m: it must be positive"),
        ({"basis": np.ones((12, 2))}, "linearly dependent"),
        ({"basis": np.eye(3)}, r"the basis has shape \(3, 3\), expected \(12, q\)"),
        ({"points": STATIONS[:4]}, "a point coincides with a station"),
        ({"points": GROUP[:3]}, r"changes \(4, 6\)"),
        ({"stations": STATIONS * np.nan}, "not a number"),
        ({"u_points": -1.0}, "u_points must be finite and not negative"),
        ({"u_stations": np.ones(5)}, r"u_stations has shape \(5,\), expected"),
    ],
)
def test_what_makes_no_sense_is_refused(change, said):
    given = {"stations": STATIONS, "points": GROUP, "sigma": SIGMA, "basis": FLAT, **change}
    stations, points, sigma = given.pop("stations"), given.pop("points"), given.pop("sigma")
    with pytest.raises(EstimationError, match=said):
        constrained(stations, points, np.zeros((4, 6)), sigma=sigma, **given)


def test_directions_that_make_no_sense_are_refused():
    with pytest.raises(EstimationError, match="either the allowed or the forbidden"):
        allowed_directions(2)
    with pytest.raises(EstimationError, match="not zero"):
        allowed_directions(2, allowed=np.zeros(3))
