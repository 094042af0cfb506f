"""`subreflector`: tables, JSON, a pose of six degrees as result and as file, refusals by name."""

import json

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError

MOUNT = "subreflector/hexapod.toml"


def test_lengths_and_position_are_each_other_s_inverse():
    there = catseye.subreflector(MOUNT, shift_mm=(5.0, 0.0, 10.0), turn_deg=(0.3, -0.2, 0.1))
    back = catseye.subreflector(MOUNT, lengths_mm=there.lengths * 1e3)
    np.testing.assert_allclose(back.shift, [0.005, 0.0, 0.010], rtol=0, atol=1e-11)
    np.testing.assert_allclose(np.degrees(back.turn), [0.3, -0.2, 0.1], rtol=0, atol=1e-9)
    assert there.to_table("lengths")["change"].to_value("m").tolist() == pytest.approx(there.changes.tolist())
    assert there.to_table("position")["value"].tolist() == pytest.approx([5.0, 0.0, 10.0, 0.3, -0.2, 0.1])
    assert json.loads(json.dumps(there.to_object()))["shift"] == pytest.approx([0.005, 0.0, 0.010])


def test_a_pose_file_says_what_brings_the_subreflector_back(tmp_path):
    document = {
        "format": "catseye-pose-1", "frame": "reflector", "pivot": [0.0, 0.0, 64.0], "translation": [0.0, 0.0, 0.01],
        "rotation": [0.0, 0.0, 0.0], "covariance": (np.eye(6) * 1e-10).tolist(),
    }  # fmt: skip
    path = tmp_path / "pose.json"
    path.write_text(json.dumps(document))
    found = catseye.subreflector(MOUNT, pose=path)
    np.testing.assert_allclose(found.shift, [0.0, 0.0, 0.01], rtol=0, atol=1e-12)
    wanted = catseye.subreflector(MOUNT, shift_mm=(0.0, 0.0, 10.0))
    np.testing.assert_allclose(found.lengths, wanted.lengths, rtol=0, atol=1e-12)
    [rest] = [passage.text for passage in found.passages() if passage.title == "To rest"]
    assert rest.startswith(f"change the lengths by 1A {-1e3 * found.changes[0]:+.3f}, 1B")
    assert list(found.inputs()) == ["hexapod.toml", "pose.json"]
    del document["pivot"]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="pivot is missing"):
        catseye.subreflector(MOUNT, pose=path)


ALL = {"shift_mm", "turn_deg", "lengths_mm", "pose"}  # a refusal of two names every way


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({}, ALL),
        ({"shift_mm": (0, 0, 1), "lengths_mm": (2300,) * 6}, ALL),
        ({"turn_deg": (0, 0, 1), "pose": "pose.json"}, ALL),
        ({"shift_mm": (0, 0)}, {"shift_mm"}),
        ({"shift_mm": (0, 0, 6000)}, {"shift_mm"}),
        ({"turn_deg": (0, 90, 0)}, {"turn_deg"}),
        ({"lengths_mm": (2300,) * 5}, {"lengths_mm"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.subreflector(MOUNT, **arguments)
    assert set(refused.value.names) == names
