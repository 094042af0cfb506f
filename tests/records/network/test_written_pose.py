"""pose.json read back: of a group and of a night, each part or none, refused with file and value."""

import json

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.records.files.reading import Folder
from catseye.records.network.written_pose import GROUP_POSE, NIGHT_POSE, read_written_pose

Q6, Q3 = np.eye(6).tolist(), np.eye(3).tolist()
WHOLE = {
    "format": GROUP_POSE,
    "posture": {"azimuth_deg": 145.0, "elevation_deg": 30.0},
    "frame": "alidade",
    "rotation": [1e-6, 2e-6, 3e-6],
    "covariance": Q6,
    "pointing": {"correction": [1e-5, 2e-5, 1e-3], "covariance": Q3},
    "verdict": {"word": "doubtful", "why": "it was foggy"},
}


def written(folder, document):
    path = folder / "pose.json"
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return path


def test_every_part_comes_back_in_si(tmp_path):
    folder = Folder(tmp_path)
    pose = read_written_pose(written(tmp_path, WHOLE), folder=folder)
    assert pose.posture == pytest.approx((145.0 * DEGREE, 30.0 * DEGREE))
    assert (pose.frame, pose.verdict.word) == ("alidade", "doubtful")
    np.testing.assert_array_equal(pose.rotation, [1e-6, 2e-6, 3e-6])
    np.testing.assert_array_equal(pose.correction, [1e-5, 2e-5, 1e-3])
    np.testing.assert_array_equal(pose.covariance, Q6)
    np.testing.assert_array_equal(pose.correction_covariance, Q3)
    assert folder.hashes == {"pose.json": pose.digest}


def test_a_part_that_the_file_lacks_is_none(tmp_path):
    pose = read_written_pose(written(tmp_path, {"format": GROUP_POSE, "pointing": None, "posture": None}))
    assert (pose.posture, pose.rotation, pose.covariance, pose.correction, pose.verdict) == (None,) * 5


def test_a_night_s_pose_is_welcome_where_it_is_expected(tmp_path):
    path = written(tmp_path, {"format": NIGHT_POSE, "nominal_posture": WHOLE["posture"]})
    assert read_written_pose(path, expected=(NIGHT_POSE,)).posture == pytest.approx((145.0 * DEGREE, 30.0 * DEGREE))
    with pytest.raises(InputError, match="expected 'catseye-pose-1', as catseye pose --out writes it"):
        read_written_pose(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("{", "is not JSON"),
        ("[]", "is not such a pose: format = None"),
        ({"rotation": [1.0, 2.0]}, r"rotation has the shape \(2,\)"),
        ({"covariance": Q3}, "expected 6 x 6 finite numbers"),
        ({"rotation": ["a", 0, 0]}, "rotation cannot be read"),
        ({"pointing": {"correction": [0, 0, None], "covariance": Q3}}, "pointing.correction has the shape"),
        ({"posture": {"azimuth_deg": True, "elevation_deg": 3}}, "expected azimuth_deg and elevation_deg"),
        ({"verdict": {"word": "fine", "why": ""}}, "verdict = "),
    ],
)
def test_what_cannot_be_used_is_refused_with_file_and_value(tmp_path, change, said):
    path = written(tmp_path, change if isinstance(change, str) else {**WHOLE, **change})
    with pytest.raises(InputError, match=said) as refused:
        read_written_pose(path)
    assert str(path) in str(refused.value)
