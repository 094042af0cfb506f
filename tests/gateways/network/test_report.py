"""The reports of a network and of two epochs stand alone, say the truth in plain words, and trust no name."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.quiver import Quiver
from scipy.stats import chi2

from catseye.estimation.deformation.comparison import compare
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.quality.ellipsoid import PLAN, elevation_view
from catseye.gateways.network import comparison_report as comparison
from catseye.gateways.network import figures
from catseye.gateways.network.comparison_report import comparison_report
from catseye.gateways.network.report import network_report
from catseye.gateways.network.summary import direction_words
from catseye.records.network.folder import read_network_folder
from catseye.records.network.gama import read_gama
from catseye.reduction.network.adjusted import adjusted_network
from catseye.reduction.network.comparison import ComparedEpochs
from repository import TESTS

NETWORKS = TESTS / "vectors" / "networks"
WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
INPUTS = {"network.gkf": "ab" * 32}
VOID = {"meta", "img", "link", "br"}


class Balance(HTMLParser):
    """Refuses a tag that is closed out of turn or a thing to fetch; keeps the cells of tables."""

    def __init__(self):
        super().__init__()
        self.open, self.sources, self.tables = [], [], []

    def handle_starttag(self, tag, attrs):
        assert tag not in ("script", "link", "iframe")
        self.sources += [value for key, value in attrs if key in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data


def read(page):
    reader = Balance()
    reader.feed(page)
    assert reader.open == []
    assert reader.sources
    assert all(source.startswith(("#", "data:image/svg+xml;base64,")) for source in reader.sources)
    assert "@import" not in page
    assert "url(" not in page
    return reader.tables


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


def test_page_is_self_contained_and_shows_every_point(tunnel, single):
    for found in (tunnel, single):
        page = network_report(found, WHEN, INPUTS)
        tables = read(page)
        anchors = re.findall(r'href="#([a-z-]+)"', page)
        assert len(anchors) == 7
        assert all(f'id="{anchor}"' in page for anchor in anchors)
        (points,) = (t for t in tables if t[0][0] == "point")
        assert [row[0] for row in points[1:]] == list(found.names)
        (observations, *_) = (t for t in tables if t[0][0] == "observation")
        assert len(observations) - 1 == min(len(found.table), 100)
        assert INPUTS["network.gkf"] in page


def test_large_network_report_lists_the_worst(ranging):
    page = network_report(ranging, WHEN, INPUTS)
    tables = read(page)
    assert len(page) < 3e6
    assert "The 100 worst of 9000; all are in observations.csv." in page
    assert "The 200 weakest of 518; all are in coordinates.csv." in page
    (observations,) = (t for t in tables if t[0][0] == "observation")
    statistic = [abs(float(row[4])) for row in observations[1:]]
    assert statistic == sorted(statistic, reverse=True)
    assert len(statistic) == 100
    (points,) = (t for t in tables if t[0][0] == "point")
    longest = [float(row[9].split(" / ")[0]) for row in points[1:]]
    assert longest == sorted(longest, reverse=True)
    assert longest[0] == pytest.approx(1e3 * ranging.ellipsoid.semi_axes.max(), rel=1e-3)
    assert re.search(r"one in \d+ of 9000 observed pairs", page)


def test_a_blunder_leads_the_table_of_observations(ranging):
    found = with_error(ranging, 1234, 0.002)
    tables = read(network_report(found, WHEN, INPUTS))
    (observations,) = (t for t in tables if t[0][0] == "observation")
    assert observations[1][0] == ranging.label(1234)
    assert observations[1][-1] == "suspect"


def test_undetermined_network_names_what_is_undetermined(tunnel):
    points = tunnel.network.points
    loose = replace(tunnel.network, points=replace(points, datum=np.zeros_like(points.datum)))
    found = adjusted_network(adjust_network(loose))
    page = network_report(found, WHEN, INPUTS)
    tables = read(page)
    assert "rank deficient" in page
    (rows,) = (t for t in tables if t[0][0] == "point")
    assert {row[6] for row in rows[1:]} == {"–"}  # no uncertainty is claimed
    assert "uncertainties unknown" in page


def test_no_name_breaks_the_page(tunnel):
    points = tunnel.network.points
    odd = ("<script>alert(1)</script>", '"><img src=x onerror=y>', "$x^2$", *points.names[3:])
    network = replace(tunnel.network, points=replace(points, names=odd), description="<b>bold</b>", source="<i>.gkf")
    found = adjusted_network(replace(tunnel.solution, network=network))
    read(network_report(found, WHEN, {"<u>": "x"}))


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
    page = comparison_report(compared, WHEN, INPUTS)
    tables = read(page)
    rows = {row[0]: row for row in next(t for t in tables if t[0][0] == "point")}
    assert (rows["35"][1], float(rows["35"][3])) == ("moved", pytest.approx(4.0, abs=1e-3))
    assert {row[1] for name, row in rows.items() if name not in ("35", "point")} == {"stable"}
    assert compared.deformation.status[1:] in page
    assert "95 % confidence ellipses" in page
    assert "level of the tests" in page


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
