"""The JSON objects hold what the contract names, and nothing that JSON does not know."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from catseye.gateways.epoch.objects import pose_object, reduction_object
from catseye.gateways.writers.objects import json_line, json_page


def strict(text):
    def refuse(constant):
        raise AssertionError(constant)

    return json.loads(text, parse_constant=refuse)


def test_the_reduction_has_every_key_of_the_contract(reduction):
    found = strict(json_line(reduction_object(reduction)))
    for key in ("points", "variance_factor", "degrees_of_freedom", "rejected", "refractivity_ppm", "pose"):
        assert key in found
    point = found["points"]["ZY113"]
    assert set(point) >= {"x", "y", "z", "covariance", "shots"}
    assert np.shape(point["covariance"]) == (3, 3)
    assert found["rejected"] == {str(shot): reason for shot, reason in reduction.rejected.items()}
    assert found["shots"]["total"] == sum(found["shots"][word] for word in ("used", "reference", "rejected"))
    assert "ZY101-F" in found["points"]


def test_pose_states_frame_pivot_and_unobserved_components(reduction):
    pose = strict(json_line(reduction_object(reduction)))["pose"]
    assert pose["frame"] == "ground"
    assert len(pose["pivot"]) == 3
    assert np.shape(pose["covariance"]) == (6, 6)
    assert pose["unobserved"]
    assert np.linalg.norm(pose["axis"]) == pytest.approx(1.0, abs=1e-12)


def test_the_covariance_of_all_points_is_written_with_its_order(written, reduction):
    found = strict((written / "coordinates.json").read_text())
    order = found["covariance_order"]
    assert len(order) == 3 * len(found["points"])
    assert np.array_equal(found["covariance"], reduction.coordinates.covariance)
    row = order.index("ZY113 x")
    assert found["covariance"][row][row] == found["points"]["ZY113"]["covariance"][0][0]


def test_campaign_without_dish_has_null_pose_and_a_reason(reduction):
    blind = replace(reduction, surface=None, no_surface="no paraboloid: it needs 5 points, 2 given")
    assert strict(json_line(reduction_object(blind)))["pose"] is None
    found = strict(json_page(pose_object(blind)))
    assert found["pose"] is None
    assert "2 given" in found["reason"]


def test_missing_numbers_become_null():
    assert strict(json_line({"a": np.float64("nan"), "b": [math.inf, 1], "c": np.int64(3)})) == {
        "a": None,
        "b": [None, 1],
        "c": 3,
    }


def test_provenance_proves_inputs_and_outputs(written, reduction):
    found = strict((written / "provenance.json").read_text())
    assert found["inputs_sha256"] == reduction.campaign.hashes
    assert found["settings"]["air_model"] == reduction.settings.air_model
    assert set(found["versions"]) >= {"catseye", "python", "numpy", "scipy"}
    assert set(found["outputs"]) == {path.name for path in written.iterdir()} - {"provenance.json"}
    for name, digest in found["outputs"].items():
        assert hashlib.sha256((written / name).read_bytes()).hexdigest() == digest


def test_output_contains_no_local_paths(written, reduction):
    place = str(reduction.campaign.directory.resolve().parent)
    assert not [path.name for path in written.iterdir() if place.encode() in path.read_bytes()]


def test_benchmarks_are_reported_as_refractometers(reduction):
    """Each path's index must agree with the stations' within both uncertainties, as night-01's stations nearly do."""
    told = reduction_object(reduction)["air"]
    assert told["lines_by_sound"] == {}
    assert [one["benchmark"] for one in told["benchmarks"]] == [b.target for b in reduction.campaign.benchmarks]
    for one in told["benchmarks"]:
        assert one["shots"] > 0
        u = math.hypot(one["u_path_ppm"], one["u_weather_ppm"])
        assert abs(one["path_ppm"] - one["weather_ppm"]) < 3.0 * u
        # about 0.93 ppm a degree: the same difference in degrees
        difference = one["path_ppm"] - one["weather_ppm"]
        assert one["thermometers_too_warm_c"] == pytest.approx(difference / 0.93, rel=0.08, abs=0.02)
