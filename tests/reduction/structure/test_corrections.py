"""Planted shifts and turns are recovered, in one posture and over many, and scatter as their covariance claims.

The truth is another antenna: the example with its coefficients, or single shifts and turns, changed. What is measured
is its points with noise; the estimates only see the example as it is.
"""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from catseye.errors import EstimationError, InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.structural_model import StructuralModel, read_structural_model, structural_model_toml
from catseye.reduction.structure.antenna import UNITS, antenna_of
from catseye.reduction.structure.corrections import MeasuredPosture, correct_posture, frame_motion
from catseye.reduction.structure.fit import fit_model, updated_model
from repository import ROOT

EXAMPLE = ROOT / "examples" / "structural-model" / "telescope.toml"
POSTURE = TelescopePosture(0.9, np.radians(38.0), 3.0)
GROUPS = ("bearings", "rim", "arm", "subreflector_rim")
MOVED = ("alidade", "elevation", "reflector", "feed_arm", "subreflector")


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(EXAMPLE))


def mixed(rng, n, u=1e-4):
    """A covariance with correlations, as a network has them."""
    root = u * (np.eye(3 * n) + 0.5 * rng.standard_normal((3 * n, 3)) @ rng.standard_normal((3, 3 * n)) / 3)
    return root @ root.T


def measured(antenna, rng, posture, *, added=None, places=None, groups=GROUPS, noise=True):
    """The groups' points as they truly are, with the scatter of the network and of what groups are left to do."""
    names = tuple(name for group in groups for name in antenna.groups[group].names)
    truth = []
    for group in groups:
        frame = antenna.groups[group].frame
        off = np.array([places[name] for name in antenna.groups[group].names]) if places else 0.0
        fresh = np.sqrt(np.maximum(antenna.u_points(group) ** 2 - antenna.groups[group].u ** 2, 0.0))[:, None]
        at = antenna.in_frame(group, posture) + off + noise * fresh * rng.standard_normal((len(fresh), 3))
        truth.append(antenna.ground_from(frame, posture, added=added)[None].points(at))
    truth = np.concatenate(truth)
    covariance = mixed(rng, len(names))
    seen = truth.ravel() + noise * np.linalg.cholesky(covariance) @ rng.standard_normal(truth.size)
    return MeasuredPosture(names, seen.reshape(-1, 3), covariance, posture)


def scattered(antenna, rng):
    """A draw of what the model leaves in one posture, and of the targets' places in their frames."""
    added = {name: antenna.motions[name].u * rng.standard_normal(6) for name in MOVED}
    places = {
        name: u * rng.standard_normal(3)
        for group in antenna.groups.values()
        for name, u in zip(group.names, group.u, strict=True)
    }
    return added, places


def test_without_noise_a_planted_motion_of_one_frame_comes_back(antenna):
    planted = np.array([1e-3, -2e-3, 0.5e-3, 20 * ARCSECOND, -10 * ARCSECOND, 5 * ARCSECOND])
    there = measured(antenna, np.random.default_rng(1), POSTURE, added={"feed_arm": planted}, noise=False)
    found = frame_motion(antenna, there, "feed_arm")
    np.testing.assert_allclose(found.correction, planted, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-11)
    assert found.names == antenna.groups["arm"].names
    assert found.degrees_of_freedom == 6


def test_a_frame_on_a_corrected_parent_is_seen_from_there(antenna):
    rng = np.random.default_rng(2)
    added = {"reflector": np.array([0, 1e-3, 0, 1e-5, 0, 0]), "feed_arm": np.array([1e-3, 0, 0, 0, 2e-5, 0])}
    there = measured(antenna, rng, POSTURE, added=added, noise=False)
    first = frame_motion(antenna, there, "reflector")
    np.testing.assert_allclose(first.correction, added["reflector"], rtol=0, atol=1e-10)
    second = frame_motion(antenna, there, "feed_arm", added={"reflector": first.correction})
    np.testing.assert_allclose(second.correction, added["feed_arm"], rtol=0, atol=1e-10)


def distance(error, covariance):
    return float(error @ np.linalg.solve(covariance, error))


