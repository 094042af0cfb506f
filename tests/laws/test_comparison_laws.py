"""Laws of two epochs: every common point has its answer, what did not move is left alone, what moved far is named."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from catseye.estimation.deformation import comparison
from catseye.estimation.deformation.comparison import compare
from draws import draws, examples
from laws.comparison_scene import DATUMS, FLOATING, KINDS, Scene, by_numpy

seeds = st.integers(0, 2**32 - 1)
WHOLE = (False, False)
BARE = (WHOLE, (True, False), (False, True))  # an epoch without redundancy among them


def drawn(seed, kind, datum, bare, moved):
    """A scene, its two adjusted epochs, the rows of those that moved and their movement; None if one has no answer."""
    rng = np.random.default_rng(seed)
    scene = Scene.of(rng, kind, datum)
    able = np.flatnonzero(~scene.held.any(axis=1)) if datum == "held" else np.arange(len(scene.x))
    which = rng.choice(able, moved, replace=False)
    step = scene.movement(rng, which, 10.0 ** rng.uniform(0.0, 3.0))
    epochs = [scene.epoch(rng, x, bare=b) for x, b in zip((scene.x, scene.x + step), bare, strict=True)]
    good = all(e.status.startswith("converged") for e in epochs)
    return (scene, epochs, which, step) if good else None


def whitened(scene, row, vector, covariance):
    """Size of a movement in its standard uncertainties, over the coordinates that exist."""
    axes = np.flatnonzero(scene.existing[row])
    v = vector[axes]
    return float(np.sqrt(v @ np.linalg.solve(covariance[np.ix_(axes, axes)], v)))


def check_answer(scene, found):
    """Each common point with displacement, covariance and test; nothing where a coordinate is absent."""
    d = found.deformation
    assert d.names == scene.names
    both = scene.existing[:, :, None] & scene.existing[:, None, :]
    np.testing.assert_array_equal(np.isfinite(d.displacement), scene.existing)
    np.testing.assert_array_equal(np.isfinite(d.covariance), both)
    np.testing.assert_array_equal(np.isfinite(d.p), ~d.held)
    np.testing.assert_array_equal(d.held, scene.held.any(axis=1) & (scene.datum == "held"))
    assert not d.displacement[d.held][scene.existing[d.held]].any()
    assert not any("nan" in word for word in found.words)


def check_numpy(scene, epochs, bare, found):
    """Displacements, covariances and tests of those called moved and of one other, by plain numpy."""
    d = found.deformation
    out = np.flatnonzero(d.moved)
    still = [int(i) for i in np.flatnonzero(d.stable & ~d.held)[:1]]
    for own, rows in ((out, out), ([*out, *still], still)):
        expected, covariance, lost = by_numpy(scene, epochs, bare, own)
        if lost != (0 if scene.datum == "held" else FLOATING[scene.kind]):
            continue  # these points are not checked by the others
        for i in rows:
            axes = np.flatnonzero(scene.existing[i])
            u = np.sqrt(np.diag(covariance[i])[axes])
            # second order: the covariance of the second epoch is taken where the point went to
            within = 0.05 * u.max() + 1e-4 * np.abs(expected[i][axes]).max()
            np.testing.assert_allclose(d.displacement[i][axes], expected[i][axes], rtol=0, atol=within)
            np.testing.assert_allclose(np.sqrt(np.diag(d.covariance[i])[axes]), u, rtol=0.05)
            size = whitened(scene, i, expected[i], covariance[i])
            assert np.sqrt(d.statistic[i]) == pytest.approx(size, rel=0.05, abs=0.05)
            np.testing.assert_allclose(d.p[i], stats.chi2.sf(d.statistic[i], len(axes)), rtol=1e-6, atol=1e-300)


@examples(240)
@given(seeds, st.sampled_from(KINDS), st.sampled_from(DATUMS), st.sampled_from(BARE), st.integers(0, 3))
def test_every_common_point_has_a_displacement_a_covariance_and_a_test(seed, kind, datum, bare, moved):
    case = drawn(seed, kind, datum, bare, moved)
    assume(case is not None)
    scene, epochs, which, step = case
    found = compare(*epochs)
    check_answer(scene, found)
    if scene.sigma < 1e-3:  # beyond, the second order of the network itself shows
        check_numpy(scene, epochs, bare, found)
    _, covariance, _ = by_numpy(scene, epochs, bare, which)
    far = [i for i in which if whitened(scene, i, step[i], covariance[i]) > 10.0]
    assert all(found.deformation.moved[i] for i in far), found.deformation.status


@draws(450)
def test_stable_points_are_flagged_at_the_test_level(runs):
    """All kinds and datums alike; beside one that moved the rest is left alone as often: it is tested once more."""
    alarms, beside, still, more = 0, 0, 0, 0
    for seed in range(runs):
        moved = seed % 2
        case = drawn(seed, KINDS[seed % 5], DATUMS[seed // 5 % 3], WHOLE, moved)
        if case is None:
            continue
        _, epochs, which, _ = case
        called = compare(*epochs).deformation.moved
        if moved:
            more, beside = more + 1, beside + bool(np.delete(called, which).any())
        else:
            still, alarms = still + 1, alarms + bool(called.any())
    for count, total in ((alarms, still), (beside, more)):
        assert total > 0.4 * runs
        assert count / total < 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / total)
    assert alarms > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("moved", [1, 2, 3])
def test_any_number_of_free_points_may_have_moved_among_held_ones(kind, moved):
    """Also all of them: no majority is needed where held points define the datum."""
    rng = np.random.default_rng(moved)
    scene = Scene.of(rng, kind, "held", n=8)
    scene.held[: 8 - moved] = scene.existing[: 8 - moved]
    which = np.arange(8 - moved, 8)
    step = scene.movement(rng, which, 300.0)
    found = compare(scene.epoch(rng, scene.x), scene.epoch(rng, scene.x + step))
    d = found.deformation
    assert list(np.flatnonzero(d.moved)) == list(which)
    assert d.conclusive
    assert (d.p[which] < 1e-90).all()
    assert d.status.startswith(f"moved: {', '.join(scene.names[i] for i in which)}, all points compared")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("datum", DATUMS)
def test_more_points_than_one_joint_test_takes_are_compared_beside_a_frame(kind, datum, monkeypatch):
    """As the joint test says of the same epochs, held stations or none; 500 sigma are far beyond any correlation."""
    rng = np.random.default_rng(7)
    scene = Scene.of(rng, kind, datum, n=14)
    which = [12, 13] if datum == "held" else [1, 13]
    step = scene.movement(rng, which, 500.0)
    epochs = scene.epoch(rng, scene.x), scene.epoch(rng, scene.x + step)
    joint = compare(*epochs).deformation
    monkeypatch.setattr(comparison, "LARGEST", 8)
    found = compare(*epochs)
    check_answer(scene, found)
    d = found.deformation
    assert 0 < len(found.frame) <= 8
    assert set(which) <= set(np.flatnonzero(d.moved))
    assert set(which) <= set(np.flatnonzero(joint.moved))
    for i in which:
        u = np.sqrt(np.nan_to_num(np.diag(d.covariance[i])) + np.nan_to_num(np.diag(joint.covariance[i])))
        axes = scene.existing[i]
        assert (np.abs(d.displacement[i] - joint.displacement[i]) < 5.0 * u)[axes].all()
        assert (np.abs(d.displacement[i] - step[i]) < 5.0 * u)[axes].all()
