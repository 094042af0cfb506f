"""The report stands alone, shows everything, and trusts no name."""

import base64
import re
from dataclasses import fields, replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from catseye.gateways.epoch.objects import pose_object
from catseye.gateways.epoch.report import pictures, report
from catseye.gateways.epoch.summary import passages
from catseye.gateways.epoch.tables import ranges_csv
from catseye.gateways.writers.objects import json_page
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.reason import Reason, ShotStatus

WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
VOID = {"meta", "img", "link", "br"}


class Balance(HTMLParser):
    """Refuses a tag that is closed out of turn or a thing to fetch."""

    def __init__(self):
        super().__init__()
        self.open, self.sources = [], []

    def handle_starttag(self, tag, attrs):
        assert tag not in ("script", "link", "iframe")
        self.sources += [value for key, value in attrs if key in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def drawn(reduction):
    return pictures(reduction)


@pytest.fixture
def drawn_already(monkeypatch, drawn):
    """The figures' part of the report, which takes most of its time, from the shelf."""
    monkeypatch.setattr("catseye.gateways.epoch.report.pictures", lambda *_: drawn)


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.html").read_text(encoding="utf-8")


def test_page_is_well_formed_and_self_contained(page):
    reader = Balance()
    reader.feed(page)
    assert reader.open == []
    assert reader.sources
    assert all(source.startswith(("#", "data:image/svg+xml;base64,")) for source in reader.sources)
    assert "@import" not in page
    assert "url(" not in page


def test_it_is_light(page):
    assert len(page) < 3e6


def test_it_shows_every_point_every_rejected_shot_and_every_section(page, reduction):
    for name in reduction.coordinates.points:
        assert f">{name}<" in page
    for shot in reduction.rejected:
        assert f'<td class="n">{shot}</td>' in page
    anchors = re.findall(r'href="#([a-z-]+)"', page)
    assert len(anchors) == 10
    assert all(f'id="{anchor}"' in page for anchor in anchors)


def test_the_scale_of_the_ellipsoids_is_stated(page):
    assert "enlarged as stated" in page


def test_figures_are_svg_and_the_same_each_time(page, drawn):
    assert set(drawn) == {"plan", "elevation", "feed_arm", "residuals", "zeros", "refractivity", "weather", "dish"}
    for svg in drawn.values():
        assert ElementTree.fromstring(svg).tag.endswith("svg")
        assert base64.b64encode(svg.encode()).decode() in page


@pytest.mark.usefixtures("drawn_already")
def test_names_and_notes_are_escaped(reduction):
    hostile = '<script>alert("x")</script>'
    posture = reduction.campaign.site.campaign.model_copy(update={"name": hostile})
    site = reduction.campaign.site.model_copy(update={"campaign": posture})
    campaign = replace(reduction.campaign, site=site)
    bad = replace(reduction, campaign=campaign, notes=(hostile,), rejected={1: Reason(ShotStatus.BLOCKED, hostile)})
    text = report(bad, WHEN)
    assert "<script" not in text
    assert "&lt;script&gt;" in text


@pytest.mark.usefixtures("drawn_already")
def test_report_without_dish_is_complete_otherwise(reduction):
    blind = replace(reduction, surface=None, no_surface="no paraboloid: two points", rejected={})
    text = report(blind, WHEN)
    assert "No pose and no surface" in text
    assert [p.title for p in passages(blind)][3] == "The dish"


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
    text = report(part, WHEN)
    assert "No pose and no surface: no paraboloid: " in text
    assert pose_object(part)["reason"] == part.no_surface == part.notes[-1]
    assert len([line for line in ranges_csv(part).splitlines() if line]) == len(kept) + 1
    assert json_page(pose_object(part))
