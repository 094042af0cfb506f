"""`catseye structure` as a user meets it: reductions, a list, a journal; what it writes, what it refuses."""

import csv
import json

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.coordinator.journal.writer import Journal
from catseye.gateways.writers.samplers_fits import read_samplers
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.geometry.frames.rotation import from_vector
from catseye.records.network.solved_points import FORMAT
from catseye.records.night.live import LiveShot, LiveWeather
from catseye.simulator.clock.world_clock import ManualClock
from gateways.report_scene import column, read, texts
from journal_scene import START, scene_run

NAMES = ("ZEG1", "ZEG2", "ZEG3", "ZEG4", "ZEG5")
REST = np.array([[0.0, 5, 40], [8, 6, 48], [-8, 7, 50], [1, 12, 58], [0, 3, 62]])
SIX_COS = np.array([0.002, 0.010, -0.001, 40 * ARCSECOND, 0.0, 5 * ARCSECOND])
FOOT = np.array([0.0, -8.0, 10.0])


def epoch(rng, elevation, warm, u=5e-5):
    """Ground coordinates of a body that bends with cosE and a little with temperature, by rotations, and noise."""
    six = SIX_COS * np.cos(elevation) + 0.02 * SIX_COS * (warm - 10.0)
    bent = FOOT + six[:3] + (REST - FOOT) @ from_vector(six[3:]).T
    return ground_from_reflector(2.5, elevation).points(bent) + u * rng.standard_normal((5, 3))


