"""JSON, CSV, XML and files of an adjusted network say the same, in the file's own axes, and say what is not known."""

import csv
import hashlib
import io
import json
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.errors import EstimationError
from catseye.estimation.deformation.comparison import compare
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.plan import Candidate
from catseye.gateways.network.comparison import (
    comparison_object,
    comparison_passages,
)
from catseye.gateways.network.files import input_hashes, write_comparison, write_network
from catseye.gateways.network.objects import network_json, network_object
from catseye.gateways.network.summary import treatment_passages
from catseye.gateways.network.tables import (
    candidates_csv,
    coordinates_csv,
    displacements_csv,
    observations_csv,
    parameters_csv,
)
from catseye.gateways.network.xml import NAMESPACE, network_xml
from catseye.records.network.folder import read_network_folder
from catseye.records.network.gama import read_gama
from catseye.reduction.network.adjusted import adjusted, adjusted_network
from catseye.reduction.network.comparison import ComparedEpochs
from catseye.reduction.network.treatment import AdjustmentOptions
from column_scene import assert_columns
from gateways.report_scene import read, texts
from repository import TESTS

LENGTHS = {"slope_distance", "horizontal_distance", "height_difference", "vector", "coordinates"}  # kinds in m
NETWORKS = TESTS / "vectors" / "networks"
GON = np.pi / 200.0
TRUTH = {  # x north, y east, z up, as the axes-xy "ne" says
    "A": (0.0, 0.0, 10.0),
    "B": (120.0, 5.0, 12.0),
    "C & D": (60.0, 90.0, 14.0),
    'P"1"': (50.0, 30.0, 11.0),
    "Q,2": (80.0, 50.0, 13.0),
    "far": (200.0, 40.0, 15.0),
}
SIGHTED = [name for name in TRUTH if name != "far"]


def gkf(seed=5):
    """A small network of every kind that GNU Gama knows, x north and y east; `far` hangs on one polar observation."""
    rng = np.random.default_rng(seed)
    xyz = {name: np.array(value) for name, value in TRUTH.items()}

    def polar(a, b):
        d = xyz[b] - xyz[a]
        azimuth, length = np.arctan2(d[1], d[0]) % (2 * np.pi), np.linalg.norm(d)
        return azimuth / GON, np.arccos(d[2] / length) / GON, length

    def tag(name):
        return name.replace("&", "&amp;").replace('"', "&quot;")

    lines = [
        '<gama-local xmlns="http://www.gnu.org/software/gama/gama-local"><network axes-xy="ne" angles="left-handed">'
    ]
    lines += ['<description>every kind</description><parameters sigma-apr="1" />', "<points-observations>"]
    for name, (x, y, z) in TRUTH.items():
        role = 'fix="xyz"' if name in "AB" else 'adj="xyz"'
        lines.append(f"<point id='{tag(name)}' x='{x}' y='{y}' z='{z}' {role} />")
    for number, start in enumerate(("A", "B")):
        lines.append(f'<obs from="{start}">')
        for name in [*(n for n in SIGHTED if n != start), *(["far"] if start == "B" else [])]:
            azimuth, zenith, length = polar(start, name)
            turned = (azimuth - 70.0 * (number + 1) + rng.normal(0, 5e-4)) % 400.0
            zenith, length = zenith + rng.normal(0, 5e-4), length + rng.normal(0, 1e-3)
            lines.append(f"<direction to='{tag(name)}' val='{turned:.6f}' stdev='5' />")
            lines.append(f"<z-angle to='{tag(name)}' val='{zenith:.6f}' stdev='5' />")
            lines.append(f"<s-distance to='{tag(name)}' val='{length:.6f}' stdev='1' />")
        lines.append("</obs>")
    angle = (polar("C & D", "A")[0] - polar("C & D", "B")[0]) % 400.0 + rng.normal(0, 5e-4)
    level = np.hypot(*(xyz["Q,2"] - xyz["C & D"])[:2]) + rng.normal(0, 2e-3)
    azimuth = polar("C & D", 'P"1"')[0] + rng.normal(0, 1e-3)
    lines.append("<obs from='C &amp; D'>")
    lines.append(f"<angle bs='B' fs='A' val='{angle:.6f}' stdev='5' />")
    lines.append(f"<distance to='Q,2' val='{level:.6f}' stdev='2' />")
    lines.append(f"<azimuth to='P&quot;1&quot;' val='{azimuth:.6f}' stdev='10' /></obs>")
    rise = xyz["Q,2"][2] - xyz["A"][2] + rng.normal(0, 1e-3)
    lines.append(f"<height-differences><dh from='A' to='Q,2' val='{rise:.6f}' stdev='1' /></height-differences>")
    covariance = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.4], [0.5, -0.4, 2.0]])
    upper = "4 1 0.5 3 -0.4 2"
    dx, dy, dz = xyz["Q,2"] - xyz['P"1"'] + 1e-3 * rng.multivariate_normal(np.zeros(3), covariance)
    lines.append(f"<vectors><vec from='P&quot;1&quot;' to='Q,2' dx='{dx:.6f}' dy='{dy:.6f}' dz='{dz:.6f}' />")
    lines.append(f"<cov-mat dim='3' band='2'>{upper}</cov-mat></vectors>")
    x, y, z = xyz["Q,2"] + 1e-3 * rng.multivariate_normal(np.zeros(3), covariance)
    lines.append(f"<coordinates><point id='Q,2' x='{x:.6f}' y='{y:.6f}' z='{z:.6f}' />")
    lines.append(f"<cov-mat dim='3' band='2'>{upper}</cov-mat></coordinates>")
    return "\n".join([*lines, "</points-observations></network></gama-local>"])


