"""GNU Gama's .gkf: known answers, every convention of axes and angles, and refusals by line."""

import csv
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.estimation.observations.kinds import Joint, Vectors
from catseye.records.network.gama import AXES, gama_network, read_gama
from catseye.records.network.gama_xml import GON, XmlElement, band_matrix
from repository import TESTS

VECTORS = TESTS / "vectors" / "networks"
MM, CC = 1e-3, 1e-4 * GON
COMPASS = {"n": (0, 1), "s": (0, -1), "e": (1, 0), "w": (-1, 0)}


def known_answer(file):
    with (VECTORS / file).open(encoding="utf-8", newline="") as stream:
        return {row["id"]: [float(row[key]) for key in list(row)[1:]] for row in csv.DictReader(stream)}


# Two tunnel points have no coordinates in the second epoch: where they are to a metre, in the file's axes.
SET_UPS = {"4901": (1002.6, 4999.9, 100.0), "4902": (996.0, 5000.0, 99.9)}


@pytest.mark.parametrize(
    ("file", "answer", "degrees"),
    [
        ("baumann3d/network.gkf", "baumann3d/expected.csv", 5),
        ("monitoring/phase-0-1TK.gkf", "monitoring/expected-phase-0-1TK.csv", 47),
        ("monitoring/phase-1-1TK.gkf", "monitoring/expected-phase-1-1TK.csv", 70),
    ],
)
def test_published_networks_come_out_as_published(file, answer, degrees, solve):
    network = read_gama(VECTORS / file)
    start = network.points.xyz.copy()
    for i in np.flatnonzero(np.isnan(start).any(axis=1)):
        start[i] = network.axes @ SET_UPS[network.points.names[i]]
    found = solve(network, start)
    assert found.degrees == degrees
    # the textbook's deviations are a posteriori, the tunnel's a priori
    scale = (found.pvv / degrees) ** 0.5 if "baumann" in file else 1.0
    for name, expected in known_answer(answer).items():
        i = network.points.names.index(name)
        assert np.allclose(found.x[i], expected[:3], rtol=0, atol=1e-6)
        assert np.allclose(scale * np.sqrt(np.diag(found.q[i])) / MM, expected[3:], rtol=3e-4)


def test_the_free_epoch_has_its_datum_on_all_points_and_the_fixed_one_holds_eight():
    free, held = (read_gama(VECTORS / f"monitoring/phase-{i}-1TK.gkf") for i in (0, 1))
    assert free.points.datum.all()
    assert not free.points.fixed.any()
    assert held.points.fixed.all(axis=1).sum() == 8
    assert not held.points.datum[:2].any()  # marked, but without coordinates there is nothing to be relative to
    assert held.points.datum[2:12].all()
    assert [p.name for p in held.parameters] == ["orientation 4901 set 1", "orientation 4902 set 1"]
    assert held.places[0][:2] == ("line 51", "line 52")


TRUTH = {"A": (0, 0, 0), "B": (90, 20, 3), "C": (30, 85, -2), "D": (55, 40, 12), "E": (10, 60, 30)}
START = {"D": (55.02, 39.97, 12.03), "E": (9.98, 60.02, 29.96)}


def azimuth(a, b):
    return np.arctan2(b[0] - a[0], b[1] - a[1])


def cov_mat(matrix):
    rows = "\n".join(" ".join(f"{v:.17g}" for v in row[i:]) for i, row in enumerate(matrix))
    return f'<cov-mat dim="{len(matrix)}" band="{len(matrix) - 1}">\n{rows}\n</cov-mat>'


