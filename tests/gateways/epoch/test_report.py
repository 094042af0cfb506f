"""The report stands alone, shows everything, trusts no name, and has the numbers of the tables beside it."""

import csv
from dataclasses import fields, replace
from datetime import UTC, datetime

import numpy as np
import pytest

from catseye.constants import MILLIMETRE
from catseye.gateways.epoch.objects import pose_object
from catseye.gateways.epoch.record_tests import listed_tests
from catseye.gateways.epoch.report import reduction_report
from catseye.gateways.epoch.summary import passages
from catseye.gateways.epoch.tables import ranges_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import report_object
from catseye.gateways.writers.report_page import report_page
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.site.plausible.record import ImplausibleRecord
from gateways.record_scene import with_checks
from gateways.report_scene import blocks, column, read, row, texts, words_of

WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def report(page):
    return read(page)


def rows(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_it_is_light(page):
    assert len(page) < 0.5e6


def test_the_page_is_the_same_each_time(reduction):
    first, second = (report_page(reduction_report(reduction, WHEN)) for _ in range(2))
    assert first == second


def test_words_are_readable_without_scripts(page, reduction):
    words = " ".join(words_of(page))
    for passage in passages(reduction):
        assert passage.title == "Notes" or passage.text in words
    assert reduction.verdict.why in words
    assert all(note in words for note in reduction.notes)
    assert "need a browser with scripts" in words


def test_it_shows_every_point_every_rejected_shot_and_every_section(report, reduction):
    assert column(report, "points", "point") == list(reduction.coordinates.points)
    assert column(report, "rejected", "shot") == sorted(reduction.rejected)
    sections = "feed-arm dish network records residuals rejected rangers air checks points shots provenance"
    assert [section["id"] for section in report["sections"]] == sections.split()
    assert report["scenes"].keys() == {"network"}
    assert report["charts"].keys() >= {"dish", "residuals-by-time", "w-by-ranger", "w-by-target", "w-by-elevation",
                                       "w-histogram", "w-normal", "zeros", "refractivity", "temperature"}  # fmt: skip
    assert report["drawings"] == {}


TABLES = [
    (
        "points",
        "coordinates.csv",
        {"x": "x_m", "y": "y_m", "z": "z_m", "u_x": "u_x_mm", "u_y": "u_y_mm", "u_z": "u_z_mm"},
    ),
    ("surface", "surface.csv", {"deviation": "deviation_mm", "u_deviation": "u_deviation_mm", "x_dish": "x_dish_m"}),
    (
        "shots",
        "ranges.csv",
        {
            "range": "range_m",
            "u_range": "u_range_mm",
            "residual": "residual_mm",
            "w": "standardised",
            "redundancy": "redundancy",
        },
    ),
]


@pytest.mark.parametrize(("table", "file", "columns"), TABLES, ids=[name for name, *_ in TABLES])
def test_its_numbers_are_those_of_the_tables_beside_it(report, written, table, file, columns):
    """Within the rounding of both: half a unit of the last decimal of the table, or the fourth digit of a u."""
    names = report["tables"][table]["columns"][0]
    theirs = {row[names["key"]]: row for row in rows(written / file)}
    shown = [c for c in report["tables"][table]["columns"] if c["key"] in columns]
    assert len(shown) == len(columns)
    for c in shown:
        for name, value in zip(names["values"], c["values"], strict=True):
            cell = theirs[str(name)][columns[c["key"]]]
            digits = len(cell.partition(".")[2])
            assert value == pytest.approx(float(cell), rel=6e-4, abs=0.51 * 10.0**-digits), (c["key"], name)


def test_coordinates_are_kept_to_a_tenth_of_a_micrometre(report, reduction):
    for k, axis in enumerate("xyz"):
        assert np.abs(np.array(column(report, "points", axis)) - reduction.coordinates.x[:, k]).max() <= 0.501e-7


def test_the_scene_has_points_covariances_and_the_used_ranges(report, reduction):
    scene, coordinates = report["scenes"]["network"], reduction.coordinates
    points = scene["points"]
    place = {name: k for k, name in enumerate(coordinates.points)}
    at = [place[name] for name in points["name"]]
    blocks_ = coordinates.joint.blocks[at]
    for pair, (i, j) in {"xx": (0, 0), "xy": (0, 1), "yz": (1, 2), "zz": (2, 2)}.items():
        np.testing.assert_allclose(points["covariance"][pair], blocks_[:, i, j], rtol=6e-4, atol=1e-30)
    beams, ranges = scene["beams"], coordinates.ranges
    assert len(beams["value"]) == int(ranges.used.sum())
    first = np.flatnonzero(ranges.used)[0]
    assert points["name"][beams["from"][0]] == ranges.ranger[first]
    assert points["name"][beams["to"][0]] == ranges.target[first]
    assert beams["value"] == pytest.approx(ranges.standardised[ranges.used], abs=5.1e-4)
    assert [scene["groups"][k] for k in points["group"]].count("feed-arm ranger") == 6


def test_charts_have_the_residuals_of_the_used_shots(report, reduction):
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots
    by_ranger = report["charts"]["w-by-ranger"]
    assert [int(name) for name in by_ranger["name"]] == shots.shot[ranges.shot[ranges.used]].tolist()
    named = [by_ranger["x"]["categories"][k] for k in by_ranger["x"]["values"]]
    assert named == [name for name, used in zip(ranges.ranger, ranges.used, strict=True) if used]
    assert by_ranger["limits"] == [-reduction.settings.critical, reduction.settings.critical]
    timed = report["charts"]["residuals-by-time"]
    shown = dict(zip(timed["name"], timed["y"]["values"], strict=True))
    for k in np.flatnonzero(ranges.used):
        assert shown[str(shots.shot[ranges.shot[k]])] == pytest.approx(ranges.residual[k] / MILLIMETRE, abs=5.1e-5)
    assert "rejected ones beyond" in texts(report)


def test_elevation_is_that_of_the_path(reduction):
    chart = report_object(reduction_report(reduction, WHEN))["charts"]["w-by-elevation"]
    ranges, coordinates = reduction.coordinates.ranges, reduction.coordinates
    k = int(np.flatnonzero(ranges.used)[0])
    start, end = (coordinates.x[coordinates.rows([name])[0]] for name in (ranges.ranger[k], ranges.target[k]))
    up = end[2] - start[2]
    wanted = np.degrees(np.arcsin(up / np.linalg.norm(end - start)))
    assert chart["x"]["values"][0] == pytest.approx(wanted, abs=0.006)


def test_names_and_notes_are_escaped(reduction):
    hostile = '</script><script>alert("x")</script>\u202e' + "x" * 500
    posture = reduction.campaign.site.campaign.model_copy(update={"name": hostile})
    site = reduction.campaign.site.model_copy(update={"campaign": posture})
    campaign = replace(reduction.campaign, site=site)
    bad = replace(reduction, campaign=campaign, notes=(hostile,), rejected={1: Reason(ShotStatus.BLOCKED, hostile)})
    text = report_page(reduction_report(bad, WHEN))
    assert '<script>alert("x")' not in text
    assert "&lt;script&gt;" in text
    assert column(read(text), "rejected", "observation") == [hostile]


def test_report_without_dish_is_complete_otherwise(reduction):
    blind = replace(reduction, surface=None, no_surface="no paraboloid: two points", rejected={})
    report = read(report_page(reduction_report(blind, WHEN)))
    assert "No pose and no surface" in texts(report)
    assert "dish" not in report["charts"]
    assert "lines" not in report["scenes"]["network"]
    assert [p.title for p in passages(blind)][3] == "The dish"


def test_every_table_scene_and_chart_is_in_a_section(report):
    for kind in ("table", "scene", "chart"):
        assert [block[kind] for block in blocks(report, kind)] == list(report[f"{kind}s"])


def test_passages_contain_the_numbers(reduction):
    told = {p.title: p.text for p in passages(reduction)}
    assert "759 shots" in told["The night"]
    assert f"{len(reduction.rejected)} were rejected" in told["The shots"]
    assert f"{reduction.coordinates.refractivity_ppm:.2f}" in told["The air"]
    assert f"{reduction.coordinates.variance_factor:.2f}" in told["Reliability"]


@pytest.fixture(scope="module")
def doubted(reduction):
    """A report with contradictions, unchecked points and an unmeasured target."""
    return read(report_page(reduction_report(with_checks(reduction, 70), WHEN)))


def test_contradictions_have_their_records_and_errors(doubted):
    assert column(doubted, "contradictions", "contradiction") == [1, 1, 1, 2, 2]
    assert column(doubted, "contradictions", "record") == [
        "monument ZY103", "monument ZY103", "monument ZY103", "benchmark ZBM01", "zero ZY101",
    ]  # fmt: skip
    assert column(doubted, "contradictions", "error") == [1, -0.12, 0.003, 0.92, -0.9]
    said = texts(doubted)
    assert "the ranges contradict monument ZY103 by east +1.000" in said
    assert "the ranges contradict one of these: benchmark ZBM01 by +0.920 mm" in said


def test_each_group_has_its_worst_record_and_its_untested_numbers(doubted, reduction):
    tests = listed_tests(with_checks(reduction, 70).coordinates)
    for group in {test.group for test in tests}:
        of_group = [test for test in tests if test.group == group]
        worst = max((test for test in of_group if np.isfinite(test.w)), key=lambda test: abs(test.w))
        shown = row(doubted, "record-groups", str(group))
        assert shown["w"] == pytest.approx(worst.w, abs=6e-4)
        assert shown["worst"] == f"{worst.record} {worst.part}".strip()
        assert (shown["numbers"], shown["untested"]) == (len(of_group), 1)
    assert row(doubted, "record-groups", "monuments")["chi_squared"] == "421.5 of 36"
    assert row(doubted, "record-groups", "monuments")["probability"] == "below 0.001"
    assert row(doubted, "record-groups", "ranger zeros")["probability"] == "0.506"


def test_the_largest_w_of_each_group_are_in_the_table(doubted, reduction):
    tests = listed_tests(with_checks(reduction, 70).coordinates)
    groups = column(doubted, "record-tests", "group")
    assert {groups.count(group) for group in groups} == {6}
    w = dict(zip(column(doubted, "record-tests", "record"), column(doubted, "record-tests", "w"), strict=True))
    monuments = sorted((t for t in tests if t.group == "monuments" and np.isfinite(t.w)), key=lambda t: -abs(t.w))
    for test in monuments[:6]:
        assert w[f"{test.record} {test.part}"] == pytest.approx(test.w, abs=6e-5)


def test_the_chart_of_records_says_what_it_leaves_out(doubted, reduction):
    chart = doubted["charts"]["record-tests"]
    named = [chart["x"]["categories"][round(x)] for x in chart["x"]["values"]]
    assert named.count("monuments") == 100  # of 210
    assert named.count("benchmarks") == 70
    at = chart["name"].index("benchmark ZBM01")
    assert chart["y"]["values"][at] == 12  # of 92
    marked = {name for name, group in zip(chart["name"], chart["group"], strict=True) if group}
    assert "benchmark ZBM01" in marked
    assert not any(name.startswith("mirror") for name in marked)
    said = texts(doubted)
    assert "3 with |w| above 12 are drawn at the edge" in said  # monument 20, certificate 92, zero -82
    assert "Of a group of more than 100, those with the largest |w|" in said


def test_records_that_no_site_has_come_first(reduction):
    record = ImplausibleRecord("weather.csv: humidity_pct", "WX1 reads 0 % throughout", "humidity", ("WX1",))
    report = read(report_page(reduction_report(replace(reduction, implausible=(record,)), WHEN)))
    (section,) = [section for section in report["sections"] if section["id"] == "records"]
    kinds = [block["kind"] for block in section["blocks"]]
    assert section["blocks"][kinds.index("list")]["items"] == ["weather.csv: humidity_pct: WX1 reads 0 % throughout."]
    assert kinds.index("heading") < kinds.index("table")
    assert "Records that no site has" not in texts(read(report_page(reduction_report(reduction, WHEN))))


def test_points_stand_by_their_lines_and_unchecked_ones_by_name(doubted, reduction):
    coordinates = reduction.coordinates
    count = {name: sum(name in pair for pair in lines(coordinates.ranges)) for name in coordinates.points}
    ranged = [name for name in coordinates.points if not name.endswith("-F")]
    for text in ("1", "5", "10 or more"):
        wanted = [n for n in ranged if (count[n] >= 10 if text == "10 or more" else count[n] == int(text))]
        shown = row(doubted, "lines", text)
        assert shown["points"] == len(wanted) > 0
        assert shown["unchecked"] == len({"DP003", "ZEG41040L"} & set(wanted))
    assert column(doubted, "unchecked", "point") == ["DP003", "ZEG41040L"]
    assert row(doubted, "unchecked", "ZEG41040L")["lines"] == count["ZEG41040L"]
    assert row(doubted, "unmeasured", "ZEG41099L")["reasons"] == "no shot"
    at = column(doubted, "points", "point").index("DP003")
    assert column(doubted, "points", "status")[at] == "unchecked"
    assert column(doubted, "points", "status").count("unchecked") == 2


def lines(ranges):
    """Pairs of ranger and target with a used shot."""
    return {(r, t) for r, t, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True) if used}


