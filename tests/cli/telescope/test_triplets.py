"""`catseye triplets` as programs call it: keys, files, statuses, refusals."""

import json

import numpy as np
import pytest

import catseye as package
from catseye.records.site.prism_ranges import read_prism_ranges

KEYS = {
    "reduce": {"pairs", "triplets", "rangers", "covariance_d_bc", "measured", "frame"},
    "adjust": {"points", "covariance", "d_bc", "covariance_d_bc", "observations", "zeros", "variance_factor"},
    "aim": {"aim", "centroid", "triplets"},
    "bound": {"cases", "causes", "refractivity_change", "ball_range_error"},
}
ARGUMENTS = {
    "reduce": ("night-01", "triplets/prism-ranges.csv"),
    "adjust": ("night-01", "triplets/prism-ranges.csv"),
    "aim": ("night-01",),
    "bound": (),
}
FILES = {
    "reduce": {"ranges.csv", "points.csv", "ranges.svg"},
    "adjust": {"points.csv", "distances.csv", "ranges.csv", "net.svg"},
    "aim": {"mounts.csv", "incidences.csv"},
    "bound": {"cases.csv", "causes.csv", "bounds.svg"},
}


@pytest.fixture
def catseye(catseye):
    """A command of the group `triplets`."""
    return lambda *arguments: catseye("triplets", *arguments)


@pytest.mark.parametrize("verb", sorted(KEYS))
def test_each_gives_one_object_and_its_files(catseye, verb, tmp_path):
    out = tmp_path / "out"
    status, said, complaint = catseye(verb, *ARGUMENTS[verb], "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert set(found) >= KEYS[verb] | {"verdict"}
    assert {path.name for path in out.iterdir()} == FILES[verb] | {"result.json", "provenance.json"}


def test_people_read_pairs_points_mounts_and_cases(catseye):
    for verb, words in (
        ("reduce", ("D_BC", "and 48 more", "series of figure 10")),
        ("adjust", ("TR10-B", "variance factor", "Zeros")),
        ("aim", ("swing", "TR03", "centroid")),
        ("bound", ("1.3229", "2.6458", "appendix A", "31.19")),
    ):
        status, said, _ = catseye(verb, *ARGUMENTS[verb])
        assert status == 0
        assert [word for word in words if word not in said] == []


def test_one_unit_goes_back_from_its_places_to_ranges(catseye):
    found = json.loads(catseye("reduce", "night-01", "--unit", "TR03", "--json")[1])
    assert found["measured"] is False
    assert list(found["triplets"]) == ["TR03"]
    pair = found["pairs"][0]
    assert pair["d_bc"] == pytest.approx(pair["d_bc_by_places"], abs=1e-12)
    assert pair["range_left"] > pair["d_mp"] - 0.4


def test_a_reduced_night_gives_its_used_shots_without_the_obliquity(tmp_path):
    """Distances to balls by prisms alone, and by everything in one adjustment: within 5 u, ground ranges weigh more."""
    package.save(package.reduce("night-01"), tmp_path / "night")
    found = read_prism_ranges(tmp_path / "night" / "ranges.csv")
    rows = {pair: k for k, pair in enumerate(zip(found.ranger, found.target, strict=True))}
    ranges = package.reduce_triplets("night-01", tmp_path / "night" / "ranges.csv")
    assert ranges.reduction.count == 57
    points = json.loads((tmp_path / "night" / "coordinates.json").read_text())["points"]
    i, k = ranges.names.index("TR02"), ranges.rangers.index("ZY114")
    assert found.distance[rows["ZY114", "TR02-L"]] == pytest.approx(ranges.ranges[i, k, 0], abs=1e-9)
    place = {name: np.array([points[name][axis] for axis in "xyz"]) for name in ("TR02-B", "ZY114")}
    apart = np.linalg.norm(place["TR02-B"] - place["ZY114"])
    assert abs(ranges.d_bc[i, k] - apart) < 5.0 * ranges.u_d_bc[i, k]
    net = package.adjust_triplets("night-01", tmp_path / "night" / "ranges.csv")
    assert abs(net.d_bc[i, k] - apart) < 5.0 * net.u_d_bc[i, k]
    assert net.verdict.word == "good"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("reduce", "night-01", "missing.csv"), "missing.csv"),
        (("reduce", "night-01", "triplets/prism-ranges-truth.csv"), "column 'point'"),
        (("adjust", "night-01", "networks/ranging-18x500/ranges.csv"), "ranges.csv"),
        (("aim", "night-01", "--unit", "TR77"), "unit 'TR77' is unknown"),
        (("aim", "night-01", "--outer=0,0,0"), "has no direction"),
        (("bound", "--d12-mm", "1e6"), "no triangle"),
        (("bound", "--temperature-c", "900"), "temperature"),
    ],
)
def test_what_cannot_be_done_is_one_line(catseye, arguments, said):
    status, out, complaint = catseye(*arguments)
    assert (status, out) == (1, "")
    assert said in complaint
    assert complaint.count("\n") == 1


@pytest.mark.parametrize(
    "arguments", [("aim", "night-01", "--at-mm", "1,2"), ("reduce", "night-01", "--u-zero-mm", "0"), ("bound", "--x")]
)
def test_wrong_usage_is_2(catseye, arguments):
    assert catseye(*arguments)[0] == 2