@pytest.fixture
def nights(tmp_path):
    """A folder of 14 reductions with a list of them."""
    rng = np.random.default_rng(8)
    folder = tmp_path / "nights"
    rows = ["reduction,azimuth_deg,elevation_deg,temperature_c,mjd_utc"]
    for k, e in enumerate(np.linspace(10.0, 80.0, 14)):
        warm = 10.0 + 3.0 * np.sin(k)
        x = epoch(rng, e * DEGREE, warm)
        points = {n: dict(zip("xyz", row.tolist(), strict=True)) for n, row in zip(NAMES, x, strict=True)}
        points["ZY101"] = {"x": 120.0, "y": 0.0, "z": 0.0}
        order = [f"{n} {a}" for n in points for a in "xyz"]
        night = folder / f"night-{k:02d}"
        night.mkdir(parents=True)
        document = {
            "format": FORMAT,
            "frame": "ground",
            "points": points,
            "covariance_order": order,
            "covariance": (2.5e-9 * np.eye(18)).tolist(),
        }
        (night / "coordinates.json").write_text(json.dumps(document))
        posture = {"azimuth_deg": 2.5 / DEGREE, "elevation_deg": e}
        (night / "pose.json").write_text(json.dumps({"format": FORMAT, "nominal_posture": posture}))
        rows.append(f"night-{k:02d},{2.5 / DEGREE!r},{float(e)!r},{float(warm)!r},{60000 + k / 24!r}")
    (folder / "epochs.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_a_list_of_reductions_gives_the_planted_motion_and_all_files(catseye, nights, tmp_path):
    out = tmp_path / "out"
    status, said, err = catseye(
        "structure", "--epochs", nights / "epochs.csv", "--points", "ZEG*", "--group", "arm", "--pivot=0,-8,10",
        "--predict", 45, "--predict", 88, "--temperature-c", 12, "--out", out, "--json",
    )  # fmt: skip
    assert (status, err) == (0, "")
    found = json.loads(said)
    assert found["epochs"] == 14
    assert list(found["points"]) == list(NAMES)
    assert found["frame"] == "reflector"
    assert found["pivot"] == [0.0, -8.0, 10.0]
    cosine, warm = (found["coefficients"][name] for name in ("cosE", "t"))
    for c in (cosine, warm):
        factor = 1.0 if c is cosine else 0.02
        off = (np.array(c["value"]) - factor * SIX_COS) / np.array(c["u"])
        assert np.abs(off).max() < 4.0
    assert found["left_out"]["ratio"] < 1.6
    told = found["prediction"]
    assert told["outside"] == ["elevation 88 deg is outside 10 to 80 deg: extrapolated"]
    place = (
        ground_from_reflector(2.5, 45 * DEGREE).inverse().points(epoch(np.random.default_rng(1), 45 * DEGREE, 12.0, 0))
    )
    for i, name in enumerate(NAMES):
        off = np.array(told["points"][name]["place"][0]) - place[i]
        q = np.array(told["points"][name]["covariance"][0])
        assert off @ np.linalg.solve(q, off) < 16.3  # 99.9 % of three
    names = {"prediction.csv", "coefficients.csv", "residuals.csv", "structure.json", "report.html", "samplers.fits",
             "provenance.json"}  # fmt: skip
    assert {p.name for p in out.iterdir()} == names
    assert set(json.loads((out / "provenance.json").read_text())["outputs"]) == names - {"provenance.json"}
    tables = read_samplers(out / "samplers.fits")
    assert list(tables) == ["RESIDUALS", "COEFFICIENTS", "PREDICTION"]
    assert np.asarray(tables["RESIDUALS"].columns["RESIDUAL"].values).shape == (70, 3)
    rows = list(csv.DictReader((out / "residuals.csv").read_text().splitlines()))
    assert len(rows) == 70
    assert rows[0]["point"] == "ZEG1"
    report = read((out / "report.html").read_text())
    assert report["charts"].keys() >= {*(f"motion-{k}" for k in range(1, 7)), "residuals-by-point", "left-out"}
    assert "extrapolated" in texts(report)
    x = [place[0] for name in NAMES for place in told["points"][name]["place"]]
    assert sorted(column(report, "prediction", "x")) == pytest.approx(sorted(x), abs=0.51e-7)


def test_folders_alone_have_a_posture_and_no_temperature(catseye, nights):
    status, said, _ = catseye("structure", nights, "--points", "ZEG*", "--folds", 0)
    assert status == 0
    assert "No epoch says a temperature" in said
    status, alone, _ = catseye("structure", nights, "--points", "ZEG*", "--folds", 0, "--independent")
    assert status == 0
    assert "taken as independent" in alone
    # these covariances are diagonal: nothing else changes
    assert [line for line in alone.splitlines() if "cosE" in line] == [s for s in said.splitlines() if "cosE" in s]
    assert "cosE" in said
    assert "elevation 10.0 to 80.0" in said
    status, said, _ = catseye("structure", nights / "night-00", "--points", "ZEG*", "--json")
    assert status == 1
    assert said == ""


@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        ([], 2, "--points"),
        (["--points", "ZEG*"], 1, "no epoch found"),
        (["missing", "--points", "ZEG*"], 1, "missing: missing"),
        (["NIGHTS", "--points", "X*"], 1, "no epoch has a point 'X*' (they have ZEG1"),
        (["NIGHTS", "--points", "ZEG*", "--pivot", "1,2"], 2, "not x,y,z"),
        (["NIGHTS", "--points", "ZEG*", "--harmonics", "3"], 2, "--harmonics"),
        (["NIGHTS", "--points", "ZEG*", "--folds", "40"], 1, "40 stretches of 14"),
        (["NIGHTS", "--points", "ZEG*", "--out", "NIGHTS"], 1, "--out"),
        (["NIGHTS", "--points", "ZEG*", "--predict", "nan"], 1, "not a finite number"),
        (["--epochs", "NIGHTS/bad.csv", "--points", "ZEG*"], 1, "line 2, elevation_deg = '120'"),
        (["--epochs", "NIGHTS/none.csv", "--points", "ZEG*"], 1, "none.csv: No such file"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(catseye, nights, arguments, status, expected):
    (nights / "bad.csv").write_text("reduction,azimuth_deg,elevation_deg\nnight-00,1,120\n")
    given = [a.replace("NIGHTS", str(nights)) for a in arguments]
    found, said, err = catseye("structure", *given)
    assert (found, said) == (status, "")
    assert expected in err


@pytest.fixture
def journal(tmp_path):
    """Solutions at postures, weather, and two rangers' ranges to a shaking target."""
    rng, place = np.random.default_rng(9), str(tmp_path / "night.db")
    entries = []
    for k, e in enumerate(np.tile(np.linspace(15.0, 75.0, 8), 2)):
        ticks = START + k * 200_000
        entries.append(LiveWeather("WX1", ticks, 10.0 + k % 3, 930.0, 50.0))
        x = epoch(rng, e * DEGREE, 10.0 + k % 3)
        answer = {"number": k + 1, "names": list(NAMES), "x": x.tolist(), "azimuth": 2.5, "elevation": e * DEGREE}
        entries.append(EpochSolution(ticks + 10, answer, 2.5e-9 * np.eye(15)))
    for n in range(1600):
        for ranger, late, gain in (("ZY101", 0, 1.0), ("ZY102", 60, -0.7)):
            ticks = START + 10_000_000 + n * 148 + late
            t = (n * 148 + late) * 864e-6 + 0.064
            seen = 100.0 + gain * 6e-5 * np.cos(2 * np.pi * 1.2 * t) + 2e-5 * rng.standard_normal()
            shot = LiveShot(ranger, "ZEG1", ticks, 128, 64, 1000, 3e-4, None, 1.0, 0.0, 2 * n + late // 60)
            entries.append(AnsweredShot(shot, "used", "", seen, 2e-5, 0.0))
    with Journal.open(place, run=scene_run(), clock=ManualClock(START / 1e8)) as writing:
        for entry in entries:
            writing.append(entry)
    return place


def test_a_journals_solutions_are_epochs_with_the_weather_about_them(catseye, journal, tmp_path):
    out = tmp_path / "model"
    status, said, err = catseye(
        "structure", "--journal", journal, "--points", "ZEG*", "--pivot=0,-8,10", "--hysteresis", "--json", "--out", out
    )
    assert (status, err) == (0, "")
    found = json.loads(said)
    assert found["epochs"] == 16
    assert found["functions"] == ["1", "sinE", "cosE", "t", "up"]
    assert found["temperature_c"][0] >= 10.0
    assert any("build on each other" in note for note in found["notes"])
    cosine = found["coefficients"]["cosE"]
    assert np.all(np.abs(np.array(cosine["value"]) - SIX_COS) < 4.0 * np.array(cosine["u"]))
    assert read_samplers(out / "samplers.fits")["RESIDUALS"].mjd is not None
    status, said, _ = catseye("structure", "--journal", journal, "--points", "ZEG*", "--every-s", 300, "--json")
    assert json.loads(said)["epochs"] < 16 if status == 0 else False


def test_ranges_at_full_rate_show_the_planted_vibration(catseye, journal, tmp_path):
    out = tmp_path / "shaking"
    status, said, err = catseye("structure", "--vibration", journal, "--points", "ZEG1", "--json", "--out", out)
    assert (status, err) == (0, "")
    found = json.loads(said)
    assert set(found["series"]) == {"ZY101:ZEG1", "ZY102:ZEG1"}
    assert found["series"]["ZY101:ZEG1"]["rate_hz"] == pytest.approx(1.0 / (148 * 864e-6), rel=1e-6)
    top = found["peaks"][0]
    assert top["likely_hz"] == pytest.approx(1.2, abs=0.01)
    assert top["decided"]
    assert top["shape"]["ZY102:ZEG1"]["size"] == pytest.approx(0.7, abs=0.05)
    assert abs(top["shape"]["ZY102:ZEG1"]["phase"]) > 3.0
    assert found["modes"][0]["frequency_hz"] == pytest.approx(1.2, abs=0.005)
    tables = read_samplers(out / "samplers.fits")
    assert list(tables) == ["SPECTRA", "RANGES"]
    assert len(np.asarray(tables["RANGES"].mjd)) == 3200
    report = read((out / "report.html").read_text())
    assert report["drawings"]["spectra"].startswith("<?xml")
    assert column(report, "peaks", "true")[0] == pytest.approx(top["likely_hz"], abs=1e-5)
    status, said, _ = catseye("structure", "--vibration", journal, "--points", "ZEG1")
    assert status == 0
    assert "1.2" in said
    assert "half the rate" in said
    status, _, err = catseye("structure", "--vibration", journal, "--points", "NOWHERE")
    assert status == 1
    assert "no target NOWHERE" in err


@pytest.mark.parametrize("word", ["doubtful", "failed"])
def test_a_model_is_no_better_than_the_worst_of_its_epochs(catseye, nights, word):
    told = ["structure", "--epochs", nights / "epochs.csv", "--points", "ZEG*", "--json"]
    assert json.loads(catseye(*told)[1])["verdict"]["word"] == "good"
    place = nights / "night-05" / "coordinates.json"
    document = json.loads(place.read_text()) | {"verdict": {"word": word, "why": "the night was foggy"}}
    place.write_text(json.dumps(document))
    found = json.loads(catseye(*told)[1])["verdict"]
    assert found["word"] == word
    assert "night-05" in found["why"]
    assert catseye(*told, "--strict")[0] == 1


def test_notes_that_claims_are_too_small_make_a_model_doubtful(catseye, nights):
    told = ["structure", "--epochs", nights / "epochs.csv", "--points", "ZEG*", "--json"]
    alone = json.loads(catseye(*told, "--independent")[1])
    assert alone["verdict"]["word"] == "doubtful"
    assert alone["verdict"]["why"] == alone["notes"][0].rstrip(".")
    far = json.loads(catseye(*told, "--predict", 88)[1])
    assert far["verdict"]["word"] == "doubtful"
    assert "extrapolated" in far["verdict"]["why"]