def survey(axes_xy="en", sense="left-handed"):
    """One survey of five points as a .gkf in some convention; the errors of its observations are always the same."""
    rng = np.random.default_rng(7)
    to_file = np.zeros((3, 3))
    to_file[0, :2], to_file[1, :2], to_file[2, 2] = COMPASS[axes_xy[0]], COMPASS[axes_xy[1]], 1.0
    turn = 1.0 if sense == "left-handed" else -1.0
    p = {name: np.array(xyz, float) for name, xyz in TRUTH.items()}

    def gon(value, cc):
        return f"{(turn * (value + rng.normal(0, cc * CC)) / GON) % 400.0:.9f}"

    def metres(value, mm):
        return f"{value + rng.normal(0, mm * MM):.9f}"

    def point(name, xyz, status):
        x, y, z = to_file @ xyz
        return f'<point id="{name}" x="{x:.6f}" y="{y:.6f}" z="{z:.6f}" {status}/>'

    def joint(size, sizes):
        mixing = rng.normal(size=(size, size)) * 0.3 + np.eye(size)
        return mixing @ mixing.T * np.outer(sizes, sizes)

    text = [f'<gama-local><network axes-xy="{axes_xy}" angles="{sense}"><points-observations azimuth-stdev="30">']
    text += [point(name, p[name], 'fix="xyz"') for name in "ABC"]
    text += [point(name, np.array(xyz), 'adj="xyz"') for name, xyz in START.items()]
    for station, zero in (("D", 1.0), ("E", 4.0)):
        text.append(f'<obs from="{station}" from_dh="1.5">')
        for to in "ABC":
            along = p[to] - p[station] + [0.0, 0.0, 0.2 - 1.5]
            size = np.linalg.norm(along)
            zenith = (np.arccos(along[2] / size) + rng.normal(0, 8 * CC)) / GON
            text.append(f'<direction to="{to}" val="{gon(azimuth(p[station], p[to]) - zero, 9)}" stdev="9"/>')
            text.append(f'<s-distance to="{to}" val="{metres(size, 2)}" stdev="2" to_dh="0.2"/>')
            text.append(f'<z-angle to="{to}" val="{zenith:.9f}" stdev="8" to_dh="0.2"/>')
        text.append("</obs>")
    text.append("<obs>")  # kinds that differ, with one covariance
    text.append(f'<angle from="D" bs="A" fs="B" val="{gon(azimuth(p["D"], p["B"]) - azimuth(p["D"], p["A"]), 10)}"/>')
    text.append(f'<azimuth from="A" to="E" val="{gon(azimuth(p["A"], p["E"]), 30)}"/>')
    text.append(f'<distance from="C" to="E" val="{metres(np.hypot(*(p["E"] - p["C"])[:2]), 3)}"/>')
    signs = np.array([turn, turn, 1.0])
    text += [cov_mat(joint(3, np.array([10.0, 30.0, 3.0]) * signs)), "</obs>"]
    text.append("<height-differences>")
    text.append(f'<dh from="A" to="D" val="{metres(12.0, 1)}" stdev="1"/>')
    text.append(f'<dh from="D" to="E" val="{metres(18.0, 1)}" stdev="1"/></height-differences>')
    vectors = [p["D"] - p["A"], p["E"] - p["B"]]
    both = np.kron(np.eye(2), to_file)
    text.append("<vectors>")
    for (start, end), vector in zip(("AD", "BE"), vectors, strict=True):
        dx, dy, dz = to_file @ (vector + rng.normal(0, 2 * MM, 3) + [0, 0, 0.1 - 1.4])
        heights = 'from_dh="1.4" to_dh="0.1"'
        text.append(f'<vec from="{start}" to="{end}" dx="{dx:.9f}" dy="{dy:.9f}" dz="{dz:.9f}" {heights}/>')
    text += [cov_mat(both @ joint(6, np.full(6, 2.0)) @ both.T), "</vectors>", "<coordinates>"]
    x, y, _ = to_file @ (p["D"] + rng.normal(0, 2 * MM, 3))
    text.append(f'<point id="D" x="{x:.9f}" y="{y:.9f}"/><point id="E" z="{p["E"][2] + rng.normal(0, 2 * MM):.9f}"/>')
    some = np.eye(3)
    some[:2, :2] = to_file[:2, :2]
    text += [cov_mat(some @ joint(3, np.full(3, 2.0)) @ some.T), "</coordinates>"]
    return "".join([*text, "</points-observations></network></gama-local>"]).encode(), to_file


@pytest.fixture(scope="module")
def answer(solve):
    return solve(gama_network(survey()[0], "n.gkf"))


@pytest.mark.parametrize(("axes_xy", "sense"), list(product(AXES, ("left-handed", "right-handed"))))
def test_all_axes_and_senses_of_angle_give_one_answer_in_their_own_axes(axes_xy, sense, solve, answer):
    text, to_file = survey(axes_xy, sense)
    network = gama_network(text, "n.gkf")
    found = solve(network)
    assert np.array_equal(network.axes, to_file.T)
    assert np.allclose(found.x @ to_file, answer.x, rtol=0, atol=1e-8)
    assert np.allclose(to_file.T @ found.q @ to_file, answer.q, rtol=1e-6, atol=1e-14)
    assert found.pvv == pytest.approx(answer.pvv, rel=1e-5)
    assert found.degrees == 24


