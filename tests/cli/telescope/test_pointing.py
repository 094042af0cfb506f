"""`catseye pointing` as a new user meets it: the example's stars, the published series, poses and inclinometers."""

import json
import tomllib

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.antenna.pointing_series import published
from gateways.report_scene import column, read
from repository import ROOT

EXAMPLES = ROOT / "examples" / "pointing"
STARS, TILTS = EXAMPLES / "stars.dat", EXAMPLES / "tilts.csv"


def test_the_example_gives_the_published_terms_within_their_covariance(catseye):
    status, said, complained = catseye("pointing", "fit", STARS, "--against", "published", "--json")
    assert (status, complained) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["observations"] == 72
    assert found["comparison"]["p"] > 0.01
    assert found["sky_rms_arcsec"] == pytest.approx(7.35, abs=4 * 7.35 / 272**0.5)  # 5.2 in each of two
    assert [set(w["parts"]) for w in found["weak"]] == [{"IA", "CA", "NPAE"}, {"IE", "HZCZ", "HZSZ"}]
    assert np.array(found["covariance_arcsec2"]).shape == (8, 8)


def test_a_report_a_model_and_the_stars_used_are_written(catseye, tmp_path):
    model, used, out = tmp_path / "m.toml", tmp_path / "used.dat", tmp_path / "out"
    status, said, _ = catseye(
        "pointing", "fit", STARS, "--reject", "--out", out, "--write", model, "--write-stars", used
    )
    assert status == 0
    assert "arcsec; over" in said
    files = "observations.csv pointing.json pointing.toml provenance.json report.html samplers.fits"
    assert sorted(p.name for p in out.iterdir()) == files.split()
    report = read((out / "report.html").read_text())
    told = json.loads(catseye("pointing", "fit", used, "--json")[1])
    first = json.loads((out / "pointing.json").read_text())
    assert column(report, "terms", "value") == pytest.approx(list(first["values_arcsec"].values()), abs=6e-5)
    assert len(report["charts"]) == 6
    assert [column(report, "correlations", f"r_{k + 1}")[k] for k in range(8)] == [1] * 8
    for term, value in first["values_arcsec"].items():  # files carry 1e-7 degrees
        assert told["values_arcsec"][term] == pytest.approx(value, abs=0.01)
    assert tomllib.loads(model.read_text())["terms"] == first["terms"]
    status, said, _ = catseye("pointing", "fit", used, "--against", model, "--json")
    assert json.loads(said)["comparison"]["rms_on_the_sky_arcsec"] < 1e-3


def test_predictions_of_the_published_series_and_of_a_model(catseye, tmp_path):
    status, said, _ = catseye("pointing", "predict", "--azimuth-deg", "145.3", "--elevation-deg", "30", "--json")
    found = json.loads(said)
    assert status == 0
    np.testing.assert_allclose(found["correction"], published().correction(145.3 * DEGREE, 30 * DEGREE), rtol=1e-12)
    assert found["covariance"] is None
    model = tmp_path / "m.toml"
    catseye("pointing", "fit", STARS, "--write", model, "--quiet")
    status, said, _ = catseye("pointing", "predict", "--azimuth-deg", "0", "--elevation-deg", "45", "--model", model)
    assert "u 0." in said or "u 1." in said


def pose_file(folder, azimuth_deg, **more):
    folder.mkdir()
    made = {"format": "catseye-pose-1", "posture": {"azimuth_deg": azimuth_deg, "elevation_deg": 45.0}, **more}
    (folder / "pose.json").write_text(json.dumps(made))
    return folder / "pose.json"


def test_metrology_from_poses_is_fitted_and_compared_with_the_stars(catseye, tmp_path):
    rng, files, q = np.random.default_rng(5), [], np.diag([1.0, 1.0, 1.0]) * (0.5 * ARCSECOND) ** 2
    for k in range(40):
        azimuth, elevation = rng.uniform(0, 360), rng.uniform(15, 80)
        value = published().correction(azimuth * DEGREE, elevation * DEGREE) + rng.normal(size=2) * 0.5 * ARCSECOND
        told = {"correction": [*value, 0.0], "covariance": q.tolist()}
        posture = {"azimuth_deg": azimuth, "elevation_deg": elevation}
        files.append(pose_file(tmp_path / f"p{k}", 0.0, pointing=told))
        files[-1].write_text(json.dumps({"format": "catseye-pose-1", "posture": posture, "pointing": told}))
    status, said, complained = catseye("pointing", "fit", *files, "--against", STARS, "--json")
    assert (status, complained) == (0, "")
    found = json.loads(said)
    assert found["source"] == "metrology"
    assert not found["scaled_by_variance_factor"]
    assert found["comparison"]["p"] > 0.01


