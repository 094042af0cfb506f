"""Tests of records as tables and sentences: every number in its column, the worst first, nothing hidden."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.gateways.epoch.figures import figures
from catseye.gateways.epoch.record_tests import (
    by_group,
    checks_sentences,
    contradictions_csv,
    explanation_rows,
    listed_tests,
    records_csv,
    records_sentence,
)
from catseye.gateways.epoch.summary import passages
from catseye.reduction.epoch.contradictions.contradiction import Contradiction, RecordError, RecordGroup, RecordTest
from column_scene import assert_columns
from gateways.record_scene import with_checks


@pytest.fixture(scope="module")
def coordinates(reduction):
    return with_checks(reduction, 5).coordinates


def test_every_number_of_every_record_is_a_row_and_untested_ones_are_empty(coordinates):
    told = {
        "group": lambda t: str(t.group),
        "record": lambda t: t.record,
        "part": lambda t: t.part,
        "unit": lambda t: t.unit,
        "u_record": lambda t: t.u or None,
        "error": lambda t: t.error,
        "u_error": lambda t: t.u_error,
        "w": lambda t: t.error / t.u_error if np.isfinite(t.error) else None,
        "where": lambda t: t.where,
    }
    assert_columns(records_csv(coordinates), told, listed_tests(coordinates))
    assert sum(not np.isfinite(test.w) for test in coordinates.records) == 13


def test_errors_in_common_that_would_not_show_are_told_once_each(coordinates):
    """A tenth of u is seen four times in five from 4.13 times u_error: 4.13 mm of 1 mm; the larger of two parts."""
    parts = [("heights", "east", 0.1, 1.0), ("heights", "north", 0.1, 0.5), ("zeros", "", 0.1, np.inf), ("d", "", 1, 1)]
    records = tuple(
        RecordTest(RecordGroup.COMMON, f"{record} alike", "", part, "mm", u, 0.0, u_error)
        for record, part, u, u_error in parts
    )
    (told,) = [t for t in checks_sentences(replace(coordinates, records=records)) if t.startswith("Nothing else")]
    assert told.endswith("would not show: heights by 4.1 mm; zeros by any size.")


def test_every_number_of_an_explanation_is_a_row(coordinates):
    told = {
        "contradiction": lambda r: r.contradiction,
        "rank": lambda r: r.rank,
        "group": lambda r: str(r.explanation.group),
        "record": lambda r: r.explanation.record,
        "part": lambda r: r.explanation.parts[r.part],
        "unit": lambda r: r.explanation.unit,
        "error": lambda r: r.explanation.errors[r.part],
        "u_error": lambda r: r.explanation.u[r.part],
        "gain": lambda r: r.explanation.gain,
        "where": lambda r: r.explanation.where,
    }
    rows = explanation_rows(coordinates.contradictions)
    assert_columns(contradictions_csv(coordinates), told, rows)
    assert [(row.contradiction, row.rank, row.part) for row in rows] == [
        (1, 1, 0), (1, 1, 1), (1, 1, 2), (2, 1, 0), (2, 2, 0),
    ]  # fmt: skip


def test_a_contradicted_record_has_the_error_that_explains_it(reduction):
    coordinates = with_checks(reduction).coordinates
    line = RecordError(RecordGroup.LINES, "all shots of ZY102 on ZBM01", "", ("",), "mm", (-0.94,), (0.02,), 406.0)
    doubted = replace(coordinates, contradictions=(*coordinates.contradictions, Contradiction((line,))))
    tests = {(test.record, test.part): test for test in listed_tests(doubted)}
    east = tests["monument ZY103", "east"]
    assert (east.error, east.u_error, east.w) == (1.0, 0.05, 20.0)
    assert tests["zero ZY101", ""].error == -0.9
    before = {(test.record, test.part): test for test in coordinates.records}
    assert east.u == before["monument ZY103", "east"].u
    assert tests["mirror ZP101", "dx"] is before["mirror ZP101", "dx"]
    added = tests[line.record, ""]
    assert (added.group, added.error, added.u_error, added.unit) == (RecordGroup.LINES, -0.94, 0.02, "mm")
    assert len(tests) == len(before) + 1
    assert "all shots of ZY102 on ZBM01,,mm,,-0.94,0.02,-47.000," in records_csv(doubted)


def test_groups_begin_with_the_largest_w_and_end_with_what_is_untested(coordinates):
    groups = by_group(listed_tests(coordinates))
    assert sum(map(len, groups.values())) == len(coordinates.records)
    for tests in groups.values():
        w = np.abs([test.w for test in tests])
        assert np.isnan(w[-1])
        assert np.all(np.diff(w[:-1]) <= 0.0)
    assert next(iter(groups["benchmarks"])).record == "benchmark ZBM01"


def test_the_sentence_has_both_contradictions_and_the_worst_record(coordinates):
    said = records_sentence(coordinates)
    tested = len(coordinates.records) - 13
    assert said.startswith(f"{tested} numbers of the records were tested")
    assert "nothing tests 13 more; the largest misfit is that of benchmark ZBM01, w +92.0." in said
    assert said.endswith(" Contradicted by the ranges: monument ZY103; benchmark ZBM01 or zero ZY101.")


def test_unchecked_and_unmeasured_points_are_named_under_reliability(reduction):
    said = {p.title: p.text for p in passages(with_checks(reduction))}["Reliability"]
    assert "could move them unseen: DP003, ZEG41040L." in said
    assert "Not measured: ZEG41099L." in said
    assert "By class of points: dish 0.98, feed arm 1.02 with a sway of 0.31 mm included." in said
    assert len(checks_sentences(with_checks(reduction).coordinates)) == 3


def test_the_figure_has_a_row_a_group_and_names_what_is_far_out(reduction):
    figure = figures(with_checks(reduction, 5))["records"]
    (axes,) = figure.axes
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert rows[0] == "monuments (15)"
    assert len(rows) == 13
    assert "benchmark ZBM01" in [text.get_text() for text in axes.texts]
    low, high = axes.get_xlim()
    assert high == -low > 92.0
