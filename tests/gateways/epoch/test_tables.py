"""The tables say what was measured, shot by shot, and every correction can be followed."""

import csv

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT, TWO_PI


def read(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def ranges(written):
    return read(written / "ranges.csv")


def test_every_shot_has_its_row_in_the_order_of_the_campaign(ranges, reduction):
    assert [int(row["shot"]) for row in ranges] == reduction.campaign.shots.shot.tolist()


def test_rejected_shots_stay_with_their_reason_and_only_they_have_one(ranges, reduction):
    assert {int(row["shot"]): row["reason"] for row in ranges if row["reason"]} == reduction.rejected
    assert all(row["status"] in ("used", "reference") for row in ranges if not row["reason"])


def test_the_corrections_one_by_one_add_up_to_the_range(ranges):
    parts = ("air_mm", "d0_mm", "zero_mm", "glass_mm", "obliquity_mm", "leakage_mm", "head_mm")
    ranged = [row for row in ranges if row["range_m"]]
    assert len(ranged) > 600
    for row in ranged:
        total = float(row["vacuum_length_m"]) + 1e-3 * sum(float(row[part]) for part in parts)
        assert total == pytest.approx(float(row["range_m"]), abs=4e-7)  # six cells rounded to 0.05 um each


def test_the_vacuum_length_follows_from_cycles_and_phases_alone(ranges, reduction):
    half = 0.5 * SPEED_OF_LIGHT / reduction.campaign.site.ranging.modulation_hz
    for row in ranges:
        if row["range_m"]:  # 0.05 um from the cell's last digit, 0.002 um from each phase's
            turn = (float(row["phase_rad"]) - float(row["electronics_rad"])) / TWO_PI % 1.0
            length = (int(row["cycles"]) - turn) * half
            assert length == pytest.approx(float(row["vacuum_length_m"]), abs=6e-8)


def test_reference_and_blocked_shots_have_no_range(ranges):
    without = [row for row in ranges if row["target"] == "ZRG" or row["status"] == "blocked"]
    assert without
    assert all(row["range_m"] == row["cycles"] == row["residual_mm"] == "" for row in without)


def test_coordinates_carry_their_covariance(written, reduction):
    rows = read(written / "coordinates.csv")
    coordinates = reduction.coordinates
    assert [row["point"] for row in rows] == list(coordinates.points)
    for i, row in enumerate(rows):
        assert [float(row[f"{axis}_m"]) for axis in "xyz"] == pytest.approx(coordinates.x[i], abs=5.1e-8)
        u = np.sqrt(np.diag(coordinates.covariance)[3 * i : 3 * i + 3]) * 1e3
        assert [float(row[f"u_{axis}_mm"]) for axis in "xyz"] == pytest.approx(u, abs=5.1e-5)


def test_kinds_are_told_apart(written):
    kinds = {row["point"]: row["kind"] for row in read(written / "coordinates.csv")}
    assert kinds["ZY101"] == "ground ranger"
    assert kinds["ZY101-F"] == "fixed point"
    assert kinds["ZY113"] == "feed-arm ranger"
    assert kinds["DP001"] == "dish prism"
    assert kinds["TR01-B"] == "triplet ball"
    assert kinds["TR01-L"] == "triplet prism"
    assert kinds["ZBM01"] == "benchmark"
    assert kinds["ZEG41040L"] == "structure"


def test_the_surface_has_a_row_a_prism(written, reduction):
    rows = read(written / "surface.csv")
    deviation = np.array([float(row["deviation_mm"]) for row in rows])
    assert np.sqrt(np.mean(deviation**2)) == pytest.approx(reduction.surface.rms * 1e3, abs=1e-4)