def test_the_track_under_an_inclinometer_and_poses(catseye, tmp_path):
    q = np.diag([1e-8] * 3 + [(0.6 * ARCSECOND) ** 2] * 3).tolist()
    files = []
    for azimuth in range(0, 360, 45):
        a = azimuth * DEGREE
        east = 2.96 - 1.2 * np.cos(3 * a) + 0.8 * np.sin(2 * a)
        north = 2.18 + 0.9 * np.cos(2 * a) + 1.5 * np.sin(3 * a)
        turn = np.array([np.cos(a) * east - np.sin(a) * north, np.sin(a) * east + np.cos(a) * north, 0]) * ARCSECOND
        files.append(pose_file(tmp_path / f"{azimuth}", azimuth, frame="alidade", rotation=turn.tolist(), covariance=q))
    out = tmp_path / "out"
    told = ["pointing", "track", *files, "--tilts", TILTS, "--harmonics", "3"]
    status, said, _ = catseye(*told, "--out", out)
    assert status == 0
    assert "leans north, west" in said
    assert sorted(p.name for p in out.iterdir()) == [
        "provenance.json",
        "report.html",
        "samplers.fits",
        "tilt.csv",
        "track.json",
    ]
    found = json.loads((out / "track.json").read_text())
    for name, wanted in (("cos 3A east", -1.2), ("sin 3A north", 1.5), ("sin 2A east", 0.8), ("mean north", 2.18)):
        off = found["coefficients"][name] / ARCSECOND - wanted
        assert abs(off) < 4 * found["u_coefficients"][name] / ARCSECOND
    assert found["p"] > 1e-3


def test_the_shipped_inclinometer_alone_gives_all_waves_but_the_first(catseye, tmp_path):
    """Planted: mean 2.96 and 2.18, cos 3A -1.2 east, sin 3A 1.5 north, cos 2A 0.9 north, sin 2A 0.8 east."""
    told = ("pointing", "track", "--tilts", TILTS, "--harmonics", "3")
    status, said, complained = catseye(*told, "--json")
    assert (status, complained) == (0, "")
    found = json.loads(said)
    assert found["verdict"]["word"] == "good"
    assert "an inclinometer alone cannot separate from its zero" in found["verdict"]["why"]
    lost = [f"{f} 1A {axis}" for f in ("cos", "sin") for axis in ("east", "north")]
    assert found["undetermined"] == lost
    assert found["inclinometer_zero"] is None
    for k, (name, value) in enumerate(found["coefficients"].items()):
        assert (value is None) == (name in lost)
        assert (found["covariance"][k][k] is None) == (name in lost)
    planted = {"mean east": 2.96, "mean north": 2.18, "cos 3A east": -1.2, "sin 3A north": 1.5, "cos 2A north": 0.9,
               "sin 2A east": 0.8}  # fmt: skip
    for name in set(found["coefficients"]) - set(lost):
        off = found["coefficients"][name] / ARCSECOND - planted.get(name, 0.0)
        assert abs(off) < 4 * found["u_coefficients"][name] / ARCSECOND
    out = tmp_path / "out"
    assert catseye(*told, "--out", out)[0] == 0
    assert (out / "tilt.csv").read_text().startswith("azimuth_deg,tilt_east_without_wave_1_arcsec,")
    report = read((out / "report.html").read_text())
    values = dict(
        zip(column(report, "coefficients", "coefficient"), column(report, "coefficients", "value"), strict=True)
    )
    assert [name for name, value in values.items() if value is None] == lost
    assert report["charts"].keys() == {"tilt", "residual-x", "residual-y"}
    assert "AN -2.9" in " ".join(catseye(*told)[1].split())


@pytest.mark.parametrize(
    ("told", "status", "said"),
    [
        (["fit", "nowhere.dat"], 1, "nowhere.dat"),
        (["fit", STARS, "--terms", "IA,XX"], 2, "is not a selection"),
        (["fit", STARS, "--u-arcsec", "0"], 2, "not above zero"),
        (["fit", STARS, "--write", STARS], 1, "is an input"),
        (["fit", STARS, STARS], 1, "second file"),
        (["fit", TILTS], 1, "tilts.csv"),
        (["predict", "--azimuth-deg", "0", "--elevation-deg", "90"], 2, "degrees"),
        (["predict", "--azimuth-deg", "0", "--elevation-deg", "45", "--model", "none.toml"], 1, "none.toml"),
        (["track"], 2, "needs poses"),
        (["track", STARS], 1, "is not JSON"),
    ],
)
def test_what_cannot_be_done_is_said(catseye, told, status, said):
    found, _, complained = catseye("pointing", *told)
    assert found == status
    assert said in complained


def rows_of(path):
    """The observations of a TPOINT file, by hand."""
    lines = [line for line in path.read_text().splitlines() if line and line[0] not in "!:"]
    return np.array([[float(word) for word in line.split()[:4]] for line in lines[2:] if line != "END"])


def written(path, rows, run="38 25 59.2"):
    text = "\n".join(" ".join(f"{v:.7f}" for v in row) for row in rows)
    path.write_text("\n".join(line for line in ("made", ": ALTAZ", run, text, "END") if line) + "\n")
    return path


