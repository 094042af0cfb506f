"""The reports of a network and of two epochs stand alone, say the truth in plain words, and trust no name."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.quiver import Quiver
from scipy.stats import chi2

from catseye.estimation.deformation.comparison import compare
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.quality.ellipsoid import PLAN, elevation_view
from catseye.gateways.network import comparison_figures as comparison
from catseye.gateways.network import figures
from catseye.gateways.network import report as report_module
from catseye.gateways.network import report_charts as charts_module
from catseye.gateways.network.comparison_report import comparison_report
from catseye.gateways.network.report import network_report
from catseye.gateways.network.summary import direction_words
from catseye.gateways.writers.report_page import report_page
from catseye.records.network.folder import read_network_folder
from catseye.records.network.gama import read_gama
from catseye.reduction.network.adjusted import adjusted_network
from catseye.reduction.network.comparison import ComparedEpochs
from gateways.report_scene import column, read, row, texts
from repository import TESTS

NETWORKS = TESTS / "vectors" / "networks"
WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
INPUTS = {"network.gkf": "ab" * 32}


@pytest.fixture(scope="module")
def tunnel():
    return adjusted_network(adjust_network(read_gama(NETWORKS / "monitoring" / "phase-0-1TK.gkf")))


@pytest.fixture(scope="module")
def single():
    return adjusted_network(adjust_network(read_gama(NETWORKS / "baumann3d" / "network.gkf")), scaled=True)


@pytest.fixture(scope="module")
def ranging():
    return adjusted_network(adjust_network(read_network_folder(NETWORKS / "ranging-18x500")))


def with_error(found, row, error):
    """The same network adjusted again with an error in one observation of the table."""
    network, group = found.network, int(found.table.group[row])
    observed = network.groups[group].observed.copy()
    observed[found.table.row[row]] += error
    groups = tuple(replace(g, observed=observed) if i == group else g for i, g in enumerate(network.groups))
    return adjusted_network(adjust_network(replace(network, groups=groups)))


def report_of(found):
    return read(report_page(network_report(found, WHEN, INPUTS)))


def test_page_is_self_contained_and_shows_every_point_and_observation(tunnel, single):
    for found in (tunnel, single):
        report = report_of(found)
        sections = [section["id"] for section in report["sections"]]
        assert [s for s in sections if s != "description"] == [
            "network", "observations", "reliability", "points", "datum", "provenance",
        ]  # fmt: skip
        assert column(report, "points", "point") == list(found.names)
        assert len(column(report, "observations", "observation")) == len(found.table)
        assert column(report, "inputs", "value") == [INPUTS["network.gkf"]]


def test_its_numbers_are_those_of_the_network(ranging):
    report = report_of(ranging)
    places = {name: k for k, name in enumerate(ranging.names)}
    order = [places[name] for name in column(report, "points", "point")]
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(column(report, "points", axis), ranging.x[order, k], rtol=0, atol=0.51e-7)
        np.testing.assert_allclose(column(report, "points", f"u_{axis}"), 1e3 * ranging.u[order, k], rtol=6e-4)
    worst = ranging.table.worst_first
    np.testing.assert_allclose(
        column(report, "observations", "residual"), 1e3 * ranging.table.residual[worst], rtol=6e-6, atol=1e-12
    )
    np.testing.assert_allclose(
        column(report, "observations", "statistic"), ranging.statistic[worst], rtol=0, atol=0.51e-4
    )


def test_large_network_report_lists_all_worst_first(ranging):
    page = report_page(network_report(ranging, WHEN, INPUTS))
    report = read(page)
    assert len(page) < 1.5e6
    assert "All 9000, worst first." in texts(report)
    statistic = np.abs(column(report, "observations", "statistic"))
    assert (np.diff(statistic) <= 0.0).all()
    assert len(statistic) == 9000
    assert len(report["scenes"]["network"]["beams"]["value"]) == 9000


def test_the_largest_networks_report_lists_the_worst(ranging, monkeypatch):
    monkeypatch.setattr(report_module, "MOST_OBSERVATIONS", 100)
    monkeypatch.setattr(report_module, "MOST_POINTS", 200)
    monkeypatch.setattr(charts_module, "MOST_BEAMS", 300)
    report = report_of(ranging)
    said = texts(report)
    assert "The 100 worst of 9000; all are in observations.csv." in said
    assert "The 200 weakest of 518; all are in coordinates.csv." in said
    assert "The 300 worst of 9000 observed pairs." in said
    assert len(column(report, "observations", "statistic")) == 100
    longest = column(report, "points", "semi_axis_1")
    assert longest == sorted(longest, reverse=True)
    assert longest[0] == pytest.approx(1e3 * ranging.ellipsoid.semi_axes.max(), rel=1e-3)
    worst = max(abs(value) for value in report["scenes"]["network"]["beams"]["value"])
    assert worst == pytest.approx(np.abs(ranging.statistic).max(), abs=5.1e-4)
    assert len(report["charts"]["w-by-number"]["x"]["values"]) == 300


def test_a_blunder_leads_the_table_of_observations(ranging):
    found = with_error(ranging, 1234, 0.002)
    report = report_of(found)
    assert column(report, "observations", "observation")[0] == ranging.label(1234)
    assert column(report, "observations", "remark")[0] == "suspect"


def test_undetermined_network_names_what_is_undetermined(tunnel):
    points = tunnel.network.points
    loose = replace(tunnel.network, points=replace(points, datum=np.zeros_like(points.datum)))
    report = report_of(adjusted_network(adjust_network(loose)))
    assert "rank deficient" in report["verdict"]["why"] + texts(report)
    assert set(column(report, "points", "u_x")) == {None}  # no uncertainty is claimed
    assert "uncertainties are unknown" in texts(report)
    assert "covariance" not in report["scenes"]["network"]["points"]


def test_no_name_breaks_the_page(tunnel):
    points = tunnel.network.points
    odd = ("</script><script>alert(1)</script>", '"><img src=x onerror=y>', "$x^2$", *points.names[3:])
    network = replace(tunnel.network, points=replace(points, names=odd), description="<b>bold</b>", source="<i>.gkf")
    found = adjusted_network(replace(tunnel.solution, network=network))
    report = read(report_page(network_report(found, WHEN, {"<u>": "x"})))
    assert column(report, "points", "point")[:3] == list(odd[:3])


def test_the_scene_is_right_handed_whatever_the_axes_of_the_file(tunnel):
    """The tunnel's x is south and its y west: the scene is in x east, y north, z up, and says so."""
    report = report_of(tunnel)
    scene = report["scenes"]["network"]
    row = scene["points"]["name"].index("4901")
    own = tunnel.solution.index["4901"]
    assert scene["frame"] == "x east, y north, z up"
    assert [scene["points"][axis][row] for axis in "xyz"] == pytest.approx(tunnel.solution.x[own], abs=1e-7)
    assert scene["points"]["covariance"]["xx"][row] == pytest.approx(
        tunnel.solution.covariance[own][0, 0] * tunnel.factor, rel=6e-4
    )
    assert "The tables have the axes of the file." in texts(report)
    held = {scene["groups"][k] for k, name in zip(scene["points"]["group"], scene["points"]["name"], strict=True)}
    assert held <= {"station", "target", "held point", "held station"}


