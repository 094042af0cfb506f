"""The page of a report: whole without scripts, loads nothing, the same bytes twice, and no text becomes a tag."""

import base64
import gzip
import json
import re

import pytest

from catseye.gateways.writers import report_page as module
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import (
    Card,
    ChartBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    report_object,
)
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import Axis, Chart, ReportTable, text
from catseye.records.files.report_file import report_in
from catseye.verdict import Verdict
from gateways.report_scene import read, words_of

HOSTILE = [
    "</script><script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "<!--<script>",
    "\u202eright to left",
    "x" * 5000,
    "]]>&amp;'",
]


def hostile_report(name):
    table = ReportTable((text("name", name, [name]), text("value", "value", ["1"])), "name")
    return ResultReport(
        title=name,
        subtitle=name,
        verdict=Verdict("doubtful", name),
        sections=[ReportSection("s", name, [Text(name), TableBlock(name, table, name, name)])],
        cards=[Card(name, name, name)],
        passages=[Passage(name, name)],
    )


@pytest.mark.parametrize("name", HOSTILE, ids=["script", "tag", "comment", "direction", "length", "entity"])
def test_hostile_text_comes_out_as_text(name):
    page = report_page(hostile_report(name))
    assert page.count("<script") == 2
    assert page.count("</script>") == 2
    assert page.count("<!--") == 0
    assert "<img" not in re.sub(r"<script>.*</script>", "", page, flags=re.DOTALL)
    assert read(page) == report_object(hostile_report(name))
    assert " ".join(name.split()) in " ".join(" ".join(words_of(page)).split())


def test_the_page_allows_nothing_from_elsewhere():
    page = report_page(hostile_report("A"))
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    assert policy == "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
    assert page.index("<title>") < 200
    assert page.index("Content-Security-Policy") < page.index("<style>") < page.index("<script")
    assert '<html lang="en">' in page
    assert "<noscript>" in page


def test_the_same_report_is_the_same_bytes():
    assert report_page(hostile_report("A")) == report_page(hostile_report("A"))


def data_of(page):
    (packed,) = re.findall(r'id="catseye-data">([^<]*)</script>', page)
    raw = base64.b64decode(packed)
    assert raw[:4] == b"\x1f\x8b\x08\x00"
    assert raw[4:8] == bytes(4)  # no time
    return json.loads(gzip.decompress(raw))


def test_a_column_that_occurs_twice_is_stored_once():
    w = [0.001 * k for k in range(100)]
    charts = [
        ChartBlock(key, Chart("scatter", Axis("n", "", list(range(100))), Axis("w", "", w)), "") for key in ("a", "b")
    ]
    report = ResultReport("Title", "", None, [ReportSection("s", "S", charts)])
    page = report_page(report)
    stored = data_of(page)
    assert stored["charts"]["a"]["y"]["values"] == {"shared": 1}
    assert len(stored["shared"]) == 2
    assert report_in(page, "page") == report_object(report)


def test_a_script_and_a_style_cannot_end_themselves(monkeypatch, tmp_path):
    folder = tmp_path / "static"
    folder.mkdir()
    (folder / "report.js").write_text('const a = "</script>" + "</SCRIPT >" + "<!-- </style>";')
    (folder / "report.css").write_text('p::after { content: "</style>"; }')
    monkeypatch.setattr(module, "files", lambda _: tmp_path)
    module._static.cache_clear()
    try:
        page = report_page(hostile_report("A"))
    finally:
        module._static.cache_clear()
    assert r'"<\/script>" + "<\/SCRIPT >" + "<\!-- </style>"' in page
    assert r'content: "<\/style>"' in page
    assert page.count("</script>") == 2
