"""Corrections: opposite of the offsets, with their zero, moves since, and the reason when there are none."""

import math

import numpy as np
import pytest

from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.samplers.columns import COLUMNS, TEXTS, TRIANGLE, unit_of
from catseye.coordinator.samplers.corrections import CorrectionOutput
from catseye.coordinator.samplers.pose_rows import pose_rows
from catseye.ranger.line import stamp_text
from catseye.records.night.live import Happening

TICKS = 5_288_900_000_000
COVARIANCE = [[4e-12, 1e-13, 0.0], [1e-13, 9e-12, 0.0], [0.0, 0.0, 1.6e-7]]


def solution(number, *, reference=2, offset=(1e-5, -2e-5, 3e-4), doubts=(), ticks=None, pose=True):
    motion = {
        "body": "dish",
        "pivot": [0.0, 0.0, 0.0],
        "translation": [1e-5, 2e-5, 3e-5],
        "rotation": [1e-7, 2e-7, 3e-7],
    }
    motion |= {"covariance": np.arange(36.0).reshape(6, 6).tolist()}
    own = {"dish": motion, "feed": None, "offset": list(offset), "covariance": COVARIANCE, "missing": ""}
    answer = {"number": number, "reference": reference, "azimuth": 2.5 + number, "elevation": 0.7, "names": ["TR01"]}
    return EpochSolution(
        TICKS + number * 1000 if ticks is None else ticks, answer | {"doubts": doubts, "pose": own if pose else None}
    )


def move(ticks):
    details = {"actuator": "subreflector", "value": "2.5", "unit": "mm", "by": "anna"}
    return Happening(ticks, "coordinator", "actuator-moved", "it was moved", details=details)


def named(row):
    return dict(zip(COLUMNS["CORRECTIONS"], row[1:], strict=True))


def test_correction_is_the_opposite_of_the_offset_relative_to_its_zero():
    output = CorrectionOutput(lambda: True)
    assert named(output.row(solution(1, reference=0, pose=False)))["state"] == "unknown"
    output.row(solution(2))
    found = named(output.row(solution(3)))
    values = [float(found[name]) for name in ("azimuth_cos_e_rad", "elevation_rad", "focus_m")]
    np.testing.assert_allclose(values, [-1e-5, 2e-5, -3e-4])
    u = [float(found[name]) for name in ("u_azimuth_cos_e_rad", "u_elevation_rad", "u_focus_m")]
    np.testing.assert_allclose(u, [2e-6, 3e-6, 4e-4])
    assert (found["epoch"], found["state"], found["reference"]) == ("3", "given", "2")
    assert found["reference_mjd_d"] == stamp_text(TICKS + 2000)
    assert (float(found["reference_azimuth_rad"]), float(found["reference_elevation_rad"])) == (4.5, 0.7)


@pytest.mark.parametrize(
    ("gives", "entry", "state"),
    [
        (False, solution(3), "off"),
        (True, solution(3, doubts=("a thermometer is biased",)), "doubtful"),
        (True, solution(3, offset=(math.nan, 0.0, 0.0)), "unknown"),
    ],
)
def test_correction_that_must_not_be_applied_has_no_numbers(gives, entry, state):
    output = CorrectionOutput(lambda: gives)
    output.row(solution(2))
    found = named(output.row(entry))
    assert found["state"] == state
    assert {found[name] for name in COLUMNS["CORRECTIONS"][2:8]} == {"none"}
    assert found["reference"] == "2"


def test_moves_count_since_the_reference_epoch():
    output = CorrectionOutput(lambda: True)
    assert output.row(move(TICKS)) is None
    output.row(solution(2))
    assert output.moves == 0
    output.row(move(TICKS + 2500))
    output.row(move(TICKS + 2600))
    assert named(output.row(solution(3)))["moves"] == "2"
    assert named(output.row(solution(4, reference=3)))["moves"] == "0"  # epoch 3 is the zero since then
    assert output.zero.number == 3


def test_zero_that_was_not_seen_is_unknown():
    output = CorrectionOutput(lambda: True)
    found = named(output.row(solution(9, reference=2)))
    assert (found["reference"], found["reference_mjd_d"]) == ("none", "none")


def test_pose_beam_and_focus_have_their_covariances():
    rows = {name: dict(zip(COLUMNS[name], row[1:], strict=True)) for name, row in pose_rows(solution(3))}
    assert set(rows) == {"POSE", "BEAM", "FOCUS"}
    pose = rows["POSE"]
    assert (pose["epoch"], pose["reference"], pose["body"], float(pose["ry_rad"])) == ("3", "2", "dish", 2e-7)
    columns = COLUMNS["POSE"][-len(TRIANGLE) :]
    assert [float(pose[name]) for name in columns] == [6.0 * i + j for i, j in TRIANGLE]
    assert float(rows["BEAM"]["azimuth_elevation_rad2"]) == 1e-13
    assert float(rows["FOCUS"]["u_along_axis_m"]) == pytest.approx(4e-4)
    assert list(pose_rows(solution(1, pose=False))) == []


def test_every_column_is_text_or_has_a_unit_that_its_name_says():
    covariances = [unit_of(name) for name in COLUMNS["POSE"][-len(TRIANGLE) :]]
    assert (covariances.count("m2"), covariances.count("m rad"), covariances.count("rad2")) == (6, 9, 6)
    numbers = {name for columns in COLUMNS.values() for name in columns if name not in TEXTS and not unit_of(name)}
    assert numbers == {
        *("number", "epoch", "points", "shots", "rejected", "variance_factor", "degrees_of_freedom", "used"),
        *("refractivity_ppm", "reference", "prisms", "moves", "value", "temperature_c", "humidity_percent"),
        *("azimuth_error_counts", "elevation_error_counts"),
    }
