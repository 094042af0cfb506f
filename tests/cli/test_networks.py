"""adjust and plan as programs call them: keys, statuses, streams; every way a network can be bad ends in one line."""

import json

import numpy as np
import pytest

from repository import ROOT

EXAMPLES = ROOT / "examples" / "networks"
VECTORS = ROOT / "tests" / "vectors" / "networks"
KEYS = {"points", "variance_factor", "degrees_of_freedom", "observations", "suspects", "status"}


@pytest.fixture
def answered(catseye):
    """The JSON object of a command that must succeed without a word on stderr."""

    def run(*arguments):
        status, out, err = catseye(*arguments, "--json")
        assert (status, err) == (0, "")
        return json.loads(out, parse_constant=pytest.fail)

    return run


def folder(path, points, ranges):
    path.mkdir()
    (path / "points.csv").write_text("point,x,y,z,role\n" + "".join(f"{p}\n" for p in points))
    (path / "ranges.csv").write_text("from,to,distance,sigma\n" + "".join(f"{r}\n" for r in ranges))
    return path


def ring(stations=6, targets=5, role="datum", seed=0, flat=False):
    """Lines of points.csv and ranges.csv of a small network, and its true coordinates."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(stations) / stations
    high = 0.0 if flat else 1.0
    s = np.stack([50 * np.cos(angle), 50 * np.sin(angle), high * rng.uniform(-5, 5, stations)], axis=1)
    t = np.concatenate([rng.uniform(-20, 20, (targets, 2)), high * rng.uniform(15, 40, (targets, 1))], axis=1)
    rows = [(f"S{i}", f"T{j}", float(np.linalg.norm(t[j] - s[i]))) for i in range(stations) for j in range(targets)]
    points = [f"S{i},{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},{role}" for i, p in enumerate(s)]
    points += [f"T{j},{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},free" for j, p in enumerate(t)]
    return points, [f"{a},{b},{d + 5e-5 * rng.standard_normal():.6f},0.00005" for a, b, d in rows]


@pytest.mark.parametrize("name", ["feed-arm.toml", "ground-ring", "total-station.gkf", "total-station.dat"])
def test_every_kind_of_file_gives_the_contracts_keys(answered, name):
    found = answered("adjust", EXAMPLES / name)
    assert set(found) >= KEYS
    assert found["status"] == "converged"
    for point in found["points"].values():
        assert set(point) >= {"x", "y", "z", "covariance"}
        assert np.shape(point["covariance"]) == (3, 3)
    for row in found["observations"]:
        assert set(row) >= {"kind", "from", "to", "residual", "standardised", "redundancy", "mdb"}
    assert found["degrees_of_freedom"] == int(found["degrees_of_freedom"])
    assert sum(row["redundancy"] for row in found["observations"]) == pytest.approx(
        found["degrees_of_freedom"], abs=len(found["observations"]) * 0.5
    )


def test_coordinates_come_in_the_files_own_axes(answered):
    found = answered("adjust", VECTORS / "monitoring" / "phase-0-1TK.gkf")
    point = found["points"]["201"]
    assert (point["x"], point["y"], point["z"]) == pytest.approx((1051.1594073, 4999.0899316, 103.0811801), abs=1e-6)
    assert np.sqrt(np.diag(point["covariance"])) == pytest.approx([0.683224e-3, 0.142602e-3, 0.160621e-3], rel=3e-4)


def test_standard_deviations_are_a_priori_unless_asked(answered):
    file = VECTORS / "baumann3d" / "network.gkf"
    plain, scaled = answered("adjust", file), answered("adjust", file, "--scale-by-variance-factor")
    ratio = np.array(scaled["points"]["N"]["covariance"]) / np.array(plain["points"]["N"]["covariance"])
    assert ratio == pytest.approx(np.full((3, 3), plain["variance_factor"]), rel=1e-9)
    assert np.sqrt(np.diag(scaled["points"]["N"]["covariance"])) == pytest.approx(
        [3.476442e-3, 3.958498e-3, 5.264109e-3], rel=3e-4
    )


def test_the_datum_can_be_chosen(answered, tmp_path):
    points, ranges = ring(role="fixed")
    network = folder(tmp_path / "n", points, ranges)
    held, free = answered("adjust", network), answered("adjust", network, "--datum", "free")
    assert np.count_nonzero(held["points"]["S0"]["covariance"]) == 0
    assert np.count_nonzero(free["points"]["S0"]["covariance"]) == 9
    assert held["degrees_of_freedom"] == 30 - 15
    assert free["degrees_of_freedom"] == 30 - 33 + 6
    marked = folder(tmp_path / "m", ring(role="datum")[0], ranges)
    assert answered("adjust", marked, "--datum", "fixed")["points"] == held["points"]


def test_a_blunder_is_named_and_not_removed_unless_asked(answered, tmp_path):
    points, ranges = ring(stations=8)
    a, b, d, sigma = ranges[13].split(",")
    ranges[13] = f"{a},{b},{float(d) + 0.003:.6f},{sigma}"
    network = folder(tmp_path / "n", points, ranges)
    plain = answered("adjust", network)
    assert plain["suspects"][0] == 13
    assert plain["observations"][13]["active"] is True
    assert plain["status"].startswith("converged, but the observations contradict each other")
    assert f"{a} - {b}, line 15" in plain["status"]
    assert plain["observations"][13]["estimated_error"] == pytest.approx(0.003, abs=3e-4)
    without = answered("adjust", network, "--reject")
    assert without["observations"][13]["active"] is False
    assert [k for k, row in enumerate(without["observations"]) if not row["active"]] == [13]
    assert without["variance_factor"] < 3.0
    assert without["status"] == "converged"
    weighed = answered("adjust", network, "--robust", "igg3")
    assert weighed["variance_factor"] < 3.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p, r: (p, [line for line in r if line.split(",")[1] != "T2" or line[:2] in ("S0", "S1")]),
         "T2 (2 observations) floats"),
        (lambda p, r: ([line.replace("datum", "free") for line in p], r), "the network floats"),
        (lambda p, r: ([*p, p[0]], r), "S0"),
        (lambda p, r: (p, [*r[:3], r[3].replace("0.00005", "0"), *r[4:]]), "line 5"),
        (lambda p, r: (p, [*r[:3], r[3].replace("S0", "SX"), *r[4:]]), "SX"),
        (lambda p, r: (p, [*r[:3], r[3].replace("T3", "S0"), *r[4:]]), "line 5"),
        (lambda p, r: ([*p, "A,0,0,0,free", "B,9,0,3,free"], [*r, "A,B,9.4,0.001"]), "in 2 pieces"),
        (lambda p, r: (ring(flat=True)[0], ring(flat=True)[1]), "rank deficient"),
    ],
    ids=["two-ranges", "no-datum", "duplicate", "zero-sigma", "stranger", "to-itself", "pieces", "flat"],
)  # fmt: skip
def test_a_bad_network_ends_in_one_line_that_says_what_and_where(catseye, tmp_path, change, words):
    network = folder(tmp_path / "n", *change(*ring()))
    status, _, err = catseye("adjust", network, "--out", tmp_path / "out")
    assert status == 1
    assert err.count("\n") == 1
    assert words in err
    assert [path.name for path in tmp_path.iterdir()] == ["n"]


def test_files_that_are_not_there_or_of_no_kind_are_named(catseye, tmp_path):
    status, out, err = catseye("adjust", tmp_path / "nowhere.toml")
    assert (status, out) == (1, "")
    assert "nowhere.toml: missing" in err
    (tmp_path / "network.txt").write_text("x")
    status, out, err = catseye("adjust", tmp_path / "network.txt")
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert catseye("adjust", tmp_path / "x.gkf", "--datum", "loose")[0] == 2
    assert catseye("plan", tmp_path / "x.gkf", "--budget-s", "-1")[0] == 2


def test_the_output_directory_holds_what_the_json_says(answered, tmp_path):
    out = tmp_path / "out"
    found = answered("adjust", EXAMPLES / "feed-arm.toml", "--out", out)
    assert {path.name for path in out.iterdir()} >= {
        "report.html", "coordinates.csv", "observations.csv", "adjustment.json", "adjustment.xml", "provenance.json",
    }  # fmt: skip
    assert json.loads((out / "adjustment.json").read_text())["points"] == found["points"]
    answered("plan", EXAMPLES / "feed-arm.toml", "--out", out)
    assert {path.name for path in out.iterdir()} == {
        "report.html", "points.csv", "candidates.csv", "plan.json", "provenance.json",
    }  # fmt: skip
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_two_epochs_are_compared(answered, catseye, tmp_path):
    points, ranges = ring(stations=8, targets=8)
    first = folder(tmp_path / "first", points, ranges)
    later = []
    xyz = {line.split(",")[0]: np.array([float(v) for v in line.split(",")[1:4]]) for line in points}
    moved = xyz["T3"] + [0.0, 0.002, 0.0]
    for k, line in enumerate(ranges):
        a, b, d, sigma = line.split(",")
        shift = np.linalg.norm(moved - xyz[a]) - np.linalg.norm(xyz["T3"] - xyz[a]) if b == "T3" else 0.0
        later.append(f"{a},{b},{float(d) + shift + 3e-5 * np.sin(k):.6f},{sigma}")
    second = folder(tmp_path / "second", points, later)
    found = answered("adjust", first, second)
    assert found["moved"] == ["T3"]
    assert found["points"]["T3"]["displacement"] == pytest.approx([0.0, 0.002, 0.0], abs=4e-4)
    assert catseye("adjust", first, "--points", "T3")[0] == 2


def test_a_plan_says_what_a_network_is_worth_and_what_to_measure_next(answered, tmp_path):
    found = answered("plan", EXAMPLES / "feed-arm.toml", "--budget-s", "20", "--shot-s", "5", "--runs", "5")
    assert set(found) >= KEYS | {"mean_u", "weakest", "candidates", "best_next", "schedule", "monte_carlo"}
    assert found["status"] == "planned"
    assert found["best_next"] == found["candidates"][0]
    assert found["best_next"]["mean_u"] < found["mean_u"]
    assert max(step["at_s"] for step in found["schedule"]) <= 20.0
    assert found["monte_carlo"]["runs"] == 5
    test = found["monte_carlo"]["covariance"]
    assert (test["combinations"], test["degrees_of_freedom"]) == (66, 66 * 67 // 2)
    assert test["agrees"] == (min(test["p"], test["p_size"]) >= 1e-3)
    assert 0.0 < test["largest"] < test["by_chance"]
    assert all(row["residual"] is None and row["mdb"] > 0.0 for row in found["observations"])
    aimed = answered("plan", EXAMPLES / "feed-arm.toml", "--interest", "ZY113")
    assert aimed["interest"] == ["ZY113"]


def test_a_plan_says_whether_its_runs_scatter_as_their_covariance_claims(catseye, tmp_path):
    options = ["plan", EXAMPLES / "feed-arm.toml", "--runs", "300"]
    status, said, complaint = catseye(*options, "--processes", "1", "--out", tmp_path / "report")
    assert (status, complaint) == (0, "")
    said = " ".join(said.split())
    assert "300 runs, 300 of them with an answer" in said
    assert "over 66 independent combinations of the coordinates: their covariance agrees with the predicted" in said
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    assert "their covariance agrees with the predicted one" in (tmp_path / "report" / "report.html").read_text()
    wrong = " ".join(catseye(*options, "--station-ppm", "5", "--air-ppm", "5")[1].split())
    assert "their covariance contradicts the predicted one (p < 0.0001 for its shape and p < 0.0001" in wrong
    assert catseye(*options, "--resume")[0] == 2


def test_relative_ellipsoids_are_of_the_pairs_asked_for(answered, catseye):
    file = EXAMPLES / "feed-arm.toml"
    found = answered("adjust", file, "--relative", "ZY113,ZY118", "--relative", "ZY101,ZP201")
    near, far = found["relative"]
    assert (near["from"], near["to"]) == ("ZY113", "ZY118")
    x = [np.array([found["points"][n][k] for k in "xyz"]) for n in ("ZY113", "ZY118")]
    assert near["distance"] == pytest.approx(np.linalg.norm(x[1] - x[0]), abs=1e-9)
    sum_ = sum(np.array(found["points"][n]["covariance"]) for n in ("ZY113", "ZY118"))
    assert np.trace(near["covariance"]) < np.trace(sum_)  # neighbours on the arm err together
    unit = (x[1] - x[0]) / near["distance"]
    assert near["u_distance"] == pytest.approx(np.sqrt(unit @ np.array(near["covariance"]) @ unit), rel=1e-9)
    assert near["ellipsoid"]["semi_axes"][0] == pytest.approx(
        np.sqrt(np.linalg.eigvalsh(near["covariance"])[2]), rel=1e-9
    )
    assert far["u_distance"] > 0.0
    assert catseye("adjust", file, "--relative", "ZY113")[0] == 2
    status, _, err = catseye("adjust", file, "--relative", "ZY113,NOBODY")
    assert (status, err.count("\n")) == (1, 1)
    assert "NOBODY" in err


@pytest.mark.parametrize(
    "treatment",
    [[], ["--robust", "huber"], ["--reject"], ["--components", "groups"]],
    ids=lambda t: " ".join(t) or "plain",
)
def test_the_cap_of_iterations_reaches_every_treatment(catseye, treatment):
    ring = EXAMPLES / "ground-ring"
    status, out, err = catseye("adjust", ring, "--iterations", "1", "--json", *treatment)
    said = json.loads(out)
    assert status == 1
    assert (said["iterations"], said["verdict"]["word"]) == (1, "failed")
    assert said["status"].startswith("not converged: the last step was")
    assert said["status"] in err
    assert catseye("adjust", ring, "--iterations", "0", *treatment)[0] == 2
    usual, capped = (catseye("adjust", ring, "--json", *treatment, *more)[1] for more in ([], ["--iterations", "50"]))
    assert capped == usual


def test_estimated_zeros_and_air_stand_on_the_terminal(catseye):
    _, out, _ = catseye("adjust", EXAMPLES / "feed-arm.toml")
    line = next(line for line in out.splitlines() if line.startswith("Parameters"))
    assert "refractivity" in line
    assert "zero ZY118" in " ".join(out.split())


def test_robust_weights_and_rejection_exclude_each_other(catseye):
    status, out, err = catseye("adjust", EXAMPLES / "ground-ring", "--reject", "--robust", "huber")
    assert (status, out) == (2, "")
    assert "--robust cannot go with --reject" in err
