"""A network from a file or a folder: what is read, and the one line in which anything else is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.estimation.observations.kinds import Distances, ObservedCoordinates
from catseye.records.files.columns import columns_of
from catseye.records.network.any_file import read_network
from catseye.reduction.network.adjusted import adjusted
from repository import ROOT, TESTS

VECTORS = TESTS / "vectors" / "networks"
EXAMPLES = ROOT / "examples" / "networks"
POINTS = """point,x,y,z,role
S1,0,0,0,fixed
S2,100,0,0,fixed
S3,0,100,0,fixed
T1,30,40,50,free
"""
RANGES = """from,to,distance,sigma
S1,T1,70.7106781,0.0001
S2,T1,94.8683298,0.0001
S3,T1,83.6660027,0.0001
"""


def folder(directory, points=POINTS, ranges=RANGES):
    (directory / "points.csv").write_text(points, encoding="utf-8", newline="")
    (directory / "ranges.csv").write_text(ranges, encoding="utf-8", newline="")
    return directory


def refusal_of(path):
    with pytest.raises(InputError) as refusal:
        read_network(path)
    text = str(refusal.value)
    assert "\n" not in text
    return text


def test_a_folder_of_three_stations_puts_the_target_where_geometry_does(tmp_path, solve):
    network = read_network(folder(tmp_path))
    assert network.points.names == ("S1", "S2", "S3", "T1")
    assert isinstance(network.groups[0], Distances)
    assert network.places == (("line 2", "line 3", "line 4"),)
    assert np.allclose(solve(network).x[3], (30.0, 40.0, 50.0), atol=1e-6, rtol=0)


def test_established_ranging_network_is_read_completely():
    network = read_network(VECTORS / "ranging-18x500")
    assert len(network.points.names) == 518
    assert network.points.datum.sum() == 54
    assert not network.points.fixed.any()
    (distances,) = network.groups
    assert len(distances.observed) == 9000
    assert distances.observed[0] == 100.8467627
    assert distances.covariance[0] == 0.000100423**2
    first = [network.points.names[column[0] // 3] for column in distances.ends]
    assert first == ["S01", "T00001"]


def test_columns_come_in_any_order_and_lines_may_end_as_windows_writes_them(tmp_path):
    points = "role,z,y,x,point\r\nfixed,0,0,0,S1\r\nfree,5,4,3,T1\r\n"
    network = read_network(folder(tmp_path, points, "sigma,distance,to,from\r\n0.001,7.07,T1,S1\r\n"))
    assert network.points.xyz.tolist() == [[0, 0, 0], [3, 4, 5]]
    assert network.groups[0].observed.tolist() == [7.07]


def test_a_prior_is_an_observation_and_without_error_it_holds(tmp_path):
    points = "point,x,y,z,role,u_x,u_y,u_z\nS1,0,0,0,datum,0.001,0.002,0\nT1,3,4,5,free,,,\n"
    network = read_network(folder(tmp_path, points, "from,to,distance,sigma\nS1,T1,7.07,0.001\n"))
    prior = network.groups[1]
    assert isinstance(prior, ObservedCoordinates)
    assert prior.component.tolist() == ["x", "y"]
    assert np.allclose(prior.covariance, [1e-6, 4e-6])
    assert network.points.fixed.tolist() == [[False, False, True], [False] * 3]
    assert network.points.datum.tolist() == [[True, True, False], [False] * 3]
    assert network.places[1] == ("points.csv line 2", "points.csv line 2")


def test_a_point_without_coordinates_is_to_be_found(tmp_path):
    network = read_network(folder(tmp_path, POINTS.replace("30,40,50", ",,")))
    assert np.isnan(network.points.xyz[3]).all()


BAD_POINTS = {
    "T1,30": ("S1,30", "points.csv: line 5, point 'S1' is in line 2 already (expected each name once)"),
    "T1,30,40,50": ("T1,30,40", "points.csv: line 5, 4 fields = 'T1,30,40,free' (expected 5)"),
    "30,40,50": ("30,4O,50", "points.csv: line 5, y = '4O' (expected a finite number)"),
    "100,0,0,fixed": (
        ",0,0,fixed",
        "points.csv: line 3, x = '' (expected its value: it is fixed, datum or has a prior)",
    ),
    "free": ("held", "points.csv: line 5, role = 'held' (expected free or fixed or datum)"),
    "point,": (
        "name,",
        "points.csv: line 1, column 'name' is unknown (expected the header point,x,y,z, optionally role,u_x,u_y,u_z)",
    ),
    ",role": (
        ",x",
        "points.csv: line 1, column 'x' occurs 2 times (expected the header point,x,y,z, optionally role,u_x,u_y,u_z)",
    ),
}
AIR = "temperature_c,pressure_hpa,humidity_percent,group_index,index"
HEADER = f"(expected the header from,to,distance, optionally sigma,{AIR})"
BAD_RANGES = {
    "S2,T1": (
        "S2,TT1",
        "ranges.csv: line 3, to = 'TT1' is not in points.csv "
        "(expected perhaps 'T1'; an unknown point needs at least 3 ranges)",
    ),
    "S3,T1": ("T1,T1", "ranges.csv: line 4, to = 'T1' (expected another point than from)"),
    "94.8683298": ("-94.8", "ranges.csv: line 3, distance = '-94.8' (expected above 0 m)"),
    "94.8683298,": ("nan,", "ranges.csv: line 3, distance = 'nan' (expected a finite number)"),
    "S1,T1,70": ("S1,T1,7_0", "ranges.csv: line 2, distance = '7_0.7106781' (expected a finite number)"),
    "83.6660027,0.0001": (
        "83.6660027,0",
        "ranges.csv: line 4, sigma = '0' (expected above 0 m: no measurement is exact)",
    ),
    ",sigma": (
        ",u",
        f"ranges.csv: line 1, column 'u' is unknown {HEADER}",
    ),
    "S1,T1,70.7106781,0.0001\n": ("\n", "ranges.csv: line 2, 1 fields = '' (expected 4)"),
    "\nS1": (
        ",\nS1",
        f"ranges.csv: line 1, column '' is unknown {HEADER}",
    ),
}


@pytest.mark.parametrize("old", BAD_POINTS)
def test_a_bad_point_is_named_with_its_line(tmp_path, old):
    new, expected = BAD_POINTS[old]
    assert old in POINTS
    assert refusal_of(folder(tmp_path, points=POINTS.replace(old, new, 1))) == expected


@pytest.mark.parametrize("old", BAD_RANGES)
def test_a_bad_range_is_named_with_its_line(tmp_path, old):
    new, expected = BAD_RANGES[old]
    assert old in RANGES
    assert refusal_of(folder(tmp_path, ranges=RANGES.replace(old, new, 1))) == expected


def test_missing_or_empty_input_is_reported(tmp_path):
    (tmp_path / "points.csv").write_text(POINTS)
    assert refusal_of(tmp_path) == f"ranges.csv: missing in {tmp_path}"
    (tmp_path / "ranges.csv").write_text("\n")
    assert refusal_of(tmp_path) == "ranges.csv: holds 1 bytes and no text: empty"
    (tmp_path / "ranges.csv").write_text("from,to,distance,sigma\n")
    assert refusal_of(tmp_path) == "ranges.csv: holds a header and no rows (expected at least one)"
    assert "n.dat: missing in" in refusal_of(tmp_path / "n.dat")
    assert refusal_of(tmp_path / "n.gkf") == "n.gkf: cannot be read: No such file or directory"
    ending = "(expected a folder with points.csv and ranges.csv, or .toml .gkf .xml .dat)"
    assert refusal_of(tmp_path / "n.txt") == f"n.txt: ends in '.txt' {ending}"


def test_quoted_cells_are_read_and_their_lines_counted():
    table = columns_of('from,to\n"S,1","T\n1"\nS2,T2\n', "r.csv", ["from", "to"])
    assert table.cells["from"] == ["S,1", "S2"]
    assert list(table.lines) == [2, 4]
    with pytest.raises(InputError, match="line 4, 1 fields = 'S2'"):
        columns_of('from,to\n"S,1","T\n1"\nS2\n', "r.csv", ["from", "to"])


@given(
    st.lists(st.tuples(st.sampled_from("AB"), st.floats(1e-3, 1e6), st.floats(1e-9, 1.0)), min_size=1, max_size=30),
    st.booleans(),
)
def test_every_number_written_is_the_number_read(rows, quoted):
    mark = '"' if quoted else ""
    text = "from,distance,sigma\n" + "".join(f"{mark}{a}{mark},{d!r},{u!r}\n" for a, d, u in rows)
    table = columns_of(text, "r.csv", ["from", "distance", "sigma"])
    assert table.cells["from"] == [row[0] for row in rows]
    assert table.numbers("distance").tolist() == [row[1] for row in rows]
    assert table.numbers("sigma").tolist() == [row[2] for row in rows]


def test_examples_are_read_and_fit_their_claims(solve):
    files = {
        "bodies.toml",
        "displayed",
        "feed-arm.toml",
        "ground-ring",
        "template",
        "weather.toml",
        "total-station.gkf",
        "total-station.dat",
    }
    assert {path.name for path in EXAMPLES.iterdir()} == files
    for file in files - {"template", "displayed"}:  # which have points without a place
        answer = solve(read_network(EXAMPLES / file))
        # noise as claimed: [pvv] / f is 1 within five of its standard deviations
        assert abs(answer.pvv / answer.degrees - 1.0) < 5.0 * (2.0 / answer.degrees) ** 0.5, file


def test_one_survey_in_two_programs_files_has_one_answer(solve):
    gama, starnet = (solve(read_network(EXAMPLES / f"total-station.{end}")) for end in ("gkf", "dat"))
    assert np.allclose(gama.x, starnet.x, rtol=0, atol=1e-9)
    assert np.allclose(gama.q, starnet.q, rtol=1e-9, atol=1e-15)
    assert gama.degrees == starnet.degrees == 20


def test_targets_that_are_not_listed_are_unknown_points():
    """The template: five stations listed, four targets not; known from where its ranges were made."""
    made = {"T1": (12.3, 8.7, 3.1), "T2": (30.2, 21.6, 5.4), "T3": (8.9, 27.4, 2.2), "T4": (25.0, 5.5, 6.8)}
    network = read_network(EXAMPLES / "template")
    assert network.points.names == ("A", "B", "C", "D", "E", *made)
    assert np.isnan(network.points.xyz[5:]).all()
    assert not network.points.fixed[5:].any()
    answer = adjusted(network).solution
    for name, place in made.items():
        np.testing.assert_allclose(
            answer.x[network.points.names.index(name)], place, rtol=0, atol=4e-3
        )  # u is 1.2 mm at most
    assert 0.3 < answer.variance_factor < 2.5


def test_semicolons_with_decimal_commas_and_a_byte_order_mark_are_read_as_the_same(tmp_path):
    (tmp_path / "plain").mkdir()
    own = folder(tmp_path / "plain")
    other = tmp_path / "other"
    other.mkdir()
    for name in ("points.csv", "ranges.csv"):
        text = (own / name).read_text().replace(",", ";").replace(".", ",")
        (other / name).write_text(text, encoding="utf-8-sig")
    first, second = read_network(own), read_network(other)
    np.testing.assert_array_equal(first.points.xyz, second.points.xyz)
    np.testing.assert_array_equal(first.groups[0].observed, second.groups[0].observed)
    (other / "ranges.csv").write_text("from;to;distance;sigma\nS1;T1;1.070,7;0,001\n")
    with pytest.raises(InputError, match=r"line 2, distance = '1\.070,7' \(expected a finite number\)"):
        read_network(other)


def test_a_claim_serves_ranges_without_a_sigma(tmp_path):
    own = folder(tmp_path)
    lines = (own / "ranges.csv").read_text().splitlines()
    lines[1] = lines[1].rpartition(",")[0] + ","
    (own / "ranges.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"ranges.csv: line 2, no sigma \(expected one, m, or sigma_mm"):
        read_network(own)
    (group,) = read_network(own, sigma_mm=1.0, sigma_ppm=2.0).groups[:1]
    assert np.sqrt(group.covariance[0]) == pytest.approx(1e-3 + 2e-6 * group.observed[0])
    assert np.sqrt(group.covariance[1]) == pytest.approx(float(lines[2].rpartition(",")[2]))
    (own / "ranges.csv").write_text("\n".join(line.rpartition(",")[0] for line in lines))
    assert np.sqrt(read_network(own, sigma_ppm=2.0).groups[0].covariance) == pytest.approx(2e-6 * group.observed)
    with pytest.raises(InputError, match=r"sigma_mm = -1 \(expected 0 to 100000\)"):
        read_network(own, sigma_mm=-1.0)
    with pytest.raises(InputError, match="contains all uncertainties"):
        read_network(EXAMPLES / "feed-arm.toml", sigma_mm=1.0)
