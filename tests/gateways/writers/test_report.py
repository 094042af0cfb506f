"""A report as JSON: the shapes of the format, rounded numbers, keys that occur once."""

import json

import pytest

from catseye.gateways.writers.report import ReportSection, ResultReport, TableBlock, report_object
from catseye.gateways.writers.report_parts import ReportTable, number, pairs, text
from gateways.report_scene import every_part


def test_json_has_the_shapes_of_the_front_ends_types():
    report = report_object(every_part())
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["format"] == "catseye-report-1"
    assert report["verdict"] == {"word": "good", "why": "all fits"}
    assert report["cards"] == [{"name": "u", "value": "1 mm", "remark": "largest"}]
    (section,) = report["sections"]
    assert section["blocks"] == [
        {"kind": "text", "text": "words"},
        {"kind": "text", "text": "small words", "faint": True},
        {"kind": "heading", "text": "heading"},
        {"kind": "list", "items": ["one", "two"]},
        {"kind": "table", "table": "points", "caption": "caption", "folded": "folded"},
        {"kind": "scene", "scene": "network", "caption": "a scene"},
        {"kind": "chart", "chart": "w", "caption": "a chart"},
        {"kind": "drawing", "drawing": "drawing", "caption": "a drawing"},
    ]
    assert report["tables"]["points"] == {
        "columns": [
            {"key": "point", "label": "point", "unit": "", "kind": "text", "values": ["A", "B"]},
            {
                "key": "x",
                "label": "x",
                "unit": "m",
                "kind": "number",
                "digits": 5,
                "u": "u",
                "values": [1.2345679, None],
            },
            {"key": "u", "label": "u", "unit": "m", "kind": "number", "digits": 5, "values": [0.0001235, None]},
            {"key": "n", "label": "shots", "unit": "", "kind": "number", "digits": 0, "values": [3, 4]},
        ],
        "name": "point",
    }
    points = report["scenes"]["network"]["points"]
    assert points["z"] == [2, None]
    assert points["covariance"]["zz"] == [3.333e-8, 0]
    assert report["scenes"]["network"]["beams"] == {"from": [0], "to": [1], "value": [0.123], "name": ["7"]}
    assert report["scenes"]["network"]["lines"] == [{"name": "rim", "x": [0, 1], "y": [0, 0], "z": [0, 0]}]
    chart = report["charts"]["w"]
    assert chart["x"] == {"label": "ranger", "unit": "", "values": [1, 0], "categories": ["A", "B"]}
    assert chart["y"]["values"] == [1.235, None]
    assert chart["groups"] == ["good", "bad"]
    assert report["drawings"] == {"drawing": "<svg/>"}


def test_a_report_without_verdict_says_null():
    report = report_object(ResultReport("Title", "", None, []))
    assert report["verdict"] is None
    assert report["sections"] == []


def test_two_parts_cannot_have_one_key():
    blocks = [TableBlock("inputs", pairs({"a": "b"}, "file", "SHA-256"))] * 2
    with pytest.raises(ValueError, match="two parts of a report have the key 'inputs'"):
        report_object(ResultReport("Title", "", None, [ReportSection("s", "S", blocks)]))


def test_columns_of_different_lengths_or_of_one_key_are_a_mistake():
    for columns in (
        (text("a", "a", ["x"]), text("b", "b", ["y", "z"])),
        (text("a", "a", ["x"]), text("a", "b", ["y"])),
    ):
        with pytest.raises(ValueError, match="columns of different lengths or of one key"):
            ReportTable(columns).to_object()


def test_an_empty_table_has_its_columns():
    table = ReportTable.of_rows([], text("point", "point"), number("x", "x")).to_object()
    assert [(c["key"], c["values"]) for c in table["columns"]] == [("point", []), ("x", [])]
