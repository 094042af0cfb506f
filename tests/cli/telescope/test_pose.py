"""`catseye pose` as a new user meets it: the example night against its design and against itself."""

import json

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from gateways.report_scene import column, read
from kept_scene import reduction_directory
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture(scope="module")
def night():
    """A directory as `catseye reduce --out` writes it."""
    return reduction_directory()


def test_the_dish_against_design_in_json(catseye, night):
    status, said, complained = catseye("pose", night, "--site", NIGHT, "--frame", "reflector", "--json")
    assert (status, complained) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    keys = "frame pivot translation rotation covariance points chi2 degrees_of_freedom p left_out missing posture"
    assert set(found) >= set(keys.split())
    assert found["frame"] == "reflector"
    assert len(found["points"]) == 90
    # the reduction's own pose of the dish, an unweighted paraboloid of the sixty prisms alone
    q = np.array(found["covariance"])
    assert q.shape == (6, 6)
    u = np.sqrt(np.diag(q))[3:5] / ARCSECOND
    assert np.all(u < 3.0)


def test_it_agrees_with_the_reduction_s_paraboloid_within_both_uncertainties(catseye, night, reduced_night_01):
    """Other points (triplets too), other weights, the same dish: turn about x and y, and lift along the axis."""
    found = json.loads(catseye("pose", night, "--site", NIGHT, "--frame", "ground", "--json")[1])
    theirs = reduced_night_01.surface.pose()
    axes = reduced_night_01.surface.fit.frame.rotation
    for key, columns, rows in (("rotation", axes[:, :2], slice(3, 6)), ("translation", axes[:, 2:], slice(0, 3))):
        apart = columns.T @ (np.array(found[key]) - theirs[key])
        both = np.array(found["covariance"])[rows, rows] + np.array(theirs["covariance"])[rows, rows]
        assert np.all(np.abs(apart) < 3.5 * np.sqrt(np.diag(columns.T @ both @ columns)))


def test_pointing_writes_report_tables_and_tells_people(catseye, night, tmp_path):
    out = tmp_path / "out"
    status, said, _ = catseye("pose", night, night, "--site", NIGHT, "--pointing", "prime", "--out", out)
    assert status == 0
    for word in ("Frame", "reflector", "plate scale 3.438", "azimuth times cos E", "turn of the dish", "Written to"):
        assert word in said
    files = "points.csv pose.json provenance.json report.html samplers.fits"
    assert sorted(p.name for p in out.iterdir()) == files.split()
    found = json.loads((out / "pose.json").read_text())
    np.testing.assert_allclose(found["pointing"]["offset"], 0.0, atol=1e-12)  # a night against itself
    assert found["pointing"]["u_offset"][0] < 0.25 * ARCSECOND
    report = read((out / "report.html").read_text())
    assert report["charts"].keys() == {"residuals", "terms-azimuth", "terms-elevation"}
    assert "Beam and focus" in [section["title"] for section in report["sections"]]
    scale = np.repeat([1e-3, ARCSECOND], 3)
    u = np.sqrt(np.diag(found["covariance"])) / scale
    assert column(report, "pose", "u") == pytest.approx(u, rel=6e-4)
    assert (out / "points.csv").read_text().count("\n") == 91


def test_points_pivot_and_robust(catseye, night):
    told = ["--points", "ZY113,ZY114,ZY115,ZY118", "--pivot=1,2,3", "--robust", "igg3", "--json"]
    status, said, _ = catseye("pose", night, "--site", NIGHT, *told)
    found = json.loads(said)
    assert status == 0
    assert found["pivot"] == [1.0, 2.0, 3.0]
    assert found["group"] == "points"
    assert found["against"] == "design"


@pytest.mark.parametrize(
    ("more", "status", "said"),
    [
        ([], 2, "--site"),
        (["--site", NIGHT, "--group", "roof"], 2, "roof"),
        (["--site", NIGHT, "--pivot", "1,2"], 2, "x,y,z in metres"),
        (["--site", NIGHT, "--points", "A,B,C", "--group", "dish"], 2, "one of the two"),
        (["--site", NIGHT, "--tilt", "1,2,3"], 2, "alidade"),
        (["--site", NIGHT, "--pointing", "prime", "--frame", "ground"], 2, "reflector"),
        (["--site", NIGHT, "--points", "A,B,C"], 1, "point 'A' is not in"),
        (["--site", NIGHT, "--group", "alidade"], 1, "no points of the group 'alidade'"),
        (["--site", "nowhere"], 1, "nowhere"),
        (["--site", NIGHT, "--pointing", "gregorian"], 1, "subreflector"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(catseye, night, more, status, said):
    found, out, complained = catseye("pose", night, *more)
    assert (found, out) == (status, "") if status == 1 else found == status
    assert said in complained
    if status == 1:
        assert complained.count("\n") == 1


def test_a_missing_epoch_is_one_line(catseye):
    status, _, complained = catseye("pose", "nowhere.json", "--site", NIGHT)
    assert status == 1
    assert "nowhere.json" in complained


def test_an_inclinometer_makes_the_alidade_surer(catseye, night, tmp_path):
    """Two of the structure's targets and a triplet stand in for the alidade's: a site of the test's own."""
    import shutil

    site = tmp_path / "site"
    shutil.copytree(NIGHT, site)
    text = (site / "targets.toml").read_text()
    # the elevation bearing's targets are typed in the reflector frame at this posture: told as the alidade's
    from catseye.constants import DEGREE
    from catseye.geometry.antenna.frames import ground_from_alidade
    from catseye.records.network.solved_points import read_solved_points

    names = ["ZAG731P", "ZAG731D", "ZEG41040L"]
    x = ground_from_alidade(145.3 * DEGREE).inverse().points(read_solved_points(night).places(names))
    blocks = text.split("[[target]]")
    for name, place in zip(names, x, strict=True):
        k = next(i for i, block in enumerate(blocks) if f'name = "{name}"' in block)
        block = blocks[k].replace('frame = "reflector"', 'frame = "alidade"').replace('frame = "ground"',
                                                                                     'frame = "alidade"')  # fmt: skip
        start = block.index("position_mm = [")
        end = block.index("]", start) + 1
        blocks[k] = block[:start] + f"position_mm = {[round(1e3 * float(v), 1) for v in place]}" + block[end:]
    (site / "targets.toml").write_text("[[target]]".join(blocks))
    told = ["pose", night, "--site", site, "--group", "alidade", "--frame", "alidade", "--json"]
    answers = [catseye(*told, *more) for more in ([], ["--tilt", "3,-2,1.5"])]
    assert [a[2] for a in answers] == ["", ""]
    plain, joined = (json.loads(a[1]) for a in answers)
    assert max(joined["u_rotation"][:2]) < 1.5 * ARCSECOND < min(plain["u_rotation"][:2])
    assert joined["rotation"][0] == pytest.approx(3 * ARCSECOND, abs=3 * ARCSECOND)