def test_one_frames_motion_scatters_as_claimed(antenna):
    rng = np.random.default_rng(3)
    squares, fits = [], []
    for _ in range(60):
        planted = np.repeat([1e-3, 5e-5], 3) * rng.standard_normal(6)
        places = scattered(antenna, rng)[1]
        there = measured(antenna, rng, POSTURE, added={"feed_arm": planted}, places=places, groups=("arm",))
        found = frame_motion(antenna, there, "feed_arm")
        squares.append(distance(found.correction - planted, found.covariance))
        fits.append(found.pvv)
    # means of 60 chi-squares with 6 degrees: expectation 6, standard deviation sqrt(12/60)
    assert abs(np.mean(squares) - 6) < 4 * np.sqrt(12 / 60)
    assert abs(np.mean(fits) - 6) < 4 * np.sqrt(12 / 60)


def joint(antenna, trials, seed):
    rng = np.random.default_rng(seed)
    squares, fits, w = [], [], []
    for _ in range(trials):
        added, places = scattered(antenna, rng)
        there = measured(antenna, rng, POSTURE, added=added, places=places)
        found = correct_posture(antenna, there)
        error = np.concatenate([found.six[name] - added[name] for name in found.frames])
        squares.append(distance(error, found.covariance))
        fits.append(found.pvv)
        w.append(np.mean(found.standardised**2))
    p, f = 6 * len(found.frames), found.degrees_of_freedom
    assert abs(np.mean(squares) - p) < 4 * np.sqrt(2 * p / trials)
    assert abs(np.mean(fits) - f) < 4 * np.sqrt(2 * f / trials)
    assert abs(np.mean(w) - 1) < 4 * np.sqrt(2 / trials / 20)
    return found


def test_corrections_of_all_frames_scatter_as_claimed(antenna):
    found = joint(antenna, 15, 4)
    assert found.frames == MOVED


@pytest.mark.slow
def test_corrections_of_all_frames_scatter_as_claimed_in_many_trials(antenna):
    joint(antenna, 200, 5)


def test_few_targets_leave_the_others_near_the_model_with_larger_u(antenna):
    there = measured(antenna, np.random.default_rng(6), POSTURE, groups=("bearings",))
    found = correct_posture(antenna, there)
    assert found.frames == ("alidade",)
    one = replace(there, names=there.names[:1], coordinates=there.coordinates[:1], covariance=there.covariance[:3, :3])
    weak = correct_posture(antenna, one)
    prior = antenna.motions["alidade"].six_covariance(POSTURE)
    assert np.all(np.linalg.eigvalsh(prior - weak.covariance) > -1e-15)  # nothing is known worse than before
    assert np.sqrt(weak.covariance[5, 5]) > 0.5 * antenna.motions["alidade"].u[5]


FREE = {"feed_arm": ("shift_y", "shift_z", "turn_x"), "reflector": ("shift_z", "turn_x")}


def changed(record, antenna, rng):
    """The truth: another model, and what was changed, in the order of the fit."""
    document = record.model_dump(exclude_none=True)
    truth = []
    for name, components in FREE.items():
        motion = next(f["motion"] for f in document["frame"] if f["name"] == name)
        for component in components:
            unit, u = ("mm", 2.0) if component.startswith("shift") else ("arcsec", 8.0)
            key = f"{component}_{unit}"
            k = len(antenna.motions[name].basis)
            t_like = np.array([0.05 if "t" in term.replace("turn", "") else 1.0 for term in motion["terms"]])
            new = np.array(motion[key]) + u * t_like * rng.standard_normal(k)
            motion[key] = tuple(float(v) for v in new)
            truth.append(new * UNITS[0 if unit == "mm" else 3])
    return antenna_of(StructuralModel.model_validate(document)), np.concatenate(truth)


def campaign(antenna, rng, count, noise=True):
    places = scattered(antenna, rng)[1] if noise else None
    epochs = []
    for _ in range(count):
        elevation, temperature = np.radians(rng.uniform(2, 93)), rng.uniform(-20, 35)
        posture = TelescopePosture(rng.uniform(-3, 3), elevation, temperature)
        added = scattered(antenna, rng)[0] if noise else None
        epochs.append(measured(antenna, rng, posture, added=added, places=places, noise=noise, groups=GROUPS[1:3]))
    return epochs


