"""Many epochs at once: the compiled form against the plain one, missing points, statuses, scatter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import ParaboloidStatus
from catseye.estimation.shapes.surface_series import fit_series
from catseye.geometry.frames.frame import Transform

F = 60.0
OUTER = Transform("ground", "dish", Rotation.from_euler("xyz", [0.3, -0.2, 1.1]).as_matrix(), np.array([4.0, 90.0, 50]))
ALL = ("vertex", "axis", "focal-length")


def scene(rng, epochs, k):
    radius, angle = 50 * np.sqrt(rng.random(k)), rng.uniform(0, 2 * np.pi, k)
    x, y = radius * np.cos(angle), 54 + radius * np.sin(angle)
    local = np.stack([x, y, (x**2 + y**2) / (4 * F)], axis=1)
    turns = Rotation.from_rotvec(np.column_stack([rng.normal(size=(epochs, 2)) * 1e-4, np.zeros(epochs)]))
    moved = np.einsum("tij,kj->tki", turns.as_matrix(), local) + rng.normal(size=(epochs, 1, 3)) * 0.01
    return OUTER.points(moved + rng.normal(size=(epochs, k, 3)) * 3e-4)


@pytest.mark.parametrize("free", [ALL, ("vertex", "axis"), ("vertex",), ("focal-length",), ()])
@pytest.mark.parametrize("measure", ["normal", "half-path"])
def test_the_compiled_form_is_the_plain_one(free, measure):
    rng = np.random.default_rng(6)
    points, variance = scene(rng, 5, 90), rng.uniform(0.5, 2.0, (5, 90)) * 1e-9
    weights = rng.uniform(0.0, 1.0, 90)
    weights[4] = 0.0
    points[1, 7] = points[3, :30] = np.nan
    one, two = (
        fit_series(points, variance, OUTER, focal_length=F, free=free, weights=weights, measure=measure, compiled=c)
        for c in (True, False)
    )
    assert (one.status == 0).all()
    assert (two.status == 0).all()
    np.testing.assert_allclose(one.parameters, two.parameters, atol=1e-10)
    np.testing.assert_allclose(one.deviation, two.deviation, atol=1e-12)
    np.testing.assert_allclose(one.covariance, two.covariance, rtol=1e-6, atol=1e-18)
    assert np.isnan(one.deviation[1, 7])
    assert np.isnan(one.deviation[3]).sum() == 30


def test_failed_epoch_has_a_status_and_others_are_unaffected():
    rng = np.random.default_rng(2)
    points = scene(rng, 4, 40)
    points[1, 4:] = np.nan  # four points
    points[2, :, :] = OUTER.points([0.0, 40.0, 40.0**2 / (4 * F)])  # one place forty times
    for compiled in (True, False):
        found = fit_series(points, np.full(40, 1e-9), OUTER, focal_length=F, compiled=compiled)
        assert found.status.tolist() == [0, 1, 2, 0]
        assert found.points[1] == 4 or not compiled
        assert np.isnan(found.parameters[1:3]).all()
        assert np.isfinite(found.parameters[[0, 3]]).all()
        with pytest.raises(EstimationError, match="epoch 2 of 4: fewer points than parameters"):
            found.require_converged()


def test_a_focal_length_that_runs_away_is_not_settled():
    """Its message says "hold it": a status is no word of a message."""
    points = scene(np.random.default_rng(2), 2, 40)
    points[1] = OUTER.points(OUTER.inverse().points(points[1]) * [1.0, 1.0, -0.3])
    found = fit_series(points, np.full(40, 1e-9), OUTER, focal_length=F, free=ALL, compiled=False)
    assert found.status.tolist() == [ParaboloidStatus.CONVERGED, ParaboloidStatus.UNSETTLED]
    with pytest.raises(EstimationError, match="epoch 2 of 2: not settled") as refused:
        found.require_converged()
    assert refused.value.reason is ParaboloidStatus.UNSETTLED


def test_each_epochs_covariance_is_the_scatter():
    rng = np.random.default_rng(9)
    base, k, epochs = scene(rng, 1, 60)[0], 60, 4000
    u = rng.uniform(3e-5, 1e-4, k)
    points = base + rng.normal(size=(epochs, k, 3)) * u[:, None]
    found = fit_series(
        points, u**2, OUTER, focal_length=F, free=ALL, measure="half-path", compiled=True
    ).require_converged()
    off = found.parameters - found.parameters.mean(axis=0)
    normalised = np.einsum("ti,ij,tj->t", off, np.linalg.inv(found.covariance[0]), off).mean() / 6
    assert normalised == pytest.approx(1.0, abs=0.04)  # 4000 trials of six: 0.9 %


def test_a_wrong_shape_is_refused():
    with pytest.raises(EstimationError, match="expected epochs, points, 3"):
        fit_series(np.zeros((5, 3)), np.ones(5), OUTER, focal_length=F)
