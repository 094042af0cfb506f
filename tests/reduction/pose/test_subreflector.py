"""Position and lengths with covariance, against draws; a measured pose back to rest; refusals."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError, InputError
from catseye.geometry.antenna.actuators import actuator_lengths, position_at_lengths
from catseye.records.files.reading import read_record
from catseye.records.site.subreflector import SubreflectorMount
from catseye.reduction.pose.subreflector import state_of_lengths, state_of_pose, state_of_position
from repository import ROOT

MOUNT = read_record(ROOT / "examples" / "subreflector" / "hexapod.toml", SubreflectorMount)
SHIFT, ANGLES = np.array([0.01, -0.02, 0.03]), np.array([0.02, -0.03, 0.01])
FOCUS = np.array([0.0, 0.0, 60.0])  # of the prime-focus frame, in the reflector frame


def test_the_claimed_covariance_is_the_scatter_of_positions_at_drawn_lengths():
    state = state_of_position(MOUNT, SHIFT, ANGLES)
    rng = np.random.default_rng(1)
    count = 2000
    drawn = state.lengths + 2e-5 * rng.standard_normal((count, 6))
    six = np.array([np.concatenate(position_at_lengths(row, **MOUNT.joints)) for row in drawn])
    u = np.sqrt(np.diag(state.covariance))
    np.testing.assert_allclose(
        np.cov(six.T) / np.outer(u, u), state.covariance / np.outer(u, u), rtol=0, atol=4 * np.sqrt(2 / count)
    )
    back = state_of_lengths(MOUNT, state.lengths)
    np.testing.assert_allclose(back.six, state.six, rtol=0, atol=1e-11)
    np.testing.assert_allclose(back.covariance, state.covariance, rtol=1e-6, atol=1e-20)


def posed(six, pivot):
    """Translation and rotation vector of a pose about another pivot (reflector frame), from scipy's rotations."""
    turn = Rotation.from_euler("xyz", six[3:])
    about = np.asarray(pivot) - FOCUS  # prime-focus axes are the reflector's
    own = MOUNT.joints["pivot"]
    return np.concatenate([own + six[:3] + turn.apply(about - own) - about, turn.as_rotvec()])


def test_a_measured_pose_about_any_pivot_has_the_position_and_the_lengths_of_its_joints():
    pivot = np.array([0.5, -3.0, 61.0])
    pose = posed(np.concatenate([SHIFT, ANGLES]), pivot)
    a = np.random.default_rng(2).standard_normal((6, 6))
    covariance = a @ a.T * np.outer([1e-4] * 3 + [1e-5] * 3, [1e-4] * 3 + [1e-5] * 3)
    state = state_of_pose(MOUNT, frame="reflector", pivot=pivot, translation=pose[:3], rotation=pose[3:],
                          covariance=covariance)  # fmt: skip
    np.testing.assert_allclose(state.six, [*SHIFT, *ANGLES], rtol=0, atol=1e-12)
    np.testing.assert_allclose(state.lengths, actuator_lengths(SHIFT, ANGLES, **MOUNT.joints)[0], rtol=0, atol=1e-12)
    # lengths of joints moved by drawn poses, without the six degrees between
    rng, count = np.random.default_rng(3), 4000
    moving = MOUNT.joints["moving"] + FOCUS
    draws = rng.multivariate_normal(pose, covariance, count, method="cholesky")
    turned = np.array([pivot + d[:3] + Rotation.from_rotvec(d[3:]).apply(moving - pivot) for d in draws]) - FOCUS
    lengths = np.linalg.norm(turned - MOUNT.joints["fixed"], axis=-1)
    u = np.sqrt(np.diag(state.lengths_covariance))
    np.testing.assert_allclose(
        np.cov(lengths.T) / np.outer(u, u), state.lengths_covariance / np.outer(u, u), rtol=0,
        atol=4 * np.sqrt(2 / count)
    )  # fmt: skip


@pytest.mark.parametrize(("source", "word"), [("commanded", "failed"), ("lengths", "doubtful")])
def test_a_length_beyond_its_limits_is_no_good_position(source, word):
    state = state_of_position(MOUNT, np.array([0.0, 0.0, -0.5]), np.zeros(3))
    if source == "lengths":
        state = state_of_lengths(MOUNT, state.lengths)
    assert state.verdict.word == word
    assert "actuator 1A is 27" in state.verdict.why
    assert state.beyond.all()


def test_what_determines_no_position_is_refused():
    with pytest.raises(EstimationError, match="no position reached from rest has the lengths 100, 100"):
        state_of_lengths(MOUNT, np.array([0.1, 0.1, 0.1, 0.1, 0.1, 9.0]))
    upright = tuple(
        a.model_copy(update={"fixed_mm": (*a.moving_mm[:2], a.moving_mm[2] + 2300.0)}) for a in MOUNT.actuator
    )
    with pytest.raises(EstimationError, match="six lengths do not determine the position"):
        state_of_position(MOUNT.model_copy(update={"actuator": upright}), np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="frame 'ground' of the pose is not the reflector's"):
        state_of_pose(MOUNT, frame="ground", pivot=np.zeros(3), translation=np.zeros(3), rotation=np.zeros(3),
                      covariance=np.eye(6))  # fmt: skip