def no_constant(text):
    raise AssertionError(f"{text} is no JSON")


def read_json(pieces):
    return json.loads("".join(pieces), parse_constant=no_constant)


def read_csv(pieces):
    return list(csv.DictReader(io.StringIO("".join(pieces))))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("every") / "every.gkf"
    file.write_text(gkf(), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def solution(path):
    solved = adjust_network(read_gama(path))
    assert solved.status == "converged"
    return solved


@pytest.fixture(scope="module")
def found(solution):
    return adjusted_network(solution)


@pytest.fixture(scope="module")
def floating(solution):
    """The same without the one distance to `far`."""
    network = solution.network
    active = [np.ones(len(g.observed), dtype=bool) for g in network.groups]
    at = network.points.names.index("far")
    for group, on in zip(network.groups, active, strict=True):
        if group.kind == "slope_distance":
            on[group.ends[1] == 3 * at] = False
    return adjusted_network(adjust_network(network, active=active))


@pytest.fixture(scope="module")
def ranging():
    return adjusted_network(adjust_network(read_network_folder(NETWORKS / "ranging-18x500")))


@pytest.mark.parametrize("lines", [False, True])
def test_json_pieces_form_the_complete_object(found, ranging, floating, lines):
    for each in (found, ranging, floating):
        assert read_json(network_json(each, lines=lines)) == network_object(each)
    assert len(list(network_json(ranging))) > len(list(network_json(found)))  # 9000 rows come in pieces
    assert all("\n" not in piece for piece in network_json(found))


def test_json_of_adjust_has_its_documented_keys(found):
    told = network_object(found)
    assert {"points", "variance_factor", "degrees_of_freedom", "observations", "suspects", "status"} <= told.keys()
    for row in told["observations"]:
        assert {"kind", "from", "to", "residual", "standardised", "redundancy", "mdb"} <= row.keys()
    assert told["points"].keys() == TRUTH.keys()
    assert np.shape(told["points"]["Q,2"]["covariance"]) == (3, 3)


def test_coordinates_and_covariances_are_in_the_axes_of_the_file(found, solution):
    points = network_object(found)["points"]
    row = solution.index["C & D"]
    for name, truth in TRUTH.items():
        assert [points[name][k] for k in "xyz"] == pytest.approx(truth, abs=0.01)
    assert points["C & D"]["covariance"][0][0] == solution.covariance[row, 1, 1]  # x of the file is north
    assert points["C & D"]["covariance"][0][2] == solution.covariance[row, 1, 2]
    assert points["A"]["fixed"] == ["x", "y", "z"]


@pytest.mark.parametrize(
    ("folder", "phase", "scaled"), [("baumann3d", "", True), ("monitoring", "-phase-0-1TK", False)]
)
def test_printed_answers_of_other_programs_come_out_in_every_format(folder, phase, scaled):
    source = NETWORKS / folder / (f"{phase.removeprefix('-')}.gkf" if phase else "network.gkf")
    found = adjusted_network(adjust_network(read_gama(source)), scaled=scaled)
    points, tags = network_object(found)["points"], {"c": f"{{{NAMESPACE}}}"}
    root = ElementTree.fromstring("".join(network_xml(found)))
    adjusted = {p.find("{*}id").text: p for p in root.iterfind("{*}coordinates/{*}adjusted/{*}point")}
    table = {row["point"]: row for row in read_csv(coordinates_csv(found))}
    assert tags["c"] in root.tag
    with (NETWORKS / folder / f"expected{phase}.csv").open(encoding="utf-8") as stream:
        expected = list(csv.DictReader(stream))
    assert expected
    for row in expected:
        name = row["id"]
        for k in "xyz":
            value = float(row[k])
            assert points[name][k] == pytest.approx(value, abs=1e-6)
            assert float(table[name][f"{k}_m"]) == pytest.approx(value, abs=1e-6)
            coordinate = [e.text for e in adjusted[name] if e.tag.lower() == f"{tags['c']}{k}".lower()]
            assert float(coordinate[0]) == pytest.approx(value, abs=1e-6)
            at = "xyz".index(k)
            u = float(row[f"s{k}_mm"])
            assert 1e3 * points[name]["covariance"][at][at] ** 0.5 == pytest.approx(u, rel=3e-4)
            assert float(table[name][f"u_{k}_mm"]) == pytest.approx(u, rel=3e-4)


def test_a_component_has_the_sign_and_the_name_of_the_file(found):
    told = network_object(found)
    points, kinds = told["points"], set()
    for row in told["observations"]:
        if row["kind"] not in ("vector", "coordinates"):
            continue
        start = points[row["from"]][row["component"]] if row["kind"] == "vector" else 0.0
        end = points[row["to"] if row["kind"] == "vector" else row["from"]][row["component"]]
        assert row["residual"] == pytest.approx(row["observed"] - (end - start), abs=1e-12)
        kinds.add((row["kind"], row["component"]))
    assert len(kinds) == 6


def test_turned_axes_turn_a_component_with_all_that_follows_it(solution):
    """The same answer told in axes x west, y south: every difference changes its sign, height does not."""
    turned = replace(solution, network=replace(solution.network, axes=np.diag([-1.0, -1.0, 1.0])))
    straight = replace(solution, network=replace(solution.network, axes=np.eye(3)))
    a, b = (network_object(adjusted_network(s))["observations"] for s in (straight, turned))
    for one, other in zip(a, b, strict=True):
        sign = -1.0 if one.get("component") in ("x", "y") else 1.0
        for key in ("observed", "residual", "standardised", "estimated_error", "test"):
            if one[key] is not None:
                assert other[key] == sign * one[key]
        assert (other["mdb"], other["u"], other["p"]) == (one["mdb"], one["u"], one["p"])


EIGHT = {  # where east and north stand in x and y, by GNU Gama's names of the axes
    "ne": [[0, 1], [1, 0]],
    "sw": [[0, -1], [-1, 0]],
    "es": [[1, 0], [0, -1]],
    "wn": [[-1, 0], [0, 1]],
    "en": [[1, 0], [0, 1]],
    "nw": [[0, -1], [1, 0]],
    "se": [[0, 1], [-1, 0]],
    "ws": [[-1, 0], [0, -1]],
}


@pytest.mark.parametrize("name", EIGHT)
def test_covariances_follow_the_coordinates_into_any_axes(solution, name):
    axes = np.eye(3)
    axes[:2, :2] = EIGHT[name]
    found = adjusted_network(replace(solution, network=replace(solution.network, axes=axes)))
    points = network_object(found)["points"]
    row = solution.index["Q,2"]
    point, expected = points["Q,2"], axes.T @ solution.covariance[row] @ axes
    np.testing.assert_allclose([point[k] for k in "xyz"], axes.T @ solution.x[row], rtol=1e-15)
    np.testing.assert_allclose(point["covariance"], expected, rtol=1e-12)
    semi, directions = (np.array(point["ellipsoid"][k]) for k in ("semi_axes", "directions"))
    np.testing.assert_allclose((directions.T * semi**2) @ directions, expected, atol=1e-9 * expected.max())
    root = ElementTree.fromstring("".join(network_xml(found)))
    assert root.find("{*}network-general-parameters").get("axes-xy") == name
    full = np.zeros((14, 14))
    full[np.triu_indices(14)] = [float(e.text) for e in root.iterfind("{*}coordinates/{*}cov-mat/{*}flt")]
    at = 3 * [p.find("{*}id").text for p in root.iterfind("{*}coordinates/{*}adjusted/*")].index("Q,2")
    np.testing.assert_allclose(full[at : at + 3, at : at + 3], 1e6 * np.triu(expected), rtol=1e-8)
    # an orientation runs from x towards y, as its coordinates do: here seen as its covariance with a point's x
    offset = next(i for i, p in enumerate(solution.network.parameters) if p.name.startswith("orientation A"))
    column = np.array([*(3 * row + np.arange(3)), 3 * len(solution.x) + offset])
    with_turn = axes.T @ solution.q.within(column)[:3, 3] * -np.linalg.det(axes)
    np.testing.assert_allclose(full[at : at + 3, 12], 1e3 * 1e4 / GON * with_turn, rtol=1e-7)


def test_observations_are_in_file_order(found):
    places = [row["place"] for row in network_object(found)["observations"]]
    lines = [int(place.split()[-1]) for place in places]
    assert lines == sorted(lines)
    assert len(set(found.table.kind)) > 6  # though kinds are solved group by group


def test_a_planted_blunder_is_the_first_suspect_with_its_sign_and_size(solution):
    network = solution.network
    group = next(g for g in network.groups if g.kind == "slope_distance")
    wrong = group.observed.copy()
    wrong[2] += 0.03
    groups = tuple(replace(g, observed=wrong) if g is group else g for g in network.groups)
    told = network_object(adjusted_network(adjust_network(replace(network, groups=groups))))
    row = told["observations"][told["suspects"][0]]
    assert (row["kind"], row["observed"]) == ("slope_distance", wrong[2])
    assert row["estimated_error"] == pytest.approx(0.03, abs=0.006)
    assert (
        row["p"]
        < 0.05
        < min(r["p"] for i, r in enumerate(told["observations"]) if r["p"] and i not in told["suspects"])
    )


def test_excluded_rows_are_named_by_their_number_in_the_file(solution):
    network = solution.network
    group = next(g for g in network.groups if g.kind == "vector")
    wrong = group.observed.copy()
    wrong[1] += 0.05  # y here, which the file calls x
    groups = tuple(replace(g, observed=wrong) if g is group else g for g in network.groups)
    found = adjusted(replace(network, groups=groups), AdjustmentOptions(reject=True))
    told = network_object(found)
    assert read_json(network_json(found)) == told
    assert told["treatment"]["method"] == "rejected"
    out = told["treatment"]["rejected"]
    (mine,) = [r for r in told["treatment"]["rejections"] if told["observations"][r["observation"]]["component"] == "x"]
    row = told["observations"][mine["observation"]]
    assert mine["observation"] in out
    assert (row["kind"], row["active"], row["weight"]) == ("vector", False, 0.0)
    assert mine["estimated_error"] == pytest.approx(0.05, abs=0.01)
    assert all(r["weight"] == 1.0 for i, r in enumerate(told["observations"]) if i not in out)
    said = treatment_passages(found)
    assert f"x of {found.label(mine['observation']).removeprefix('x of ')}" in said[0].text


def test_unchecked_observation_has_no_statistics(found):
    told = network_object(found)
    far = [row for row in told["observations"] if row["to"] == "far"]
    assert len(far) == 3
    for row in far:
        assert row["checked"] is False
        assert [row[k] for k in ("standardised", "mdb", "estimated_error", "bias_to_noise", "test", "p")] == [None] * 6
        assert row["redundancy"] == pytest.approx(0.0, abs=1e-9)
    assert [told["observations"][i] for i in told["unchecked"]] == far


def test_without_a_solution_there_are_no_claims(floating):
    told = network_object(floating)
    assert told["status"].startswith("rank deficient")
    assert told["points"]["Q,2"]["covariance"] == [[None] * 3] * 3
    assert told["chi_square"]["passed"] is None
    assert told["suspects"] == []
    for row in told["observations"]:
        assert not row["checked"]
        assert [row[k] for k in ("redundancy", "standardised", "mdb", "p")] == [None] * 4
    root = ElementTree.fromstring("".join(network_xml(floating)))
    assert [child.tag for child in root] == [f"{{{NAMESPACE}}}error"]
    assert root[0][0].text == told["status"]


def test_global_test_refers_to_the_a_priori_value(found):
    test, degrees = network_object(found)["chi_square"], found.solution.degrees_of_freedom
    assert test["lower"] == pytest.approx(chi2.ppf(0.025, degrees), rel=1e-9)
    assert test["upper"] == pytest.approx(chi2.ppf(0.975, degrees), rel=1e-9)
    assert test["statistic"] == pytest.approx(sum(f.pvv for f in found.solution.fits), rel=1e-9)
    assert test["passed"] is (test["lower"] <= test["statistic"] <= test["upper"])


def test_variance_factor_is_applied_on_request_and_reported(solution, found):
    scaled = adjusted_network(solution, scaled=True)
    told, plain = network_object(scaled), network_object(found)
    factor = told["variance_factor"]
    assert (told["scaled"], plain["scaled"], told["critical"]["test"]) == (True, False, "tau")
    for name in ("Q,2", "far"):
        expected = factor * np.array(plain["points"][name]["covariance"])
        np.testing.assert_allclose(told["points"][name]["covariance"], expected, rtol=1e-12)
    (name,) = [n for n in told["parameters"] if n.startswith("orientation A")]
    assert told["parameters"][name]["u"] == pytest.approx(factor**0.5 * plain["parameters"][name]["u"])


def test_an_unknown_variance_factor_is_not_applied(solution):
    with pytest.raises(EstimationError, match="variance factor is unknown"):
        adjusted_network(replace(solution, variance_factor=float("nan"), degrees_of_freedom=0.0), scaled=True)


def test_tables_agree_with_json(found):
    told = network_object(found)
    for row in read_csv(coordinates_csv(found)):
        point = told["points"][row["point"]]
        assert [float(row[f"{k}_m"]) for k in "xyz"] == pytest.approx([point[k] for k in "xyz"], abs=1e-10)
        c = 1e6 * np.array(point["covariance"])
        listed = [float(row[f"cov_{k}_mm2"]) for k in ("xx", "xy", "xz", "yy", "yz", "zz")]
        assert listed == pytest.approx(c[np.triu_indices(3)], rel=1e-8, abs=1e-12)
        axes = [float(row[f"semi_axis_{k}_mm"]) for k in (1, 2, 3)]
        assert sorted(axes) == pytest.approx(np.sqrt(np.abs(np.linalg.eigvalsh(c))), abs=1e-6)
    rows = read_csv(observations_csv(found))
    assert [int(row["number"]) for row in rows] == list(range(len(rows)))
    for row, other in zip(rows, told["observations"], strict=True):
        for key in ("kind", "from", "to", "place", "unit"):
            assert row[key] == (other[key] or "")
        for key in ("observed", "residual", "u", "redundancy", "mdb", "p"):
            if other[key] is None:
                assert row[key] == ""
            else:
                assert float(row[key]) == pytest.approx(other[key], rel=1e-5, abs=1e-12)
        assert (row["checked"] == "yes") is other["checked"]
    for row in read_csv(parameters_csv(found)):
        assert float(row["value"]) == pytest.approx(told["parameters"][row["parameter"]]["value"], rel=1e-12)


def test_worst_first_is_worst_first(found):
    rows = read_csv(observations_csv(found, worst_first=True))
    tested = [abs(float(row["standardised"])) for row in rows if row["standardised"]]
    assert tested == sorted(tested, reverse=True)
    assert all(not row["standardised"] for row in rows[len(tested) :])
    assert sorted(int(row["number"]) for row in rows) == list(range(len(rows)))


ORDER = {  # of the elements, as gama-local-adjustment.xsd prescribes it
    "gama-local-adjustment": "description network-general-parameters network-processing-summary coordinates "
    "observations",
    "network-processing-summary": "coordinates-summary observations-summary project-equations standard-deviation",
    "observations-summary": "distances directions angles xyz-coords h-diffs z-angles s-dists vectors azimuths",
    "project-equations": "equations unknowns degrees-of-freedom defect sum-of-squares connected-network",
    "standard-deviation": "apriori aposteriori used probability ratio lower upper passed confidence-scale",
    "coordinates": "fixed approximate adjusted orientation-shifts cov-mat original-index",
    "orientation": "id approx adj",
    "direction": "from to obs adj stdev qrr f std-residual err-obs err-adj",
    "angle": "from left right obs adj stdev qrr f std-residual err-obs err-adj",
    "dx": "from to obs adj stdev qrr f std-residual",
    "coordinate-y": "id obs adj stdev qrr f std-residual",
}


@pytest.fixture(scope="module")
def root(found):
    return ElementTree.fromstring("".join(network_xml(found)))


def number(element, name):
    return float(element.find(f"{{*}}{name}").text)


def test_xml_has_the_elements_of_the_schema_in_their_order(root):
    for tag, order in ORDER.items():
        element = next(e for e in root.iter() if e.tag == f"{{{NAMESPACE}}}{tag}")
        assert [child.tag.split("}")[1] for child in element] == order.split()
    equations = next(root.iter(f"{{{NAMESPACE}}}project-equations"))
    counts = {child.tag.split("}")[1]: child.text for child in equations}
    assert (counts["equations"], counts["unknowns"], counts["defect"]) == ("37", "14", "0")
    assert int(counts["degrees-of-freedom"]) == 37 - 14
    general = root.find("{*}network-general-parameters")
    assert (general.get("axes-xy"), general.get("angles")) == ("ne", "left-handed")


def test_adjusted_observations_in_xml_follow_from_its_own_coordinates(root):
    """Plain geometry, x north and y east, gon: nothing of the adjustment is used."""
    xyz = {}
    for point in (*root.iterfind("{*}coordinates/{*}fixed/*"), *root.iterfind("{*}coordinates/{*}adjusted/*")):
        xyz[point.find("{*}id").text] = np.array([number(point, k) for k in "xyz"])
    shift = {e.find("{*}id").text: number(e, "adj") for e in root.iterfind("{*}coordinates/{*}orientation-shifts/*")}

    def azimuth(a, b):
        return np.arctan2(xyz[b][1] - xyz[a][1], xyz[b][0] - xyz[a][0]) / GON

    seen = set()
    for element in root.find("{*}observations"):
        tag, adj = element.tag.split("}")[1], number(element, "adj")
        ends = [e.text for e in element if e.tag.split("}")[1] in ("from", "to", "left", "right", "id")]
        d = xyz[ends[-1]] - xyz[ends[0]]
        turning = tag in ("direction", "angle", "azimuth")
        expected = {
            "direction": lambda a, b: azimuth(a, b) - shift[a],
            "azimuth": azimuth,
            "angle": lambda a, b, c: azimuth(a, c) - azimuth(a, b),
            "slope-distance": lambda *_: np.linalg.norm(d),  # noqa: B023
            "distance": lambda *_: np.hypot(*d[:2]),  # noqa: B023
            "zenith-angle": lambda *_: np.arccos(d[2] / np.linalg.norm(d)) / GON,  # noqa: B023
            "height-diff": lambda *_: d[2],  # noqa: B023
            **{f"d{k}": lambda *_, i=i: d[i] for i, k in enumerate("xyz")},  # noqa: B023
            **{f"coordinate-{k}": lambda a, i=i: xyz[a][i] for i, k in enumerate("xyz")},
        }[tag](*ends)
        off = (adj - expected + 200.0) % 400.0 - 200.0 if turning else adj - expected
        assert off == pytest.approx(0.0, abs=2e-7)
        seen.add(tag)
    assert len(seen) == 13


def test_uncertainties_in_xml_are_those_of_gama(root, found):
    """stdev of the adjusted value and qrr of the residual share the observed variance; an error has v's sign."""
    table = found.table
    for element, row in zip(root.find("{*}observations"), range(len(table)), strict=True):
        unit = GON * 1e-4 if table.unit[row] == "rad" else 1e-3
        stdev, qrr, f = (number(element, k) for k in ("stdev", "qrr", "f"))
        sigma = table.u[row] / unit
        assert stdev**2 + qrr == pytest.approx(sigma**2, rel=1e-5)
        assert f == pytest.approx(100.0 * (1.0 - stdev / sigma), abs=6e-4)
        if element.find("{*}std-residual") is not None and table.checked[row]:
            assert number(element, "std-residual") == pytest.approx(
                abs(table.residual[row]) / unit / qrr**0.5, rel=0.01, abs=6e-4
            )
        if element.find("{*}err-obs") is not None:
            assert number(element, "err-obs") == pytest.approx(-table.estimated_error[row] / unit, rel=1e-4, abs=1e-5)
            v = (number(element, "adj") - number(element, "obs") + 200.0) % 400.0 - 200.0
            v *= 1e4 if table.unit[row] == "rad" else 1e3
            assert number(element, "err-obs") - number(element, "err-adj") == pytest.approx(v, abs=2e-3)


def test_correlated_observations_in_xml_have_their_own_adjusted_variance(root, found):
    """A Q A' by hand: the adjusted coordinate's own variance is that of the observation of it."""
    points = network_object(found)["points"]
    for k, axis in enumerate("xyz"):
        (element,) = root.iterfind(f"{{*}}observations/{{*}}coordinate-{axis}")
        u = 1e3 * points["Q,2"]["covariance"][k][k] ** 0.5
        assert number(element, "stdev") == pytest.approx(u, rel=1e-5)


def test_the_covariance_matrix_in_xml_is_that_of_the_coordinates_as_written(root, found, solution):
    dim, band = (int(root.find(f"{{*}}coordinates/{{*}}cov-mat/{{*}}{k}").text) for k in ("dim", "band"))
    assert (dim, band) == (14, 13)  # four points, two orientations
    full = np.zeros((dim, dim))
    full[np.triu_indices(dim)] = [float(e.text) for e in root.iterfind("{*}coordinates/{*}cov-mat/{*}flt")]
    names = [p.find("{*}id").text for p in root.iterfind("{*}coordinates/{*}adjusted/*")]
    told = network_object(found)
    for i, name in enumerate(names):
        expected = 1e6 * np.array(told["points"][name]["covariance"])
        np.testing.assert_allclose(full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], np.triu(expected), rtol=1e-8, atol=1e-12)
    u = [p["u"] / GON * 1e4 for n, p in told["parameters"].items() if n.startswith("orientation")]
    assert np.sqrt(np.diag(full)[-2:]) == pytest.approx(u, rel=1e-8)
    a, b = solution.index[names[0]], solution.index[names[1]]
    joint = solution.block([names[0], names[1]])
    assert (a, b) != (0, 1)
    assert full[0, 4] == pytest.approx(1e6 * joint[1, 3], rel=1e-8)  # north of one with east of the other


