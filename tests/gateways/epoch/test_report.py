"""The report stands alone, shows everything, trusts no name, and has the numbers of the tables beside it."""

import csv
from dataclasses import fields, replace
from datetime import UTC, datetime

import numpy as np
import pytest

from catseye.constants import MILLIMETRE
from catseye.gateways.epoch.objects import pose_object
from catseye.gateways.epoch.report import reduction_report
from catseye.gateways.epoch.summary import passages
from catseye.gateways.epoch.tables import ranges_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import report_object
from catseye.gateways.writers.report_page import report_page
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.reason import Reason, ShotStatus
from gateways.report_scene import blocks, column, read, texts, words_of

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
    sections = "feed-arm dish network residuals rejected rangers air points shots provenance"
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
    }
    part = reduce_epoch(replace(reduction.campaign, shots=type(shots)(**columns)))
    report = read(report_page(reduction_report(part, WHEN)))
    assert "No pose and no surface: no paraboloid: " in texts(report)
    assert pose_object(part)["reason"] == part.no_surface == part.notes[-1]
    assert len([line for line in ranges_csv(part).splitlines() if line]) == len(kept) + 1
    assert json_page(pose_object(part))