def test_that_answer_is_the_truth_within_its_covariance(answer):
    for i, name in ((3, "D"), (4, "E")):
        miss = answer.x[i] - TRUTH[name]
        assert miss @ np.linalg.solve(answer.q[i], miss) < 16.3  # chi-square, 3 degrees of freedom, 0.1 %
    assert 0.31 < answer.pvv / answer.degrees < 2.14  # chi-square, 24 degrees of freedom, 0.1 % on either side


HEAD = '<gama-local><network><points-observations distance-stdev="5 3 0.5" direction-stdev="3.24" angle-stdev="10">'
PLANE = (
    '<point id="1" x="0" y="0" fix="xy"/><point id="2" x="0" y="100" fix="xy"/><point id="3" x="80" y="60" adj="XY"/>'
)
TAIL = "</points-observations></network></gama-local>"


def small(inside, points=PLANE, head=HEAD):
    return gama_network(f"{head}\n{points}\n{inside}\n{TAIL}".encode(), "n.gkf")


def test_implied_stdevs_follow_the_formula_and_the_unit_of_the_value():
    network = small(
        '<obs from="1"><direction to="3" val="40-57-50.4"/><direction to="2" val="100"/>'
        '<distance to="3" val="100"/><distance to="2" val="99.99" stdev="2"/></obs>'
    )
    directions, distances = network.groups
    assert np.allclose(directions.observed, [np.radians(40 + 57 / 60 + 50.4 / 3600), np.pi / 2], rtol=1e-15)
    assert np.allclose(directions.covariance, [np.radians(3.24 / 3600) ** 2, (3.24 * CC) ** 2], rtol=1e-12)
    assert np.allclose(distances.covariance, [((5 + 3 * 0.1**0.5) * MM) ** 2, (2 * MM) ** 2], rtol=1e-12)


def test_a_plane_network_has_no_heights(solve):
    network = small('<obs><distance from="1" to="3" val="100.003"/><distance from="2" to="3" val="89.44"/></obs>')
    assert network.points.fixed.tolist() == [[True, True, False], [True, True, False], [False] * 3]
    assert network.points.absent.tolist() == [[False, False, True]] * 3
    assert network.points.datum.tolist()[2] == [True, True, False]
    assert np.allclose(solve(network).x[2, :2], (80.0, 60.0), atol=0.01)


def test_levelling_weighs_by_the_length_of_its_sections():
    head = '<gama-local><network><parameters sigma-apr="4"/><points-observations>'
    points = '<point id="1" z="1" fix="z"/><point id="2" z="2" adj="z"/>'
    inside = '<height-differences><dh from="1" to="2" val="1.01" dist="2.25"/></height-differences>'
    network = small(inside, points, head)
    assert network.groups[0].covariance.tolist() == pytest.approx([(6 * MM) ** 2])
    assert network.points.fixed.tolist() == [[False, False, True], [False] * 3]
    assert network.points.absent.tolist() == [[True, True, False]] * 2


def test_orientations_start_where_the_coordinates_point():
    network = small('<obs from="1"><direction to="3" val="350" stdev="5"/><direction to="2" val="9" stdev="5"/></obs>')
    # axes ne: point 2 is due east, 100 gon; point 3 at atan2(60, 80)
    zeros = np.array([np.arctan2(60, 80) - 350 * GON, (100 - 9) * GON])
    assert network.parameters[0].start == pytest.approx(np.angle(np.exp(1j * zeros).sum()) % (2 * np.pi))


@pytest.mark.parametrize(
    ("axes_xy", "sense", "azimuth_gon"),
    [("ne", "left", 30), ("ne", "right", -30), ("en", "left", 130), ("en", "right", 70), ("sw", "left", 230)],
)
def test_an_orientation_that_the_file_gives_is_a_bearing_from_its_x_axis(axes_xy, sense, azimuth_gon):
    head = f'<gama-local><network axes-xy="{axes_xy}" angles="{sense}-handed"><points-observations>'
    points = '<point id="1" adj="xy"/><point id="2" adj="xy"/>'
    inside = '<obs from="1" orientation="30"><direction to="2" val="0" stdev="5"/></obs>'
    assert small(inside, points, head).parameters[0].start == pytest.approx(azimuth_gon * GON)


