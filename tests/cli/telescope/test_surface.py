"""`catseye surface` as programs call it: keys, statuses, files whole or not at all."""

import csv
import json

import numpy as np
import pytest

from catseye.optics.zernike import Term
from catseye.records.files.reading import Folder
from catseye.records.panels.actuators import ActuatorCorrection
from kept_scene import reduction_directory
from surface_scene import NAMES, half_path_of, prisms

ROWS = np.arange(0, len(NAMES), 12)


@pytest.fixture
def catseye(catseye):
    """The command `surface`."""
    return lambda *arguments: catseye("surface", *arguments)


def table(path, half, seed, rows=ROWS):
    """A CSV of prisms in the reflector frame."""
    made = prisms(half, u=3e-5, seed=seed, rows=rows)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["point", "x_m", "y_m", "z_m", "u_mm"])
        writer.writerows([name, *point, 0.03] for name, point in zip(made.names, made.points.tolist(), strict=True))
    return path


def of(found, number):
    return next(t for t in found["zernike"]["terms"] if t["number"] == number)


def test_one_epoch_with_everything(catseye, tmp_path):
    source, out, fits = tmp_path / "p.csv", tmp_path / "out", tmp_path / "a.fits"
    table(source, half_path_of(Term(2, 2), 3e-4), 1)
    status, said, complaint = catseye(
        source, "--free", "vertex,focal-length", "--taper-db", 13, "--frequency-ghz", 86, "--frequency-ghz", 115,
        "--zernike", 21, "--order", "ansi", "--actuators", fits, "--out", out, "--json",
    )  # fmt: skip
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["free"] == ["vertex", "focal-length"]
    assert of(found, 5)["value"] == pytest.approx(3e-4, abs=3e-5)
    assert of(found, 5)["name"] == "astigmatism 0°"
    assert [g["frequency"] for g in found["gain"]] == [86e9, 115e9]
    assert 0.0 < found["gain"][1]["gain"] < found["gain"][0]["gain"] < 1.0
    assert found["actuators"]["actuators"] == 2209
    assert len(found["deviations"]) == len(ROWS)
    files = "actuators.csv prisms.csv provenance.json report.html samplers.fits surface.json zernike.csv"
    assert sorted(p.name for p in out.iterdir()) == files.split()
    assert json.loads((out / "surface.json").read_text()) == found
    rows = Folder(out).table("actuators.csv", ActuatorCorrection)
    assert len(rows) == 2209
    from astropy.io import fits as pyfits

    with pyfits.open(fits, checksum=True) as pages:
        data = pages["ACTUATORS"].data
        assert data["CORRECTION"].tolist() == [row.correction_mm for row in rows]
        assert pages["ACTUATORS"].columns["CORRECTION"].unit == "mm"
        assert data["ACTUATOR"][5] == rows[5].actuator
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.fits", "out", "p.csv"]


def test_two_epochs_are_a_change(catseye, tmp_path):
    one, two = (
        table(tmp_path / "1.csv", np.zeros(2209), 1),
        table(tmp_path / "2.csv", half_path_of(Term(2, -2), 3e-4), 2),
    )
    status, said, complaint = catseye(one, two, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said)
    assert of(found["change"], 5)["value"] == pytest.approx(3e-4, abs=3e-5)
    assert of(found["change"], 5)["joint"] is None
    assert [e["source"] for e in found["epochs"]] == [str(one), str(two)]
    status, said, _ = catseye(one, two)
    assert status == 0
    for word in ("Change", "Motion", "Half path", "astigmatism 45°"):
        assert word in said