def test_a_large_network_has_variances_alone_in_xml(ranging):
    root = ElementTree.fromstring("".join(network_xml(ranging)))
    matrix = root.find("{*}coordinates/{*}cov-mat")
    assert [int(number(matrix, k)) for k in ("dim", "band")] == [1554, 0]
    values = np.array([float(e.text) for e in matrix.iterfind("{*}flt")])
    np.testing.assert_allclose(values.reshape(-1, 3), 1e6 * ranging.u**2, rtol=1e-8)
    assert len(root.find("{*}observations")) == 9000


def test_no_name_breaks_a_file(solution):
    points = solution.network.points
    odd = ('a<b>&"c"', "x,\n2", "bell\x07", "ü", *points.names[4:])
    network = replace(solution.network, points=replace(points, names=odd), description="]]> <!-- --> \x00")
    strange = adjusted_network(replace(solution, network=network))
    assert list(read_json(network_json(strange))["points"]) == list(odd)
    assert [row["point"] for row in read_csv(coordinates_csv(strange))] == list(odd)
    root = ElementTree.fromstring("".join(network_xml(strange)))
    ids = [e.text for e in root.iterfind("{*}coordinates//{*}point/{*}id")]
    assert {"bell\ufffd", "ü", 'a<b>&"c"'} <= set(ids)


