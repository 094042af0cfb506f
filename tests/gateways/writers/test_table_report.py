"""Reports of tables and figures: every number of the file is in the report, and a cut table says so."""

from datetime import UTC, datetime

import numpy as np
import pytest
from matplotlib.figure import Figure

from catseye.gateways.writers import table_report as module
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Card
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.table_report import PartOfReport, report_table, table_report
from catseye.verdict import Verdict
from gateways.report_scene import column, read, texts

PILLARS = Table[dict](
    "pillars.csv",
    "p.md",
    (
        Column("pillar", "", "name", list),
        Column("x_m", "m", "along the line", lambda p: np.array(list(p.values())), ".8f"),
        Column("u_x_mm", "mm", "its u", lambda p: np.full(len(p), 0.12345), ".6f"),
        Column("x_arcsec", "arcsec", "its turn", lambda p: np.zeros(len(p)), ".2f"),
        Column("ranges", "", "number", lambda p: np.arange(len(p))),
        Column("p", "", "probability", lambda p: np.full(len(p), np.nan), ".6g"),
        Column("other_m", "m", "not of this file", lambda p: None, ".4f"),
    ),
)
PLACES = {"A": 1.23456789, "B": -3.0, "C": 0.5}


def report_of(places):
    return read(
        report_page(
            table_report(
                "Pillars",
                "three of them",
                Verdict("good", "they stand"),
                cards=[Card("Pillars", str(len(places)), "in a row")],
                passages=[Passage("The line", "straight.")],
                parts=[
                    PartOfReport(
                        "The pillars", [report_table(PILLARS, places)], {"plan": (Figure(), "Seen from above.")}
                    ),
                    PartOfReport("Nothing", []),
                ],
                when=datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC),
                inputs={"pillars.csv": "ab" * 32},
            )
        )
    )


def test_every_column_of_the_file_is_in_the_report_with_its_unit():
    report = report_of(PLACES)
    assert [section["id"] for section in report["sections"]] == ["the-pillars", "provenance"]
    assert column(report, "pillars", "pillar") == list(PLACES)
    np.testing.assert_allclose(column(report, "pillars", "x_m"), list(PLACES.values()), atol=1e-7)
    assert column(report, "pillars", "ranges") == [0, 1, 2]
    assert column(report, "pillars", "p") == [None] * 3
    made = {c["key"]: c for c in report["tables"]["pillars"]["columns"]}
    assert list(made) == ["pillar", "x_m", "u_x", "x_arcsec", "ranges", "p"]
    assert (made["x_m"]["unit"], made["u_x"]["unit"], made["x_m"]["u"]) == ("m", "mm", "u_x")
    assert "they stand" in str(report)
    assert "Seen from above." in str(report)
    assert column(report, "inputs", "value") == ["ab" * 32]


def test_a_table_that_is_cut_says_where_all_rows_are(monkeypatch):
    monkeypatch.setattr(module, "MOST_ROWS", 2)
    report = report_of(PLACES)
    assert column(report, "pillars", "pillar") == ["A", "B"]
    assert "The first 2 of 3 rows; all are in pillars.csv." in str(report)


@pytest.mark.parametrize("count", [1, 3])
def test_a_whole_table_has_no_caption(count):
    assert "The first" not in texts(report_of(dict(list(PLACES.items())[:count])))