def test_an_elevation_series_gives_gravity_and_hysteresis(catseye, tmp_path):
    elevations = [10, 35, 60, 85, 60, 35, 10]
    paths = []
    for k, e in enumerate(elevations):
        way = 0.5 if k <= 3 else -0.5
        size = 1e-4 + 2e-4 * np.sin(np.radians(e)) - 1e-4 * np.cos(np.radians(e)) + 6e-5 * way
        paths.append(table(tmp_path / f"{k}.csv", half_path_of(Term(2, 2), size), k, np.arange(0, 2209, 30)))
    angles = [word for e in elevations for word in ("--elevation-deg", e)]
    out = tmp_path / "out"
    status, said, complaint = catseye(*paths, *angles, "--free", "vertex", "--out", out, "--json")
    assert (status, complaint) == (0, "")
    lookup = json.loads(said)["lookup"]
    assert lookup["columns"] == ["constant", "gravity_sin", "gravity_cos", "hysteresis"]
    assert set(lookup["left_out"]) == {"thermal"}
    term = next(t for t in lookup["terms"] if t["number"] == 6)
    for key, true in (("gravity_sin", 2e-4), ("gravity_cos", -1e-4), ("hysteresis", 6e-5)):
        assert term[key] == pytest.approx(true, abs=max(4 * term[f"u_{key}"], 1e-5))
    with (out / "lookup.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["number"] == "6"]
    assert [float(row["elevation_deg"]) for row in rows] == list(range(10, 90, 5))
    assert all(float(row["rising_mm"]) > float(row["falling_mm"]) for row in rows)
    assert float(rows[7]["mean_mm"]) == pytest.approx(0.1 + 0.2 * np.sin(np.pi / 4) - 0.1 * np.cos(np.pi / 4), abs=0.03)


def test_a_reductions_directory_gives_its_dish_with_full_covariance(catseye, tmp_path, reduced_night_01):
    directory = reduction_directory()
    status, said, complaint = catseye(directory, "--free", "vertex,axis", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said)
    mine = reduced_night_01.surface
    assert set(found["deviations"]) == set(mine.names)
    assert found["elevation_deg"] == reduced_night_01.campaign.site.campaign.elevation_deg
    # weighted by half paths and the aperture's area, so not the same fit, but of one dish
    off = np.array(found["paraboloid"]["translation"]) - mine.fit.translation
    assert np.abs(off).max() < 2e-3
    status, said, _ = catseye(directory / "surface.csv", "--json", "--free", "none")
    assert status == 0
    again = json.loads(said)["deviations"]
    ours = dict(zip(mine.names, mine.fit.deviation, strict=True))
    assert max(abs(again[name]["deviation"] - ours[name]) for name in ours) < 1e-7  # as the table rounds
    status, _, complaint = catseye(directory, "--elevation-deg", 11)
    assert status == 1
    assert "was measured at elevation" in complaint


@pytest.mark.parametrize(
    ("change", "arguments", "said"),
    [
        (("u_mm", "v_mm"), (), "column"),
        ((",0.03", ",0"), (), "expected above 0 to 100 mm"),
        (("DP01C,0.0,", "DP01C,x,"), (), "expected a finite number"),
        (("DP01C,0.0,", "DP01C,0.0,1.0,"), (), "6 fields"),
        (("DP01C,0.0,", "DP01C,4000,"), (), "looks like mm"),
        ((), ("--frame", "ground"), "give the telescope's azimuth_deg and elevation_deg"),
        ((), ("--elevation-deg", 10, "--elevation-deg", 20), "elevation_deg has 2 values for 1 epochs"),
        ((), ("--actuators", "a.txt"), "expected .csv or .fits"),
        ((), ("--positions", "p.csv"), "goes with actuators only"),
        ((), ("--zernike", 400), "400 Zernike terms"),
        ((), ("--site", "nowhere"), "nowhere"),
    ],
)
def test_what_cannot_be_done_is_1_in_one_line_and_leaves_nothing(catseye, tmp_path, change, arguments, said):
    source = table(tmp_path / "p.csv", np.zeros(2209), 1)
    if change:
        lines = source.read_text().splitlines()
        lines[1] = "DP01C,0.0,4.0,0.066667,0.03"
        source.write_text("\n".join(lines).replace(*change) + "\n")
    out = tmp_path / "out"
    status, answer, complaint = catseye(source, *arguments, "--out", out, "--json")
    assert (status, answer) == (1, "")
    assert said in complaint
    assert complaint.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p.csv"]


@pytest.mark.parametrize(
    "arguments",
    [("--free", "focus"), ("--taper-db", -1), ("--order", "fringe"), ("--frequency-ghz", 0), ("--zernike", 0)],
)
def test_wrong_usage_is_2(catseye, tmp_path, arguments):
    assert catseye(tmp_path / "p.csv", *arguments)[0] == 2


def test_an_epoch_without_elevation_makes_no_table(catseye, tmp_path):
    paths = [table(tmp_path / f"{k}.csv", np.zeros(2209), k, np.arange(0, 2209, 60)) for k in range(3)]
    status, _, complaint = catseye(*paths)
    assert status == 1
    assert "unknown elevation; set it by elevation_deg" in complaint


def test_another_programs_file_is_not_overwritten(catseye, tmp_path):
    source = table(tmp_path / "p.csv", np.zeros(2209), 1, np.arange(0, 2209, 60))
    for name in ("a.csv", "a.fits"):
        (tmp_path / name).write_text("mine")
        status, _, complaint = catseye(source, "--actuators", tmp_path / name)
        assert status == 1
        assert "exists and is not a catseye file" in complaint
        assert (tmp_path / name).read_text() == "mine"


@pytest.mark.parametrize("word", ["doubtful", "failed"])
def test_a_surface_and_a_pose_are_no_better_than_their_reduction(catseye, tmp_path, word):
    for source in reduction_directory().iterdir():
        (tmp_path / source.name).write_bytes(source.read_bytes())
    place = tmp_path / "coordinates.json"
    document = json.loads(place.read_text()) | {"verdict": {"word": word, "why": "the night was foggy"}}
    place.write_text(json.dumps(document))
    for source in (tmp_path, tmp_path / "surface.csv"):
        found = json.loads(catseye(source, "--json", "--free", "vertex,axis", "--zernike", "6")[1])["verdict"]
        assert found["word"] == word
        assert "the night was foggy" in found["why"]
