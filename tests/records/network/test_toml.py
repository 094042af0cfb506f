"""Our own network file: every kind and section once, and every key that is not ours refused."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.estimation.observations.kinds import Distances
from catseye.records.network.any_file import read_network
from catseye.records.network.kinds import ANGLES, LENGTHS
from repository import TESTS

FROZEN = TESTS / "vectors" / "formats" / "network-1.toml"
ARCSEC = np.pi / 648_000
# Where the points of the frozen file are: its observations were computed from these by formulas of their own.
TRUTH = {
    "A": (0.0000000, 0.0000000, 0.0000000),
    "B": (100.0000000, 0.0000000, 2.0000000),
    "C": (20.0000000, 80.0000000, -1.0000000),
    "D": (60.0000000, 50.0000000, 10.0000000),
    "E": (30.0000000, 30.0000000, 25.0000000),
    "P1": (50.0000000, 20.0000000, 5.0000000),
    "P2": (50.3733562, 20.3145606, 5.1079664),
    "P3": (49.7258024, 20.2886052, 5.1073440),
    "P4": (49.9749870, 20.2305903, 5.3408848),
    "G1": (40.0000000, 60.0000000, 20.0000000),
    "G2": (42.8658662, 60.8861886, 20.0384819),
    "G3": (39.4053744, 61.8996855, 20.5362979),
    "H1": (42.0000000, 58.0000000, 21.0000000),
    "H2": (43.3591474, 60.6607813, 20.7298870),
    "H3": (40.2125225, 58.9521543, 21.3851314),
    "F1": (10.0000000, 10.0000000, 2.9000000),
    "F2": (20.0000000, 10.0000000, 3.0000000),
    "F3": (10.0000000, 25.0000000, 2.6000000),
    "F4": (25.0000000, 30.0000000, 2.6500000),
    "L1": (5.0000000, 60.0000000, 2.0000000),
    "L2": (6.7457431, 63.4914862, 2.8728716),
    "L3": (8.9279220, 67.8558440, 3.9639610),
    "S": (80.0000000, 20.0000000, 4.0000000),
    "S1": (80.5000000, 20.0000000, 4.0000000),
    "S2": (80.0000000, 20.5000000, 4.0000000),
    "S3": (80.0000000, 20.0000000, 4.5000000),
    "S4": (79.7000000, 20.4000000, 4.0000000),
}

HEAD = """format = "catseye-network-1"
[[points]]
columns = ["name", "x_m", "y_m", "z_m", "role"]
rows = [["A", 0, 0, 0, "fixed"], ["B", 10, 0, 0, "datum"], ["C", 0, 10.0, 0, "free"]]
"""


def read(tmp_path, text, head=HEAD):
    (tmp_path / "n.toml").write_text(f"{head}\n{text}\n", encoding="utf-8")
    return read_network(tmp_path / "n.toml")


def test_the_frozen_file_holds_every_kind_and_fits_the_truth_without_residual(solve):
    network = read_network(FROZEN)
    kinds = {str(kind) for group in network.groups for kind in group.kinds}
    assert kinds == {
        *("slope_distance", "horizontal_distance", "fixed_distance", "distance_difference", "direction", "angle"),
        *("azimuth", "zenith_angle", "height_difference", "inclination", "level_plane", "coordinates", "vector"),
        *("rigid_body", "frame_point", "tilt", "point_on_plane", "point_on_line", "point_on_sphere"),
    }
    found = solve(network)
    for i, name in enumerate(network.points.names):
        assert found.x[i] == pytest.approx(TRUTH[name], abs=1e-6), name
    for group, residuals in zip(network.groups, found.residuals, strict=True):
        assert np.abs(residuals).max() < 0.01, group.name  # the file's rounding
    values = dict(zip((p.name for p in network.parameters), found.parameters, strict=True))
    assert values["zero A"] == pytest.approx(3e-4, abs=1e-6)
    assert values["sight line"] == pytest.approx(11.5, abs=1e-6)
    assert values["z of c in arm"] == pytest.approx(0.5, abs=1e-6)
    assert network.description == "Every kind once"


def test_the_frozen_file_keeps_its_units_priors_and_places():
    network = read_network(FROZEN)
    by_name = {p.name: p for p in network.parameters}
    assert (by_name["morning"].start, by_name["morning"].sigma, by_name["morning"].unit) == (2e-6, 5e-7, "1")
    assert (by_name["zero A"].start, by_name["zero A"].sigma, by_name["zero A"].unit) == (3e-4, 1e-4, "m")
    assert by_name["zero B"].start == pytest.approx(-2e-4)
    assert by_name["zero B"].sigma == 0.0  # known
    assert by_name["scale A"].sigma == np.inf
    assert by_name["gyro"].start == pytest.approx(np.radians(12))  # its prior's value, wherever coordinates point
    assert by_name["gyro"].sigma == pytest.approx(5 * ARCSEC)
    assert by_name["y of b in arm"].sigma == pytest.approx(1e-4)
    assert by_name["x of a in arm"].sigma == 0.0
    assert network.points.fixed[:2].tolist() == [[True] * 3, [False, False, True]]
    (distances,) = (group for group in network.groups if isinstance(group, Distances))
    assert len(distances.observed) == 27
    assert np.sqrt(distances.covariance[0]) == pytest.approx(80e-6)
    assert np.sqrt(distances.covariance[1]) == pytest.approx(50e-6 + 0.5e-6 * distances.observed[1])
    at = network.groups.index(distances)
    assert {"observations 1 row 1", "observation 1"} <= set(network.places[at])


def test_a_table_beside_the_file_is_read_by_its_lines(tmp_path):
    (tmp_path / "r.csv").write_text("from,to,value_m,u_mm\nA,B,10.001,\nA,C,9.999,0.2\n")
    with pytest.raises(InputError) as refusal:
        read(tmp_path, '[[observations]]\nkind = "slope_distance"\nfile = "r.csv"')
    assert str(refusal.value) == "r.csv: line 2, u is missing (expected u_m, u_mm, u_um)"
    (tmp_path / "r.csv").write_text("from,to,value_m\nA,B,10.001\nA,C,9.999\n")
    network = read(tmp_path, '[[observations]]\nkind = "slope_distance"\nfile = "r.csv"\nu_mm = 0.2')
    assert network.groups[0].observed.tolist() == [10.001, 9.999]
    assert network.places == (("r.csv line 2", "r.csv line 3"),)


def test_correlated_set_has_the_covariance_of_its_correlation(tmp_path):
    network = read(
        tmp_path,
        """[[correlated]]
        correlation = [[1, -0.5], [-0.5, 1]]
        observation = [
          { kind = "slope_distance", from = "A", to = "B", value_m = 10, u_mm = 2 },
          { kind = "azimuth", from = "A", to = "B", value_deg = 90, u_arcsec = 4 },
        ]""",
    )
    (joint,) = network.groups
    assert joint.kinds.tolist() == ["slope_distance", "azimuth"]
    cross = -0.5 * 2e-3 * 4 * ARCSEC
    assert joint.covariance == pytest.approx(np.array([[4e-6, cross], [cross, (4 * ARCSEC) ** 2]]))


def test_a_pose_is_found_from_coordinates_whatever_the_turn(tmp_path, solve):
    rows = [("P1", 0, 0, 0), ("P2", 1, 0, 0), ("P3", 0, 2, 0), ("P4", 0, 0, 3)]
    # the body turned by half a turn about x, then moved by (5, 6, 7)
    points = "".join(f'[[point]]\nname = "{n}"\nxyz_m = [{5 + x}, {6 - y}, {7 - z}]\nu_mm = 1\n' for n, x, y, z in rows)
    parts = ", ".join(f'{{ name = "{n}", xyz_m = [{x}, {y}, {z}], u_mm = 0.1 }}' for n, x, y, z in rows)
    network = read(tmp_path, f'{points}\n[[body]]\nname = "b"\npoint = [{parts}]', head='format = "catseye-network-1"')
    body = network.groups[-1]
    assert np.allclose(body.start, np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    assert [p.start for p in network.parameters] == pytest.approx([5, 6, 7, 0, 0, 0])
    assert np.abs(solve(network).residuals[-1]).max() < 1e-6


SLOPE = '[[observation]]\nkind = "slope_distance"\nfrom = "A"\nto = "B"\n'
REFUSED = {
    "[[pionts]]": "top, 'pionts' is not a known key here (expected perhaps point)",
    '[[point]]\nname = "A"': "points 1 row 1, point 'A' occurs twice (expected unique names)",
    '[[point]]\nname = "D"\nfixed = "x"': "point 1, point 'D', x is fixed and unknown (expected its value)",
    '[[point]]\nname = "D"\nfixed = "east"': "point 1, fixed = 'east' (expected letters of xyz)",
    '[[point]]\nname = "D"\nxyz = [1, 2, 3]': "point 1, 'xyz' is not a known key here (expected perhaps xyz_m)",
    '[[point]]\nname = "D"\nxyz_m = [1, 2]': "point 1, xyz_m = [1, 2] (expected 3 finite numbers)",
    '[[point]]\nname = "D"\nxyz_m = [1, 2, 3]\nu_mm = -1': "point 1, u_mm = -1 (expected 0 or above)",
    '[[ranger]]\nname = "Z"': "ranger 1, ranger 'Z' is not a point (expected the name of one)",
    '[[ranger]]\nname = "A"\nzero = "loose"': ("ranger 1, zero = 'loose' (expected 'free', or a value with its unit)"),
    '[[ranger]]\nname = "A"\nzero = "free"\nu_zero_mm = 1': "ranger 1, is free and has u_zero (expected one of them)",
    '[[parameter]]\nname = "k"': ("parameter 1, value is missing (expected value_mm, value_ppm, value_arcsec etc.)"),
    '[[observation]]\nkind = "range"': f"observation 1, kind = 'range' (expected {' '.join((*LENGTHS, *ANGLES))})",
    SLOPE + "value_m = 10": "observation 1, u is missing (expected u_m, u_mm, u_um)",
    SLOPE + "u_mm = 1": "observation 1, value is missing (expected value_m, value_mm, value_um)",
    SLOPE + "value_m = nan\nu_mm = 1": "observation 1, value_m = nan (expected a finite number)",
    SLOPE + "value_m = 10\nu_mm = 0": (
        "observation 1, slope_distance 'A' to 'B' has the sigma 0 (expected above 0: no measurement is exact)"
    ),
    SLOPE + "value_m = -10\nu_mm = 1": "observation 1, slope_distance 'A' to 'B' = -10 m (expected above 0)",
    SLOPE + "value_m = 10\nvalue_mm = 10000\nu_mm = 1": (
        "observation 1, value_m and value_mm give the same quantity (expected one of them)"
    ),
    SLOPE + "value_m = 10\nu_mm = 1\nweather = 3": (
        "observation 1, 'weather' is not a known key here (expected no such key)"
    ),
    SLOPE + 'value_m = 10\nu_mm = 1\nrefractivity = "noon"': (
        "observation 1, refractivity = 'noon' is not a parameter (expected the name of a [[parameter]])"
    ),
    SLOPE.replace('"B"', '"BB"') + "value_m = 10\nu_mm = 1": (
        "observation 1, slope_distance names the point 'BB' (expected perhaps 'B')"
    ),
    SLOPE.replace('"B"', '"A"') + "value_m = 10\nu_mm = 1": (
        "observation 1, slope_distance 'A' to 'A' joins a point with itself (expected points that differ)"
    ),
    '[[observations]]\nkind = "azimuth"\nu_deg = 1\ncolumns = ["from", "to"]\nrows = [["A"]]': (
        "observations 1 row 1, ['A'] (expected 2 values)"
    ),
    '[[observations]]\nfrom = "A"\ncolumns = ["from", "to"]\nrows = [["A", "B"]]': (
        "observations 1, 'from' occurs twice (expected unique keys)"
    ),
    '[[body]]\nname = "b"\npoint = [{ name = "A", xyz_m = [0, 0, 0], u_mm = 1 }]': (
        "body 1, origin and rotation are missing, and no three points off a line have coordinates (expected one)"
    ),
    '[[frame]]\nname = "f"\nshape = "s"': "frame 1, shape = 's' is missing (expected the name of a [[shape]])",
    '[[plane]]\nname = "p"\npoints = ["A", "B"]\nu_mm = 1': (
        "plane 1, normal or centre is missing, and too few points have coordinates (expected both)"
    ),
    '[[sphere]]\nname = "s"\npoints = ["A"]\ncentre = "B"\nu_mm = 1': (
        "sphere 1, radius is missing (expected radius_m, radius_mm, radius_um)"
    ),
}


@pytest.mark.parametrize("text", REFUSED)
def test_invalid_input_is_named_with_its_table(tmp_path, text):
    with pytest.raises(InputError) as refusal:
        read(tmp_path, text)
    assert str(refusal.value) == f"n.toml: {REFUSED[text]}"


@pytest.mark.parametrize("version", ['format = "catseye-network-2"', "format = 2", ""])
def test_another_format_is_refused(tmp_path, version):
    with pytest.raises(InputError, match=r"expected 'catseye-network-1'"):
        read(tmp_path, "", head=version + "\nnew = 1")