def coefficients(fit, antenna):
    from catseye.geometry.antenna.deformation import COMPONENTS

    return np.concatenate([fit.coefficients[name][COMPONENTS.index(c)] for name, c in fit.free])


def test_without_noise_the_models_coefficients_come_back(antenna):
    rng = np.random.default_rng(7)
    true, truth = changed(antenna.record, antenna, rng)
    fit = fit_model(antenna, campaign(true, rng, 14, noise=False), free=FREE)
    # 1e-9: relinearised until the predictions stand still
    np.testing.assert_allclose(coefficients(fit, antenna), truth, rtol=0, atol=1e-8)


def fits(antenna, trials, seed):
    rng = np.random.default_rng(seed)
    squares, factors = [], []
    for _ in range(trials):
        true, truth = changed(antenna.record, antenna, rng)
        fit = fit_model(antenna, campaign(true, rng, 14), free=FREE)
        squares.append(distance(coefficients(fit, antenna) - truth, fit.covariance))
        factors.append(fit.variance_factor)
    p, f = len(truth), fit.degrees_of_freedom
    assert abs(np.mean(squares) - p) < 4 * np.sqrt(2 * p / trials)
    assert abs(np.mean(factors) - 1) < 4 * np.sqrt(2 / f / trials)
    return fit


def test_the_models_coefficients_scatter_as_claimed(antenna):
    fits(antenna, 3, 8)


@pytest.mark.slow
def test_the_models_coefficients_scatter_as_claimed_in_many_trials(antenna):
    fits(antenna, 60, 9)


def test_coefficients_that_stay_as_they_are_do_not_average_out_over_postures(antenna):
    """The alidade's lean is off by one draw in all postures: fits that took it anew in each would be too sure."""
    rng = np.random.default_rng(21)
    document = antenna.record.model_dump(exclude_none=True)
    motion = next(f["motion"] for f in document["frame"] if f["name"] == "alidade")
    k = len(antenna.motions["alidade"].basis)
    u = np.zeros(6 * k)
    u[[0, k, 3 * k]] = 3.0, 3.0, 15.0  # mm, mm, arc seconds: constant terms of shift x, shift y, turn x
    motion["covariance"] = tuple(tuple(float(v) for v in row) for row in np.diag(u**2))
    unsure = antenna_of(StructuralModel.model_validate(document))
    squares, naive = [], []
    for _ in range(4):
        true, truth = changed(antenna.record, antenna, rng)
        moved = true.record.model_dump(exclude_none=True)
        lean = next(f["motion"] for f in moved["frame"] if f["name"] == "alidade")
        for key, size in (("shift_x_mm", 3.0), ("shift_y_mm", 3.0), ("turn_x_arcsec", 15.0)):
            first, *rest = lean.get(key, (0.0,) * k)
            lean[key] = (first + size * rng.standard_normal(), *rest)
        epochs = campaign(antenna_of(StructuralModel.model_validate(moved)), rng, 14)
        for model, told in ((unsure, squares), (antenna, naive)):
            fit = fit_model(model, epochs, free=FREE)
            told.append(distance(coefficients(fit, antenna) - truth, fit.covariance))
    p = len(truth)
    assert np.mean(squares) < p + 4 * np.sqrt(2 * p / 4)
    assert np.mean(naive) > 1.5 * p  # which takes the lean as known


