"""`follow`: the example, its files and its model; what does not fit is refused by name."""

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError

QUADRANT = {"slope_mm": 10.0, "u_signal": 0.002}
MODEL = {"model": "structural-model/telescope.toml"}
RANGER = {**MODEL, "site": "gbt", "ranger": "ZY115", "posture_deg": (145.3, 30.0)}


@pytest.fixture(scope="module")
def found():
    return catseye.follow("vibration/quadrant.csv", **QUADRANT, **RANGER)


def test_the_example_s_modes_are_those_that_it_was_made_with(found):
    np.testing.assert_array_less(np.abs(found.frequency_hz - [0.80, 1.02]), 4.0 * found.u_frequency_hz)
    assert found.verdict.word == "good"
    assert found.followed.names == ("sway", "nod")
    assert np.all(found.after < 0.25 * found.before)


def test_a_pose_says_its_frame_and_pivot(found):
    motion = found.to_object()["motion"]
    assert (motion["frame"], motion["pivot"]) == ("feed_arm", [0.0, 0.0, 0.0])
    assert motion["ranger"] == {"name": "ZY115", "frame": "ground"}
    assert len(motion["times"]) == len(found.leads)
    assert "pivot 0, 0, 0 m" in found.passages()[-1].text


def test_tables_and_files(found, tmp_path):
    modes = found.to_table()
    assert list(modes["mode"]) == ["sway", "sway", "nod", "nod"]
    assert modes["amplitude"][0].to_value("m") == found.amplitude[0, 0]
    assert found.to_table("predicted")["lead"].to_value("s").tolist() == [0.128, 0.5, 1.0, 2.0]
    written = catseye.save(found, tmp_path / "arm")
    names = {"modes.csv", "predicted.csv", "residuals.csv", "following.svg", "result.json", "provenance.json"}
    assert {path.name for path in written.iterdir()} == names


def test_ranges_are_followed_without_a_model(tmp_path):
    rng, times = np.random.default_rng(9), 0.128 * np.arange(300)
    ranges = 120.0 + 1e-3 * np.cos(2 * np.pi * 1.02 * times) + 20e-6 * rng.standard_normal(300)
    rows = [f"{t:.3f},{r:.6f}" for t, r in zip(times, ranges, strict=True)]
    (tmp_path / "ranges.csv").write_text("time_s,range_m\n" + "\n".join(rows) + "\n")
    found = catseye.follow(tmp_path / "ranges.csv", u_mm=0.02, window_s=0.128, near_hz=(1.0,))
    assert abs(found.frequency_hz[0] - 1.02) < 4.0 * found.u_frequency_hz[0]
    assert found.motion is None
    assert found.axes == ("range",)
    with pytest.raises(ArgumentError, match="do not show how the arm turns"):
        catseye.follow(tmp_path / "ranges.csv", u_mm=0.02, window_s=0.128, **RANGER)
    with pytest.raises(ArgumentError, match=r"longer than the 0\.128 s between samples"):
        catseye.follow(tmp_path / "ranges.csv", u_mm=0.02, window_s=0.2)


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"u_signal": None}, {"slope_mm", "u_signal"}),
        ({"u_mm": 1.0}, {"u_mm"}),
        ({"slope_mm": 0.0}, {"slope_mm"}),
        ({"modes": 0}, {"modes"}),
        ({"modes": 2, "near_hz": (1.0,)}, {"near_hz", "modes"}),
        ({"leads_s": (-1.0,)}, {"leads_s"}),
        ({"target": "ZEG1", **MODEL}, {"target"}),
        ({"ranger": "ZY115", "site": "gbt"}, {"site", "model"}),
        ({**MODEL, "ranger": "ZY115"}, {"ranger", "site"}),
        ({**RANGER, "posture_deg": None}, {"posture_deg"}),
        ({**RANGER, "ranger": "ZY103"}, {"ranger"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.follow("vibration/quadrant.csv", **{**QUADRANT, **arguments})
    assert set(refused.value.names) == names


def test_a_missing_series_is_named():
    with pytest.raises(InputError, match=r"none\.csv"):
        catseye.follow("none.csv", **QUADRANT)
