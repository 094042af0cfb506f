"""The tables say what was measured, shot by shot, and every correction can be followed."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.gateways.epoch.tables import kinds_of, ranges_csv
from column_scene import assert_columns


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
    parts = ("air_mm", "d0_mm", "zero_mm", "glass_mm", "obliquity_mm", "leakage_mm", "head_mm", "moved_mm")
    ranged = [row for row in ranges if row["range_m"]]
    assert len(ranged) > 600
    for row in ranged:
        total = float(row["vacuum_length_m"]) + 1e-3 * sum(float(row[part]) for part in parts)
        assert total == pytest.approx(float(row["range_m"]), abs=4e-7)  # seven cells rounded to 0.05 um each


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


def test_kinds_are_distinguished(written):
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


def test_the_corrections_of_a_range_add_up_to_it_and_its_phase_is_a_difference(written):
    """The sum on docs/formats/results.md, to 0.5 um: eight cells of four decimals, two of seven."""
    parts = ["air", "d0", "zero", "glass", "obliquity", "leakage", "head", "moved"]
    rows = [row for row in read(written / "ranges.csv") if row["range_m"]]
    assert len(rows) > 600
    for row in rows:
        total = float(row["vacuum_length_m"]) + 1e-3 * sum(float(row[f"{part}_mm"]) for part in parts)
        assert total == pytest.approx(float(row["range_m"]), abs=5e-7)
        phase = float(row["phase_rad"]) - float(row["electronics_rad"]) - float(row["difference_rad"])
        assert abs(phase - TWO_PI * round(phase / TWO_PI)) < 2e-7


def test_every_column_of_the_ranges_has_the_unit_of_its_name(reduction):
    """In night-01 no head stands off its scan point, no shot is thin and none distorted: here some do and are."""
    campaign, phases, coordinates = reduction.campaign, reduction.phases, reduction.coordinates
    bent = np.where((np.arange(len(phases.phasor)) % 11 == 0)[:, None], phases.amplitude[:, None], phases.harmonics)
    phases = replace(phases, harmonics=bent)
    count = len(coordinates.ranges.shot)
    ranges = replace(coordinates.ranges, head=np.linspace(-3e-3, 5e-3, count), thin=np.arange(count) % 7 == 0)
    changed = replace(reduction, phases=phases, coordinates=replace(coordinates, ranges=ranges))
    shots, row = campaign.shots, {int(shot): k for k, shot in enumerate(ranges.shot)}
    half = 0.5 * SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz

    def ranged(value):
        return lambda k: value(row[k]) if k in row else None

    def vacuum(k):
        return (ranges.cycles[k] - ranges.phase[k] / TWO_PI) * half

    told = {
        "shot": lambda k: shots.shot[k],
        "mjd_utc": lambda k: shots.mjd_utc[k],
        "ranger": lambda k: shots.ranger[k],
        "target": lambda k: shots.target[k],
        "status": lambda k: reduction.status[k],
        "reason": lambda k: reduction.rejected.get(int(shots.shot[k]), ""),
        "amplitude_v": lambda k: phases.amplitude[k],
        "phase_rad": lambda k: phases.phase[k],
        "u_phase_rad": lambda k: phases.u_phase[k],
        "harmonic_2": lambda k: phases.harmonics[k, 0] / phases.amplitude[k],
        "harmonic_3": lambda k: phases.harmonics[k, 1] / phases.amplitude[k],
        "distorted": lambda k: "distorted" if k % 11 == 0 and phases.reason[k] is None else "",
        "electronics_rad": ranged(lambda k: ranges.electronics[k] % TWO_PI),
        "difference_rad": ranged(lambda k: ranges.phase[k]),
        "cycles": ranged(lambda k: ranges.cycles[k]),
        "margin_mm": ranged(lambda k: ranges.margin[k]),
        "thin": lambda k: "thin" if k in row and ranges.thin[row[k]] else "",
        "vacuum_length_m": ranged(vacuum),
        "refractivity_ppm": ranged(lambda k: ranges.refractivity[k]),
        "air_mm": ranged(lambda k: -vacuum(k) * ranges.refractivity[k] / (1.0 + ranges.refractivity[k])),
        "d0_mm": lambda k: 1e-3 * campaign.mirror_of(shots.ranger[k]).d0_mm,
        "zero_mm": ranged(lambda k: ranges.zero[k]),
        "glass_mm": ranged(lambda k: ranges.glass[k]),
        "incidence_deg": ranged(lambda k: ranges.incidence[k]),
        "obliquity_mm": ranged(lambda k: ranges.obliquity[k]),
        "leakage_mm": ranged(lambda k: ranges.leakage[k]),
        "head_mm": ranged(lambda k: ranges.head[k]),
        "moved_mm": ranged(lambda k: ranges.moved[k]),
        "range_m": ranged(lambda k: ranges.range_[k]),
        "u_range_mm": ranged(lambda k: ranges.u_range[k]),
        "residual_mm": ranged(lambda k: ranges.residual[k]),
        "standardised": ranged(lambda k: ranges.standardised[k]),
        "redundancy": ranged(lambda k: ranges.redundancy[k]),
        "detectable_mm": ranged(lambda k: ranges.detectable[k]),
    }
    assert_columns(ranges_csv(changed), told, range(len(shots)))


def test_every_column_of_the_coordinates_has_the_unit_of_its_name(written, reduction):
    found = reduction.coordinates

    def q(i, a, b):
        return found.covariance[3 * i + a, 3 * i + b]

    told = {
        "point": lambda i: found.points[i],
        "kind": lambda i: kinds_of(reduction)[found.points[i]],
        **{f"{'xyz'[a]}_m": lambda i, a=a: found.x[i, a] for a in range(3)},
        **{f"u_{'xyz'[a]}_mm": lambda i, a=a: q(i, a, a) ** 0.5 for a in range(3)},
        **{f"cov_{'xyz'[a]}{'xyz'[b]}_mm2": lambda i, a=a, b=b: q(i, a, b) for a, b in ((0, 1), (0, 2), (1, 2))},
        "shots": lambda i: found.shots[i],
        "from_approximate_mm": lambda i: np.linalg.norm(found.x[i] - found.start[i]),
        "lines": lambda i: found.lines[i],
        "status": lambda i: "unchecked" if found.points[i] in found.unchecked else "checked",
    }
    assert_columns((written / "coordinates.csv").read_text(), told, range(len(found.points)))


def test_every_column_of_the_surface_has_the_unit_of_its_name(written, reduction):
    surface, found = reduction.surface, reduction.coordinates
    told = {
        "point": lambda i: surface.names[i],
        **{f"{'xyz'[a]}_dish_m": lambda i, a=a: surface.fit.local[i, a] for a in range(3)},
        "deviation_mm": lambda i: surface.fit.deviation[i],
        "u_deviation_mm": lambda i: surface.u_deviation[i],
        "shots": lambda i: found.shots[found.points.index(surface.names[i])],
    }
    assert_columns((written / "surface.csv").read_text(), told, range(len(surface.names)))
