"""Corrections and tilts of written poses: the right numbers of each, and poses that lack them refused."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.network.written_pose import WrittenPose
from catseye.reduction.pose.corrections import PointingObservations
from catseye.reduction.pose.track_profile import track_of_poses, track_profile
from catseye.verdict import Verdict

RNG = np.random.default_rng(6)


def spread(size):
    root = RNG.normal(size=(size, size)) * 1e-6
    return root @ root.T + 1e-14 * np.eye(size)


def pose(k, **change):
    parts = {
        "file": f"pose-{k}.json",
        "posture_deg": (np.degrees(0.8 * k), np.degrees(0.5 + 0.05 * k)),
        "frame": "alidade",
        "rotation": RNG.normal(size=3) * 1e-6,
        "covariance": spread(6),
        "correction": RNG.normal(size=3) * 1e-5,
        "correction_covariance": spread(3),
        "verdict": Verdict("doubtful", f"fog {k}"),
        "digest": f"{k:064x}",
    }
    return WrittenPose(**{**parts, **change})


def test_a_beam_gives_azimuth_and_elevation_with_their_block_of_the_covariance():
    poses = [pose(k) for k in range(3)]
    observations = PointingObservations.of_poses(poses)
    assert (observations.source, observations.name, observations.stars) == ("metrology", "pose-0.json", None)
    assert observations.covariance.shape == (6, 6)
    for k, each in enumerate(poses):
        assert (observations.azimuth[k], observations.elevation[k]) == each.posture
        np.testing.assert_array_equal(observations.correction[k], each.correction[:2])
        block = observations.covariance[2 * k : 2 * k + 2]
        np.testing.assert_array_equal(block[:, 2 * k : 2 * k + 2], each.correction_covariance[:2, :2])
        assert np.count_nonzero(block) == 4
    assert observations.hashes == {each.file: each.digest for each in poses}
    assert observations.sources == {each.file: each.verdict for each in poses}


def test_poses_of_the_alidade_give_their_turns_about_x_and_y():
    poses = [pose(k) for k in range(8)]
    found = track_of_poses(poses, harmonics=1)
    right = track_profile(
        np.array([each.posture[0] for each in poses]),
        np.array([each.rotation[:2] for each in poses]),
        np.array([each.covariance[3:5, 3:5] for each in poses]),
        harmonics=1,
    )
    np.testing.assert_array_equal(found.series.values, right.series.values)
    np.testing.assert_array_equal(found.series.covariance, right.series.covariance)
    assert found.sources == {each.file: each.verdict for each in poses}


@pytest.mark.parametrize("part", ["posture_deg", "correction", "correction_covariance"])
def test_a_pose_without_beam_or_posture_is_refused(part):
    with pytest.raises(InputError, match=r"pose-1\.json: has no pointing or no posture"):
        PointingObservations.of_poses([pose(0), pose(1, **{part: None})])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frame": "ground"}, "expected 'alidade'"),
        ({"posture_deg": None}, "with its posture"),
        ({"rotation": None}, "rotation or covariance is missing"),
        ({"covariance": None}, "rotation or covariance is missing"),
    ],
)
def test_a_pose_that_is_not_the_alidade_s_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        track_of_poses([pose(0), pose(1, **change)], harmonics=0)