def test_an_unmeasured_target_has_the_fate_of_its_shots(reduction):
    status = list(reduction.status)
    shots = [k for k, target in enumerate(reduction.campaign.shots.target) if target == "DP007"]
    for k in shots:
        status[k] = ShotStatus.BLOCKED
    status[shots[0]] = ShotStatus.REFLECTED
    lost = replace(reduction.coordinates, unmeasured=("DP007",))
    report = read(report_page(reduction_report(replace(reduction, coordinates=lost, status=tuple(status)), WHEN)))
    shown = row(report, "unmeasured", "DP007")
    assert shown["shots"] == len(shots)
    assert shown["reasons"] == f"{len(shots) - 1} blocked, 1 reflected"


def test_scatter_of_classes_is_shown_with_its_sway_in_millimetres(doubted):
    assert column(doubted, "scatter", "class") == ["dish", "feed arm"]
    assert column(doubted, "scatter", "variance_factor") == [0.98, 1.02]
    assert column(doubted, "scatter", "sway") == [None, 0.31]
    assert "feed arm 1.02 with a sway of 0.31 mm included" in texts(doubted)


def test_cards_count_contradictions_and_unchecked_points(doubted):
    cards = {card["name"]: card for card in doubted["cards"]}
    assert cards["Contradictions"]["value"] == "2"
    assert "92.0" in cards["Contradictions"]["remark"]
    assert cards["Unchecked points"]["value"] == "2"