def test_every_file_is_written_and_its_hash_kept(found, path, tmp_path):
    steps = []
    write_network(found, tmp_path, input_hashes(path), progress=lambda what, done, of: steps.append((what, done, of)))
    provenance = json.loads((tmp_path / "provenance.json").read_text(encoding="utf-8"))
    outputs = provenance["outputs"]
    assert set(outputs) | {"provenance.json"} == {f.name for f in tmp_path.iterdir()}
    for name, digest in outputs.items():
        assert hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() == digest
    assert provenance["inputs_sha256"] == {"every.gkf": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert read_json([(tmp_path / "adjustment.json").read_text(encoding="utf-8")]) == network_object(found)
    assert steps[-1] == ("writing", len(outputs), len(outputs))
    assert "in coordinates.csv" in texts(read((tmp_path / "report.html").read_text(encoding="utf-8")))


def test_a_folder_is_hashed_by_its_tables():
    folder = NETWORKS / "ranging-18x500"
    hashes = input_hashes(folder)
    assert {"points.csv", "ranges.csv"} <= hashes.keys()
    assert hashes["ranges.csv"] == hashlib.sha256((folder / "ranges.csv").read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def compared(tmp_path_factory, solution):
    """A second epoch in which Q,2 went 30 mm north, 20 mm west and 10 mm up; A and B are held, the rest stayed."""
    truth = TRUTH["Q,2"]
    TRUTH["Q,2"] = (truth[0] + 0.03, truth[1] - 0.02, truth[2] + 0.01)
    file = tmp_path_factory.mktemp("second") / "second.gkf"
    file.write_text(gkf(seed=6), encoding="utf-8")
    TRUTH["Q,2"] = truth
    second = adjust_network(read_gama(file))
    names = [n for n in solution.network.points.names if n != "far"]
    moved = compare(solution, second, points=names)
    return ComparedEpochs(adjusted_network(solution), adjusted_network(second), moved)


def test_movements_are_in_the_axes_of_the_file(compared):
    told = read_json([json.dumps(comparison_object(compared))])
    assert told["moved"] == ["Q,2"]
    point = told["points"]["Q,2"]
    assert point["displacement"] == pytest.approx([0.03, -0.02, 0.01], abs=0.004)
    assert point["p"] < 1e-6
    assert point["u"] == pytest.approx(np.sqrt(np.diag(point["covariance"])))
    assert told["points"]["A"]["verdict"] == "held"
    assert told["points"]["A"]["displacement"] == [0.0, 0.0, 0.0]
    assert set(told["stable"]) == {"C & D", 'P"1"'}
    assert told["congruence"]["all"]["p"] < 1e-6 < told["congruence"]["stable"]["p"]
    assert told["variance_factor_degrees_of_freedom"] is None
    i, j = (f.names.index("Q,2") for f in (compared.first, compared.second))
    plain = compared.second.x[j] - compared.first.x[i]  # A and B are held in both epochs: one datum
    assert point["difference"] == pytest.approx(plain, abs=1e-9)
    said = {p.title: p.text for p in comparison_passages(compared)}
    assert "Q,2" in said["Movements"]
    assert f"dx {1e3 * point['displacement'][0]:+.3f}" in said["Q,2"]
    rows = {row["point"]: row for row in read_csv(displacements_csv(compared))}
    assert float(rows["Q,2"]["dx_mm"]) == pytest.approx(1e3 * point["displacement"][0], abs=1e-6)
    assert float(rows["Q,2"]["length_mm"]) == pytest.approx(1e3 * np.linalg.norm(point["displacement"]), abs=1e-6)
    assert rows["Q,2"]["verdict"] == "moved"


def test_a_coordinate_not_compared_is_unknown_not_zero(compared):
    deformation = replace(
        compared.deformation,
        displacement=np.where(np.arange(3) < 2, np.nan, compared.deformation.displacement),
    )
    partly = replace(compared, moved=replace(compared.moved, deformation=deformation))
    point = comparison_object(partly)["points"]["Q,2"]
    assert point["displacement"][:2] == [None, None]
    assert point["length"] == pytest.approx(abs(point["displacement"][2]))


def test_files_of_two_epochs_are_in_one_directory(compared, tmp_path):
    write_comparison(compared, tmp_path, {"first.gkf": "0" * 64, "second.gkf": "1" * 64})
    names = {f.name for f in tmp_path.iterdir()}
    assert {"displacements.csv", "comparison.json", "report.html", "epoch-1-coordinates.csv"} <= names
    assert {"epoch-2-adjustment.json", "epoch-2-report.html", "provenance.json"} <= names
    outputs = json.loads((tmp_path / "provenance.json").read_text(encoding="utf-8"))["outputs"]
    assert set(outputs) | {"provenance.json"} == names
    assert "in epoch-1-coordinates.csv" in texts(read((tmp_path / "epoch-1-report.html").read_text(encoding="utf-8")))


# Units: each number is the one in memory over the unit in its column's name ------------------------------------------


def test_every_column_of_the_coordinates_has_the_unit_of_its_name(found):
    network = found.network
    plan_axes = np.linalg.eigvalsh(found.solution.covariance[:, :2, :2] * found.factor) ** 0.5
    told = {
        "point": lambda i: found.names[i],
        **{f"{'xyz'[a]}_m": lambda i, a=a: found.x[i, a] for a in range(3)},
        **{f"u_{'xyz'[a]}_mm": lambda i, a=a: found.covariance[i, a, a] ** 0.5 for a in range(3)},
        **{
            f"cov_{'xyz'[a]}{'xyz'[b]}_mm2": lambda i, a=a, b=b: found.covariance[i, a, b]
            for a in range(3)
            for b in range(a, 3)
        },
        **{f"semi_axis_{k + 1}_mm": lambda i, k=k: found.ellipsoid.semi_axes[i, k] for k in range(3)},
        "u_position_mm": lambda i: np.linalg.norm(found.u[i]),
        "ellipse_major_mm": lambda i: plan_axes[i, 1],
        "ellipse_minor_mm": lambda i: plan_axes[i, 0],
        "ellipse_bearing_deg": lambda i: found.ellipse.bearing[i],
        "fixed": lambda i: "x y z" if network.points.fixed[i].all() else "",
        "datum": lambda i: "",
        "observations": lambda i: found.observation_counts[i],
    }
    largest = np.linalg.eigvalsh(found.covariance)[:, -1] ** 0.5
    np.testing.assert_allclose(np.max(found.ellipsoid.semi_axes, axis=1), largest, rtol=1e-6)  # m, of the ellipsoid
    assert_columns(coordinates_csv(found), told, range(len(found.names)), silent={"datum"})


def test_every_column_of_the_observations_is_si_as_its_unit_says(found):
    rows, names, suspects = found.table, (*found.names, ""), set(found.suspects.tolist())

    def word(flags):
        return lambda i: "yes" if flags[i] else "no"

    told = {
        "number": lambda i: i,
        "kind": lambda i: rows.kinds[rows.kind[i]],
        **{role: lambda i, k=k: names[rows.ends[i, k]] for k, role in enumerate(("from", "to", "third", "fourth"))},
        "component": lambda i: str(rows.component[i]),
        "unit": lambda i: "m" if rows.kinds[rows.kind[i]] in LENGTHS else "rad",
        "observed": lambda i: rows.observed[i],
        "u": lambda i: rows.u[i],
        "residual": lambda i: rows.residual[i],
        "standardised": lambda i: rows.standardised[i],
        "redundancy": lambda i: rows.redundancy[i],
        "mdb": lambda i: rows.mdb[i],
        "estimated_error": lambda i: rows.estimated_error[i],
        "bias_to_noise": lambda i: rows.bias_to_noise[i],
        "effect": lambda i: rows.effect[i],
        "test": lambda i: found.statistic[i],
        "p": lambda i: found.p[i],
        "suspect": lambda i: "yes" if i in suspects else "no",
        "active": word(rows.active),
        "checked": word(rows.checked),
        "group": lambda i: found.network.groups[rows.group[i]].name,
        "place": lambda i: found.network.places[rows.group[i]][rows.row[i]],
    }
    assert_columns(observations_csv(found), told, range(len(rows)), silent={"fourth"})


def test_every_column_of_the_parameters_is_si_as_its_unit_says(found):
    told = {
        "parameter": lambda k: found.network.parameters[k].name,
        "unit": lambda k: found.network.parameters[k].unit,
        "value": lambda k: found.solution.parameters[k],
        "u": lambda k: found.u_parameters[k],
        "prior_u": lambda k: found.network.parameters[k].sigma,
    }
    rows = range(len(found.network.parameters))
    assert_columns(parameters_csv(found), told, rows, silent={"prior_u"})  # orientations are free


def test_every_column_of_the_displacements_has_the_unit_of_its_name(compared):
    d, axes = compared.deformation, range(3)
    told = {
        "point": lambda i: d.names[i],
        **{f"{'xyz'[a]}_m": lambda i, a=a: compared.first.x[compared.rows[i], a] for a in axes},
        **{f"d{'xyz'[a]}_mm": lambda i, a=a: compared.displacement[i, a] for a in axes},
        "length_mm": lambda i: np.linalg.norm(compared.displacement[i]),
        **{f"u_d{'xyz'[a]}_mm": lambda i, a=a: compared.covariance[i, a, a] ** 0.5 for a in axes},
        **{f"plain_d{'xyz'[a]}_mm": lambda i, a=a: compared.difference[0][i, a] for a in axes},
        "statistic": lambda i: d.statistic[i],
        "p": lambda i: d.p[i],
        "p_adjusted": lambda i: d.p_adjusted[i],
        "detectable_mm": lambda i: d.detectable[i],
        "verdict": lambda i: compared.verdicts[i],
    }
    assert_columns(displacements_csv(compared), told, range(len(d.names)))


def test_every_column_of_further_ranges_has_the_unit_of_its_name():
    rows = [Candidate("S1", 'P"1"', 2.5e-4, 1.25e-4, 3.5e-6), Candidate("S2", "Q,2", 1.5e-4, 1.1e-4, 4.5e-6, 12.5)]
    plan = SimpleNamespace(plan=SimpleNamespace(candidates=rows[:1]), picked=rows[1:])
    told = {
        "list": lambda c: "schedule" if c is rows[1] else "candidate",
        "from": lambda c: c.from_,
        "to": lambda c: c.to,
        "u_mm": lambda c: c.u,
        "mean_u_mm": lambda c: c.mean_u,
        "gain_um": lambda c: c.gain,
        "at_s": lambda c: c.at_s,
    }
    assert_columns(candidates_csv(plan.plan.candidates, plan.picked), told, rows)
