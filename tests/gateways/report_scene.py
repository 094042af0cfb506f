"""Reports as tests read them: the data of a page, its tables, and the page around them."""

import re
from html.parser import HTMLParser

import numpy as np

from catseye.gateways.writers.report import (
    Card,
    ChartBlock,
    DrawingBlock,
    Heading,
    Items,
    ReportSection,
    ResultReport,
    SceneBlock,
    TableBlock,
    Text,
)
from catseye.gateways.writers.report_parts import (
    Axis,
    Beams,
    Chart,
    Coloured,
    ReportTable,
    Scene,
    categories,
    number,
    text,
    uncertainty,
)
from catseye.records.files.report_file import report_in
from catseye.verdict import Verdict

VOID = {"meta", "br", "img", "link"}
ELEMENTS = re.compile(r"(<(script|style)[^>]*>).*?(</\2>)", re.DOTALL)


class Words(HTMLParser):
    """Refuses a tag that is closed out of turn or a thing to fetch; keeps the words that a reader sees."""

    def __init__(self):
        super().__init__()
        self.open, self.words = [], []

    def handle_starttag(self, tag, attrs):
        assert tag not in ("link", "iframe", "object", "img", "base", "form")
        assert not [key for key, _ in attrs if key in ("src", "href") or key.startswith("on")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style") and data.strip():
            self.words.append(data.strip())


def read(page):
    """Data of a page, which is well-formed and loads nothing."""
    words_of(page)
    assert "@import" not in page
    return report_in(page, "report.html")


def words_of(page):
    """Words of a page without its scripts, styles and data."""
    reader = Words()
    reader.feed(ELEMENTS.sub(r"\1\3", page))
    assert reader.open == []
    assert reader.words
    return reader.words


def column(report, table, key):
    """Values of a table's column."""
    return next(c["values"] for c in report["tables"][table]["columns"] if c["key"] == key)


def row(report, table, name):
    """One row of a table by its first column, as a dictionary."""
    columns = report["tables"][table]["columns"]
    place = columns[0]["values"].index(name)
    return {c["key"]: c["values"][place] for c in columns}


def blocks(report, kind):
    """Blocks of a kind, in order."""
    return [block for section in report["sections"] for block in section["blocks"] if block["kind"] == kind]


def texts(report):
    """All sentences of a report."""
    said = [block.get("text", "") + block.get("caption", "") for s in report["sections"] for block in s["blocks"]]
    listed = [item for block in blocks(report, "list") for item in block["items"]]
    cards = [" ".join(card.values()) for card in report["cards"]]
    return " ".join([*said, *listed, *cards, *(p["text"] for p in report["passages"])])


def every_part():
    """A report with a block of every kind."""
    table = ReportTable(
        (
            text("point", "point", ["A", "B"]),
            number("x", "x", np.array([1.23456789012, np.nan]), "m", 5, u="u"),
            uncertainty("u", "u", [0.000123456, None], "m", 5),
            number("n", "shots", np.array([3, 4]), digits=0),
        ),
        "point",
    )
    scene = Scene(
        frame="x, y, z",
        names=("A", "B"),
        x=np.array([[0.0, 1.0, 2.0], [3.0, 4.0, np.nan]]),
        groups=("all",),
        group=(0, 0),
        covariance=np.array([np.diag([1e-8, 2e-8, 3.33333e-8]), np.zeros((3, 3))]),
        info=("first", "second"),
        beams=Beams([0], [1], [0.12345], [7]),
        lines={"rim": np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])},
        value=Coloured("deviation", "mm", [0.1, -0.2]),
    )
    chart = Chart(
        "scatter",
        categories("ranger", ["B", "A"]),
        Axis("w", "", [1.23456, np.nan], digits=3),
        u=[0.1, 0.2],
        names=["1", "2"],
        group=[0, 1],
        groups=("good", "bad"),
        limits=(-3.5, 3.5),
        outline=[np.array([[0.0, 0.0], [1.0, 1.0]])],
    )
    blocks = [
        Text("words"),
        Text("small words", faint=True),
        Heading("heading"),
        Items(["one", "two"]),
        TableBlock("points", table, "caption", "folded"),
        SceneBlock("network", scene, "a scene"),
        ChartBlock("w", chart, "a chart"),
        DrawingBlock("drawing", "<svg/>", "a drawing"),
        None,
    ]
    return ResultReport(
        title="Title",
        subtitle="of a test",
        verdict=Verdict("good", "all fits"),
        sections=[ReportSection("first", "First", blocks), None],
        cards=[Card("u", "1 mm", "largest")],
    )
