"""Poses of groups from solved points: across postures, against design, and the beam against the coordinator's form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import FrameError, InputError
from catseye.records.network.solved_points import SolvedPoints
from catseye.reduction.epoch.parameter import ParameterKind, point_parameters
from catseye.reduction.live.pose import live_pose
from catseye.reduction.live.state import Carried
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.pointing_offsets import cross_covariance, pointing_offset
from catseye.reduction.pose.pose import at_posture, frame_transform, group_names, pose_of_group
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.verdict import Verdict

POSTURE = 145.3 * DEGREE, 30.0 * DEGREE
NAMES = ("DP001", "DP002", "DP010", "DP020", "DP030", "DP040", "ZY113", "ZY114", "ZY115", "ZY118")

STAYS = np.zeros(3), np.zeros(3)


def epoch(site, posture=POSTURE, *, dish=STAYS, arm=STAYS, seed=0):
    """Points exactly where a telescope at a posture has them, dish and arm moved (turn about vertex, shift)."""
    at = at_posture(site, *posture)
    to, inside = nominal_frame(at), {n: nominal_frame(site).inverse().points(places_of(site)[n].start) for n in NAMES}
    x = []
    for name in NAMES:
        turn, shift = dish if name.startswith("DP") else arm
        x.append(to.points(Rotation.from_rotvec(turn).apply(inside[name]) + shift))
    root = np.random.default_rng(seed).normal(size=(3 * len(NAMES), 50)) * 1e-5
    return SolvedPoints("made", f"night {seed}", NAMES, np.array(x), root @ root.T, posture, {})


TURN, SHIFT = np.array([1.0, 2.0, -1.0]) * ARCSECOND, np.array([0.4, 0.2, -0.3]) * MILLIMETRE


def test_epochs_at_two_postures_compare_in_the_axes_that_carry_the_group(night_01):
    before = epoch(night_01, (20 * DEGREE, 75 * DEGREE), seed=1)
    later = epoch(night_01, dish=(TURN, SHIFT))
    found = pose_of_group(later, before, night_01, group="dish", frame="reflector").pose
    np.testing.assert_allclose(found.rotation, TURN, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.translation, SHIFT, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.pivot, 0.0, atol=1e-12)


def test_the_same_pose_in_the_ground_frame_turns_about_the_same_vertex(night_01):
    later, before = epoch(night_01, dish=(TURN, SHIFT)), epoch(night_01, seed=1)
    inside = pose_of_group(later, before, night_01, group="dish", frame="reflector")
    ground = pose_of_group(later, before, night_01, group="dish", frame="ground")
    to = nominal_frame(night_01)
    np.testing.assert_allclose(ground.pose.pivot, to.translation, atol=1e-9)
    np.testing.assert_allclose(ground.pose.rotation, to.directions(TURN), rtol=0, atol=1e-12)
    np.testing.assert_allclose(ground.places, to.points(inside.places), rtol=0, atol=1e-9)
    x = ground.pose.motion.apply(ground.places)
    np.testing.assert_allclose(x, later.places(ground.pose.names), rtol=0, atol=1e-9)
    about = pose_of_group(later, before, night_01, group="dish", frame="ground", pivot=np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(about.pose.pivot, [1.0, 2.0, 3.0])


def test_against_design_the_typed_places_count_as_sure_as_they_are(night_01):
    """A prism slid along the dish by 20 mm is nothing; lifted by 20 mm it stands out."""
    base = epoch(night_01)
    found = pose_of_group(base, None, night_01, group="dish", frame="reflector")
    assert found.against == "design"
    assert set(found.pose.names) == {n for n in NAMES if n.startswith("DP")}
    # prisms stand off the paraboloid by what was typed: 15 mm across, a few tenths along the normal
    assert np.all(np.abs(found.pose.rotation) < 5 * found.pose.u[3:] + 1e-9)
    x = nominal_frame(night_01).inverse().points(base.x)
    k = NAMES.index("DP020")
    n = np.array([-x[k, 0], -x[k, 1], 120.0])
    n /= np.linalg.norm(n)
    aside = np.cross(n, [1.0, 0.0, 0.0])
    w = {}
    for what, step in (("along the dish", 0.02 * aside / np.linalg.norm(aside)), ("lifted", 0.02 * n)):
        moved = x.copy()
        moved[k] += step
        there = replace(base, x=nominal_frame(night_01).points(moved))
        w[what] = pose_of_group(there, None, night_01, group="dish", frame="reflector").pose
    assert w["lifted"].p < 1e-6
    assert w["along the dish"].p > 0.05


@pytest.mark.parametrize("optics", ["prime", "gregorian"])
def test_the_beam_agrees_with_the_coordinators_for_the_same_points(night_01, optics):
    """`live_pose`, an older form with other weights, on exact points; only the prime focus is in it."""
    later = epoch(night_01, dish=(TURN, SHIFT), arm=(0.5 * TURN, 2.0 * SHIFT))
    before = epoch(night_01, seed=1)
    dish, arm = (pose_of_group(later, before, night_01, group=g, frame="reflector") for g in ("dish", "feed-arm"))
    cross = cross_covariance(arm, dish, night_01, earlier=before)
    found = pointing_offset(dish.pose, arm.pose, night_01, cross=cross, optics=optics)
    np.testing.assert_allclose(sum(found.terms.values()), found.offset, rtol=1e-12)
    np.testing.assert_array_equal(found.correction, -found.offset)
    assert np.linalg.eigvalsh(found.covariance)[0] > 0.0
    if optics == "gregorian":
        assert found.relative.shape == (6,)
        return
    to = nominal_frame(night_01).inverse()
    names = [*point_parameters(ParameterKind.POINT, NAMES), *point_parameters(ParameterKind.REFERENCE_PLACE, NAMES)]
    x = np.concatenate([to.points(later.x).ravel(), to.points(before.x).ravel()])
    both = np.kron(np.eye(len(NAMES)), to.rotation)
    q = np.zeros((len(names), len(names)))
    half = len(names) // 2
    q[:half, :half], q[half:, half:] = both @ later.covariance @ both.T, both @ before.covariance @ both.T
    bodies = {n: "dish" if n.startswith("DP") else "arm" for n in NAMES}
    live = live_pose(Carried(tuple(names), x, q, 0, 0.5), bodies, night_01)
    assert np.all(np.abs(found.offset - live.offset) < [2e-9, 2e-9, 1e-8])  # second order: 60 m (1.2e-5)^2
    scale = np.sqrt(np.diag(live.covariance))
    np.testing.assert_allclose(
        found.covariance / np.outer(scale, scale), live.covariance / np.outer(scale, scale), rtol=0, atol=1e-3
    )  # it damps its weights by 1e-6
    np.testing.assert_allclose(found.beam_deviation, [0.770, 0.547], atol=2e-3)


def test_a_subreflector_that_goes_with_the_dish_leaves_the_beam_to_the_dish(night_01):
    later = epoch(night_01, dish=(TURN, SHIFT), arm=(TURN, SHIFT))
    before = epoch(night_01, seed=1)
    dish, arm = (pose_of_group(later, before, night_01, group=g, frame="reflector") for g in ("dish", "feed-arm"))
    found = pointing_offset(dish.pose, arm.pose, night_01, optics="gregorian")
    np.testing.assert_allclose(found.offset, [TURN[1], TURN[0], 0.0], rtol=0, atol=1e-8)


def test_invalid_requests_are_refused(night_01):
    later = epoch(night_01)
    with pytest.raises(InputError, match="one of the two"):
        pose_of_group(later, None, night_01)
    with pytest.raises(InputError, match="'roof' is not one of"):
        group_names("roof", night_01)
    with pytest.raises(InputError, match="no points of the group 'subreflector'"):
        pose_of_group(later, None, night_01, group="subreflector")
    with pytest.raises(InputError, match="point 'XX' is not in both epochs"):
        pose_of_group(later, later, night_01, points=["DP001", "DP002", "XX"])
    with pytest.raises(InputError, match="2 points"):
        pose_of_group(later, later, night_01, points=["DP001", "DP002"])
    with pytest.raises(InputError, match="posture is unknown"):
        pose_of_group(later, replace(later, posture=None), night_01, group="dish")
    with pytest.raises(InputError, match="'sky' is not one of"):
        frame_transform("sky", night_01)
    ground = pose_of_group(later, later, night_01, group="dish").pose
    with pytest.raises(FrameError, match="expected 'reflector'"):
        pointing_offset(ground, ground, night_01)


@pytest.mark.parametrize(("wrong", "said"), [((0.0, 0.5), "in elevation"), ((0.6, 0.0), "across the elevation axis")])
def test_a_posture_that_contradicts_the_dish_is_reported_without_accusation(night_01, wrong, said):
    """By hand: half a degree of elevation; 0.6 degrees of azimuth times cos 30 degrees, 0.520."""
    real = epoch(night_01)
    told = replace(real, posture=(POSTURE[0] - wrong[0] * DEGREE, POSTURE[1] - wrong[1] * DEGREE))
    found = pose_of_group(told, None, at_posture(night_01, *told.posture), group="dish")
    size = wrong[1] or wrong[0] * np.cos(np.radians(30.0))
    verdict = PoseFindings(found).verdict
    assert verdict.word == "doubtful"
    assert said in found.posture.doubt
    assert abs(np.linalg.norm(found.posture.offset) / DEGREE - size) < 0.01
    assert "undecided which is wrong" in found.posture.doubt


@pytest.mark.parametrize("frame", ["ground", "alidade", "reflector"])
def test_a_dish_within_what_the_pointing_series_corrects_agrees_with_its_posture(night_01, frame):
    turned = epoch(night_01, dish=(np.array([200.0, 30.0, 0.0]) * ARCSECOND, SHIFT))
    found = pose_of_group(turned, epoch(night_01, seed=1), night_01, group="dish", frame=frame)
    assert found.posture.doubt == ""
    assert found.posture.offset[1] / ARCSECOND == pytest.approx(200.0, abs=0.1)  # about the elevation axis, upwards


@pytest.mark.parametrize("word", ["doubtful", "failed"])
@pytest.mark.parametrize("which", [0, 1])
def test_a_pose_is_no_better_than_either_of_its_epochs(night_01, word, which):
    epochs = [epoch(night_01), epoch(night_01, seed=1)]
    epochs[which] = replace(epochs[which], verdict=Verdict(word, "the night was foggy"))
    found = PoseFindings(pose_of_group(*epochs, night_01, group="dish")).verdict
    assert found.word == word
    assert "the night was foggy" in found.why