def test_the_scale_of_the_ellipsoids_is_drawn_as_it_is_stated(tunnel, single):
    for found in (tunnel, single):
        figure, caption = figures._view(found, None)
        stated = float(re.search(r"enlarged ([\d\u2009]+) times", caption).group(1).replace("\u2009", ""))
        assert stated == figures.enlargement(found)
        assert float(f"{stated:e}".partition("e")[0]) in (1.0, 2.0, 5.0)
        (drawn,) = (c for c in figure.axes[0].collections if isinstance(c, EllipseCollection))
        flat = PLAN @ found.solution.covariance * found.factor @ PLAN.T
        flat = flat[np.trace(flat, axis1=1, axis2=2) > 0.0]
        np.testing.assert_allclose(outlines(drawn), stated**2 * flat, atol=1e-9 * stated**2 * flat.max())
        # the bar: so many metres of ground are so many millimetres of ellipsoid
        text = next(t.get_text() for t in figure.axes[0].texts if "enlarged" in t.get_text())
        ground, _, size, unit = re.search(r"^([\d.]+) (m);.* ([\d.]+) (mm|µm)$", text).groups()
        assert float(ground) == pytest.approx(stated * float(size) * {"mm": 1e-3, "µm": 1e-6}[unit])
        assert figure.axes[0].get_aspect() == 1.0


def outlines(drawn):
    """Covariances (n, 2, 2) whose standard ellipses were drawn, from matplotlib's widths, heights and turns."""
    turn = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in drawn._angles]
    shape = [np.diag([w**2, h**2]) for w, h in zip(drawn._widths, drawn._heights, strict=True)]
    return np.array([t @ s @ t.T for t, s in zip(turn, shape, strict=True)])


def test_plan_and_elevation_are_as_wide_as_they_are_high_in_metres(tunnel):
    for bearing in (None, figures.looking(tunnel)):
        figure, _ = figures._view(tunnel, bearing)
        box, (left, right), (low, high) = (getattr(figure.axes[0], f"get_{k}")() for k in ("position", "xlim", "ylim"))
        wide, tall = figure.get_size_inches() * (box.width, box.height)
        assert (right - left) / wide == pytest.approx((high - low) / tall, rel=1e-9)


def test_the_elevation_looks_across_the_longest_extent(tunnel):
    """The tunnel runs along the file's x, which is south: it is seen from the side, towards east or west."""
    assert np.degrees(figures.looking(tunnel)) == pytest.approx(90.0, abs=4.0)