def test_a_negative_angle_in_degrees_is_negative_in_all_its_parts():
    network = small('<obs from="1"><angle bs="2" fs="3" val="-10-30-36"/></obs>')
    assert np.degrees(network.groups[0].observed[0]) == pytest.approx(-10.51, abs=1e-12)


def test_independent_vectors_of_all_sets_are_one_group_of_blocks_and_mixed_sets_are_joint():
    points = "".join(f'<point id="{i}" x="{i}" y="0" z="{i * i}" adj="xyz"/>' for i in (1, 2, 3))
    vec = '<vec from="{}" to="{}" dx="1" dy="0" dz="3"/>'
    apart = '<cov-mat dim="3" band="2">4 1 0 4 0 9</cov-mat>'
    banded = '<cov-mat dim="6" band="2"> 4 1 0  4 0 0  9 0 0  4 1 0  4 0  9 </cov-mat>'
    network = small(
        f"<vectors>{vec.format(1, 2)}{apart}</vectors><vectors>{vec.format(2, 3)}{vec.format(3, 1)}{banded}</vectors>"
        '<obs><distance from="1" to="2" val="1"/><azimuth from="1" to="2" val="0"/>'
        '<cov-mat dim="2" band="1">4 0.5 9</cov-mat></obs>',
        points,
    )
    vectors, joint = network.groups
    assert isinstance(vectors, Vectors)
    assert vectors.covariance.shape == (3, 3, 3)
    # axes ne: x of the file is north, the package's y
    assert np.allclose(vectors.covariance[0], np.array([[4, 1, 0], [1, 4, 0], [0, 0, 9]]) * MM**2)
    assert np.allclose(vectors.observed[:3], [0, 1, 3])
    assert isinstance(joint, Joint)
    assert joint.kinds.tolist() == ["horizontal_distance", "azimuth"]
    assert np.allclose(joint.covariance, [[4e-6, 0.5 * MM * CC], [0.5 * MM * CC, 9 * CC**2]], rtol=1e-12)


@given(st.integers(1, 8), st.data())
def test_a_banded_matrix_is_read_as_it_was_written(size, data):
    band = data.draw(st.integers(0, size - 1))
    values = iter(range(1, 100))
    matrix, words = np.zeros((size, size)), []
    for i in range(size):
        for j in range(i, min(size, i + band + 1)):
            matrix[i, j] = matrix[j, i] = next(values)
            words.append(str(int(matrix[i, j])))
    element = XmlElement("cov-mat", {"dim": str(size), "band": str(band)}, 1, text="\n".join(words))
    assert np.array_equal(band_matrix("n.gkf", element, size), matrix)


REFUSED = {
    "": "n.gkf: holds 0 bytes and no text: empty",
    "<a>": "n.gkf: line 1, <a> at the top is not known (expected gama-local)",
    "<gama-local><network></gama-local>": "n.gkf: line 1, column 24, is not XML: mismatched tag",
    "<gama-local></gama-local>": "n.gkf: holds 0 networks (expected one)",
    '<!DOCTYPE g [<!ENTITY a "b">]><gama-local/>': (
        "n.gkf: line 1, <!DOCTYPE g> (expected none: entities are not read)"
    ),
    "<gama-local><network>text</network></gama-local>": (
        "n.gkf: line 1, text 'text' in <network> (expected elements only)"
    ),
    '<gama-local><network axes-xy="nn"/></gama-local>': (
        "n.gkf: line 1, axes-xy = 'nn' (expected ne sw es wn en nw se ws)"
    ),
    '<gama-local><network angles="both"/></gama-local>': (
        "n.gkf: line 1, network: angles = 'both' (expected left-handed or right-handed)"
    ),
    '<gama-local><network><parameters ellipsoid="wgs84"/></network></gama-local>': (
        "n.gkf: line 1, ellipsoid = 'wgs84' (expected none: a local plane network)"
    ),
    '<gama-local><network><parameters sigma-apr="0"/></network></gama-local>': (
        "n.gkf: line 1, parameters: sigma-apr = 0 (expected above 0)"
    ),
    "<gama-local><network/></gama-local>": "n.gkf: has no points (expected at least one)",
}