def test_a_night_whose_records_agree_says_so(reduction):
    agreeing = with_checks(reduction)
    quiet = tuple(replace(test, error=0.1 * test.u_error) for test in agreeing.coordinates.records)
    coordinates = replace(agreeing.coordinates, records=quiet, contradictions=(), unchecked=(), unmeasured=())
    report = read(report_page(reduction_report(replace(agreeing, coordinates=coordinates), WHEN)))
    assert "The ranges contradict no record." in texts(report)
    assert report["charts"]["record-tests"]["groups"] == ["not contradicted"]
    assert not {"contradictions", "unchecked", "unmeasured"} & report["tables"].keys()
    assert {card["name"]: card["value"] for card in report["cards"]}["Contradictions"] == "none"


@pytest.mark.parametrize(
    "keep",
    [
        pytest.param(lambda shots, k: k < 12, id="the first shots"),
        pytest.param(lambda shots, k: shots.ranger[k] == "ZY101", id="one ranger"),
        pytest.param(lambda shots, k: shots.ranger[k] < "ZY113", id="the ground"),
    ],
)
def test_a_part_of_the_night_is_reported_too(reduction, keep):
    shots = reduction.campaign.shots
    kept = [k for k in range(len(shots)) if keep(shots, k)]
    columns = {
        column.name: tuple(getattr(shots, column.name)[k] for k in kept)
        if column.name in ("ranger", "target")
        else getattr(shots, column.name)[kept]
        for column in fields(shots)
        if getattr(shots, column.name) is not None  # one frequency
    }
    part = reduce_epoch(replace(reduction.campaign, shots=type(shots)(**columns)))
    report = read(report_page(reduction_report(part, WHEN)))
    assert "No pose and no surface: no paraboloid: " in texts(report)
    assert pose_object(part)["reason"] == part.no_surface == part.notes[-1]
    assert len([line for line in ranges_csv(part).splitlines() if line]) == len(kept) + 1
    assert json_page(pose_object(part))


def test_chart_of_harmonics_has_the_largest_and_every_distorted_shot(reduction, monkeypatch):
    """A report of a whole dish travels by mail: its chart has part of the shots, and says so."""
    monkeypatch.setattr("catseye.gateways.detection.night_harmonics.CHARTED", 30)
    phases = reduction.phases
    usable = np.flatnonzero([reason is None for reason in phases.reason])
    largest = phases.relative_harmonics.max(axis=1)
    bent = usable[np.argsort(largest[usable])[:40]]  # those that the chart would leave out first
    distorted = np.zeros_like(phases.distorted)
    distorted[bent] = True
    for marked, most in ((phases.distorted, 30), (distorted, 40)):
        monkeypatch.setattr(type(phases), "distorted", marked)
        part = report_object(reduction_report(reduction, WHEN))
        chart = part["charts"]["harmonics"]
        drawn = {int(name) for name in chart["name"]}
        wanted = bent if marked.any() else usable[np.argsort(largest[usable])[-most:]]
        assert drawn == set(reduction.campaign.shots.shot[wanted].tolist())
        (caption,) = (block["caption"] for block in blocks(part, "chart") if block["chart"] == "harmonics")
        assert f"The {most} largest are drawn" in caption