def test_ticks_read_the_coordinates_of_the_file(tunnel):
    axes = figures._view(tunnel, None)[0].axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y, west (m)", "x, south (m)")
    row = tunnel.solution.index["4901"]
    east, north = tunnel.solution.x[row, :2]
    assert float(axes.xaxis.get_major_formatter()(east, 0)) == pytest.approx(tunnel.x[row, 1], rel=1e-5)
    assert float(axes.yaxis.get_major_formatter()(north, 0)) == pytest.approx(tunnel.x[row, 0], rel=1e-5)


def test_direction_of_an_ellipsoid_in_surveyors_terms(tunnel):
    def words(*axis):
        east, north, up = axis
        covariance = np.eye(3) + 8.0 * np.outer((east, north, up), (east, north, up))
        solution = replace(tunnel.solution, covariance=np.tile(covariance, (len(tunnel.names), 1, 1)))
        return direction_words(adjusted_network(solution), 0)

    assert words(0.0, 0.0, 1.0) == "mostly in height"
    assert words(0.5, 0.5 * 3**0.5, 0.0) == "towards azimuth 30° and back"
    assert words(-1.0, 0.0, 0.0) == "towards azimuth 90° and back"
    assert words(0.0, -(0.75**0.5), 0.5) == "towards azimuth 0° and back, tilted 30°"


def test_every_figure_is_well_formed(ranging):
    drawn = figures.network_figures(ranging)
    assert drawn.keys() == {"plan", "elevation", "residuals", "redundancy"}
    for figure in drawn.values():
        assert ElementTree.fromstring(figure.svg).tag.endswith("svg")
        assert len(figure.svg) < 1e6


@pytest.fixture(scope="module")
def compared(tunnel):
    """The tunnel measured twice, by the same numbers, but 35 went 4 mm along the file's y in between."""
    names = tuple(n for n in tunnel.names if n in ("31", "32", "33", "34", "35", "41", "42", "43", "44", "45"))
    solution = tunnel.solution
    x = solution.x.copy()
    x[solution.index["35"]] += tunnel.network.axes @ (0.0, 0.004, 0.0)
    second = replace(solution, x=x)
    return ComparedEpochs(tunnel, adjusted_network(second), compare(solution, second, points=names))


def test_report_of_two_epochs_names_moved_points_and_distances(compared):
    report = read(report_page(comparison_report(compared, WHEN, INPUTS)))
    names, words = (column(report, "displacements", key) for key in ("point", "verdict"))
    moved = row(report, "displacements", "35")
    assert (moved["verdict"], moved["dy"]) == ("moved", pytest.approx(4.0, abs=1e-3))
    assert {word for name, word in zip(names, words, strict=True) if name != "35"} == {"stable"}
    assert compared.deformation.status[1:] in texts(report)
    assert "level of the tests" in column(report, "settings", "name")
    assert column(report, "epoch-1", "quantity")[0] == "Variance factor"


def test_the_scene_of_two_epochs_has_the_displacements_at_their_scale(compared):
    report = read(report_page(comparison_report(compared, WHEN, INPUTS)))
    scene = report["scenes"]["displacements"]
    groups = {
        name: scene["groups"][k] for name, k in zip(scene["points"]["name"], scene["points"]["group"], strict=True)
    }
    assert groups["35"] == "moved"
    assert set(groups.values()) == {"moved", "stable", "not compared"}
    stated = re.search(r"drawn ([\d\u2009]+) times as long", texts(report)).group(1)
    (line,) = (line for line in scene["lines"] if line["name"] == "displacement of 35")
    drawn = np.array([line[axis][1] - line[axis][0] for axis in "xyz"])
    shift = compared.deformation.displacement[compared.deformation.names.index("35")]
    np.testing.assert_allclose(drawn, float(stated.replace("\u2009", "")) * shift, atol=1.1e-4)


def test_arrows_go_where_the_points_went_and_ellipses_are_theirs(compared):
    d = compared.deformation
    for bearing, view in ((None, PLAN), (0.5, elevation_view(0.5))):
        figure, caption = comparison._view(compared, bearing)
        scale = float(re.search(r"enlarged ([\d\u2009]+) times", caption).group(1).replace("\u2009", ""))
        stable, moved = (c for c in figure.axes[0].collections if isinstance(c, EllipseCollection))
        arrow = [c for c in figure.axes[0].collections if isinstance(c, Quiver)][1]
        shift = scale * view @ d.displacement[d.moved][0]
        assert [arrow.U[0], arrow.V[0]] == pytest.approx(shift, abs=1e-12)
        spread = scale**2 * chi2.ppf(0.95, 2) * view @ d.covariance @ view.T
        for drawn, mine in ((stable, d.stable), (moved, d.moved)):
            np.testing.assert_allclose(outlines(drawn), spread[mine], atol=1e-9 * spread.max())