def test_the_update_is_a_new_file_whose_next_fit_begins_with_what_was_learnt(antenna, tmp_path):
    rng = np.random.default_rng(10)
    true, truth = changed(antenna.record, antenna, rng)
    fit = fit_model(antenna, campaign(true, rng, 14), free=FREE)
    new = updated_model(antenna.record, antenna, fit, by="a test", measured_on=date(2026, 9, 1), report="none")
    path = tmp_path / "new.toml"
    path.write_text(structural_model_toml(new), encoding="utf-8")
    again = antenna_of(read_structural_model(path))
    assert again.record.by == "a test"
    for name in FREE:
        np.testing.assert_allclose(again.motions[name].coefficients, fit.coefficients[name], rtol=1e-12, atol=1e-18)
    posture = TelescopePosture(0.0, 0.8, 10.0)
    u = np.sqrt(np.diag(again.motions["feed_arm"].six_covariance(posture)))
    assert np.all(u[[1, 2, 3]] > antenna.motions["feed_arm"].u[[1, 2, 3]])  # now the coefficients say their own
    np.testing.assert_allclose(u[[0, 4, 5]], antenna.motions["feed_arm"].u[[0, 4, 5]], rtol=1e-12)
    second = fit_model(again, campaign(true, rng, 6), free=FREE)
    better = np.diag(second.covariance) / np.diag(fit.covariance)
    assert np.all(better < 1.0 + 1e-9)
    assert distance(coefficients(second, antenna) - truth, second.covariance) < 60  # 19 coefficients, 5 sigma


def test_undetermined_coefficients_are_named(antenna):
    rng = np.random.default_rng(11)
    with pytest.raises(EstimationError, match="feed_arm"):
        fit_model(antenna, campaign(antenna, rng, 2), free=FREE)
    epochs = [replace(e) for e in campaign(antenna, rng, 3)]
    with pytest.raises(EstimationError, match="subreflector shift_y 1 floats: no measured target"):
        fit_model(antenna, epochs, free={"subreflector": ["shift_y"]})
    with pytest.raises(InputError, match="'prime_focus' has no motion"):
        fit_model(antenna, epochs, free={"prime_focus": ["shift_y"]})
    with pytest.raises(InputError, match="'shift' is not a component"):
        fit_model(antenna, epochs, free={"feed_arm": ["shift"]})
    with pytest.raises(EstimationError, match="needs 3 points"):
        frame_motion(antenna, epochs[0], "subreflector")
    with pytest.raises(EstimationError, match="no target was measured"):
        correct_posture(antenna, MeasuredPosture((), np.zeros((0, 3)), np.zeros((0, 0)), POSTURE))


def test_a_group_with_a_motion_of_its_own_is_corrected_too(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8")
    motion = (
        '[group.motion]\nterms = ["1", "t"]\npivot_mm = [0.0, 3000.0, 40000.0]\nu_shift_mm = 0.7\n'
        "u_turn_arcsec = 4.0\nshift_x_mm = [0.5, 0.02]\nturn_z_arcsec = [3.0, 0.0]\n"
    )
    old = 'name = "arm"\nframe = "feed_arm"\n'
    path = tmp_path / "model.toml"
    path.write_text(text.replace(old, old + "\n" + motion, 1), encoding="utf-8")
    moving = antenna_of(read_structural_model(path))
    step, slopes = 1e-6, moving.group_derivatives("arm", POSTURE)["arm"]
    for i, h in enumerate(step * np.eye(6)):
        ends = [moving.points("arm", POSTURE, added={"arm": v}) for v in (h, -h)]
        np.testing.assert_allclose(slopes[..., i], (ends[0] - ends[1]) / (2 * step), rtol=0, atol=1e-7)
    here, there = moving.points("arm", POSTURE), antenna_of(read_structural_model(EXAMPLE)).points("arm", POSTURE)
    assert 0.3e-3 < np.linalg.norm(here - there, axis=-1).max() < 1e-3
    seen = measured(moving, np.random.default_rng(13), POSTURE, noise=False)
    found = correct_posture(moving, seen)
    assert found.frames == (*MOVED, "arm")
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)


def test_a_prior_without_play_is_refused(antenna):
    """Four coefficients that only move together have a singular covariance, whose inverse says nothing true."""
    motion = antenna.motions["feed_arm"]
    covariance = np.zeros((24, 24))
    covariance[8:12, 8:12] = 1e-6  # of shift_z
    tied = replace(antenna, motions=antenna.motions | {"feed_arm": replace(motion, covariance=covariance)})
    epochs = campaign(antenna, np.random.default_rng(14), 4)
    with pytest.raises(EstimationError, match="'feed_arm' ties free coefficients"):
        fit_model(tied, epochs, free={"feed_arm": ["shift_z"]})