def test_zenith_distances_for_elevations_are_doubtful_and_named_with_what_elevations_leave(catseye, tmp_path):
    rows = rows_of(STARS)
    status, said, _ = catseye(
        "pointing", "fit", written(tmp_path / "zd.dat", rows * [1, -1, 1, -1] + [0, 90, 0, 90]), "--json"
    )
    found = json.loads(said)
    assert status == 0
    assert found["verdict"]["word"] == "doubtful"
    a, e = rows[:, 0] * DEGREE, rows[:, 1] * DEGREE  # numpy's own least squares of the right table
    across = (rows[:, 2] - rows[:, 0] + 180) % 360 - 180
    right = np.column_stack([across * np.cos(e), rows[:, 3] - rows[:, 1]])
    s, c, z = np.sin, np.cos, np.zeros_like(a)
    one = np.ones_like(a)
    x = np.column_stack([c(e), z, one, s(e), c(a) * s(e), s(a) * s(e), z, z])
    y = np.column_stack([z, -one, z, z, -s(a), c(a), s(e), c(e)])
    both, observed = np.concatenate([x, y]), right.T.ravel() * 3600
    left = observed - both @ np.linalg.lstsq(both, observed, rcond=None)[0]
    rms = np.sqrt(np.sum(left**2) / len(rows))
    assert f"elevations are zenith distances ({rms:.2f} arc seconds rms)" in found["verdict"]["why"]
    assert catseye("pointing", "fit", tmp_path / "zd.dat", "--strict", "--quiet")[0] == 1


def test_without_the_latitude_line_no_star_is_taken_for_it(catseye, tmp_path):
    for rows in (rows_of(STARS), np.round(rows_of(STARS))):  # whole degrees read as a latitude, too
        status, said, complained = catseye("pointing", "fit", written(tmp_path / "n.dat", rows, run=""))
        assert (status, said) == (1, "")
        assert "line 3" in complained
        assert "the line with the latitude is missing" in complained
    one = written(tmp_path / "f.dat", rows_of(STARS), run="38.5 25.5 59.2")
    assert "expected whole degrees, minutes" in catseye("pointing", "fit", one)[2]


def test_residuals_beyond_a_tenth_of_the_widest_beam_are_doubtful(catseye, tmp_path):
    rows = rows_of(STARS)
    noise = np.random.default_rng(2).normal(0, 60 / 3600, (len(rows), 2))
    rows[:, 2:] += noise / np.column_stack([np.cos(rows[:, 1] * DEGREE), np.ones(len(rows))])
    found = json.loads(catseye("pointing", "fit", written(tmp_path / "n.dat", rows), "--json")[1])
    assert found["verdict"]["word"] == "doubtful"
    assert "beyond 65, a tenth of the beam" in found["verdict"]["why"]


@pytest.mark.parametrize(("u", "word"), [("5.2", "good"), ("0.05", "doubtful"), ("500", "doubtful")])
def test_a_stated_uncertainty_is_held_against_the_scatter_on_both_sides(catseye, u, word):
    found = json.loads(catseye("pointing", "fit", STARS, "--u-arcsec", u, "--json")[1])
    assert found["verdict"]["word"] == word
    assert ("less than claimed" in found["verdict"]["why"]) == (u == "500")


def test_a_model_from_a_doubtful_fit_makes_predictions_and_comparisons_doubtful(catseye, tmp_path):
    model = tmp_path / "m.toml"
    catseye("pointing", "fit", STARS, "--u-arcsec", "500", "--write", model, "--quiet")
    told = ["pointing", "predict", "--azimuth-deg", "0", "--elevation-deg", "45", "--model", model]
    assert json.loads(catseye(*told, "--json")[1])["verdict"]["word"] == "doubtful"
    assert "Doubtful: it rests on" in catseye(*told)[1]
    found = json.loads(catseye("pointing", "fit", STARS, "--against", model, "--json")[1])
    assert found["verdict"]["word"] == "doubtful"


@pytest.mark.parametrize("word", ["doubtful", "failed"])
def test_poses_that_are_not_good_make_a_series_and_a_track_no_better(catseye, tmp_path, word):
    judged, q = {"word": word, "why": "the night was foggy"}, np.diag([1e-12] * 3).tolist()
    rng, files, tilts = np.random.default_rng(5), [], []
    for k in range(12):
        a, e = 30.0 * k, float(rng.uniform(20, 70))
        value = published().correction(a * DEGREE, e * DEGREE) + rng.normal(size=2) * 1e-6
        files.append(pose_file(tmp_path / f"p{k}", a, pointing={"correction": [*value, 0.0], "covariance": q}))
        stored = json.loads(files[-1].read_text())
        stored["posture"]["elevation_deg"] = e
        files[-1].write_text(json.dumps(stored | ({"verdict": judged} if k == 3 else {})))
        turn = {"frame": "alidade", "rotation": [*(rng.normal(size=2) * 1e-6), 0.0], "covariance": np.eye(6).tolist()}
        tilts.append(pose_file(tmp_path / f"t{k}", a, **turn, **({"verdict": judged} if k == 3 else {})))
    for told in (["fit", *files], ["track", *tilts]):
        found = json.loads(catseye("pointing", *told, "--json")[1])
        assert found["verdict"]["word"] == word
        assert "the night was foggy" in found["verdict"]["why"]