@pytest.mark.parametrize("text", REFUSED)
def test_file_without_network_is_refused_in_one_line(text):
    with pytest.raises(InputError) as refusal:
        gama_network(text.encode(), "n.gkf")
    assert str(refusal.value) == REFUSED[text]


REFUSED_INSIDE = {
    '<obs from="1"><distance to="9" val="1"/></obs>': (
        "horizontal_distance names the point '9' (expected a point of this file)"
    ),
    '<obs from="1"><distance to="1" val="1"/></obs>': (
        "horizontal_distance '1' to '1' joins a point with itself (expected points that differ)"
    ),
    '<obs from="1"><distance to="3" val="-1"/></obs>': "horizontal_distance '1' to '3' = -1 m (expected above 0)",
    '<obs from="1"><distance to="3" val="nan"/></obs>': "distance: val = 'nan' (expected a number)",
    '<obs from="1"><distance to="3" val="1" stdev="0"/></obs>': (
        "horizontal_distance '1' to '3' has the sigma 0 (expected above 0: no measurement is exact)"
    ),
    '<obs from="1"><distance to="3" val="1" weight="2"/></obs>': (
        "distance: weight = '2' is not known (to val from stdev from_dh to_dh extern)"
    ),
    '<obs from="1"><distance val="1"/></obs>': "distance: to is missing (expected to val)",
    '<obs><distance to="3" val="1"/></obs>': "distance: has no station (expected from, here or in obs)",
    '<obs from="1"><sextant to="3"/></obs>': (
        "<sextant> in <obs> is not known (expected direction distance angle s-distance z-angle azimuth cov-mat)"
    ),
    '<obs from="1"><azimuth to="3" val="1"/></obs>': (
        "azimuth: has no stdev, and neither points-observations nor a cov-mat gives one"
    ),
    '<obs from="1"><direction to="3" val="12-60-1.5"/></obs>': (
        "direction: val = '12-60-1.5' (expected ' and \" below 60)"
    ),
    '<obs from="1"><s-distance to="3" val="1"/></obs>': (
        "s-distance: needs z of '1', which is neither fix nor adj there"
    ),
    '<point id="3" x="80" y="60"/>': "point: '3' has its x in line 2 already (expected each name once)",
    '<point id="4" x="80"/>': "point: '4' has one of x and y (expected both or none)",
    '<point id="4" fix="xy"/>': "point '4', x is fixed and unknown (expected its value)",
    '<point id="4" fix="XyZ"/>': "point: fix = 'XyZ' (expected xy XY z Z xyz XYZ XYz xyZ)",
    '<obs from="1"><distance to="3" val="1"/><cov-mat dim="2" band="0">1 1</cov-mat></obs>': (
        "cov-mat: dim = 2, of 1 observations (expected 1)"
    ),
    '<obs from="1"><distance to="3" val="1"/><cov-mat dim="1" band="0">1 1</cov-mat></obs>': (
        "cov-mat: holds 2 values (expected 1 for dim 1, band 0)"
    ),
    '<obs><distance from="1" to="3" val="1"/><distance from="1" to="2" val="1"/>'
    '<cov-mat dim="2" band="1">1 2 1</cov-mat></obs>': (
        "covariance is not positive definite (expected a covariance matrix)"
    ),
    '<coordinates><point id="3" x="1" y="1"/></coordinates>': (
        "coordinates: has 2 values and no cov-mat (expected both)"
    ),
}


@pytest.mark.parametrize("inside", REFUSED_INSIDE)
def test_invalid_input_is_named_with_its_line(inside):
    with pytest.raises(InputError) as refusal:
        small(inside)
    assert str(refusal.value) == f"n.gkf: line 3, {REFUSED_INSIDE[inside]}"


def test_a_second_face_zenith_angle_is_refused():
    points = '<point id="1" x="0" y="0" z="0" fix="xyz"/><point id="2" x="9" y="9" z="9" adj="xyz"/>'
    with pytest.raises(InputError, match="expected the first face"):
        small('<obs from="1"><z-angle to="2" val="339" stdev="5"/></obs>', points)
