"""Tests of an epoch's records as tables, JSON and sentences: records.csv, contradictions.csv."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.epoch.contradictions.contradiction import (
    ALIKE,
    ClassScatter,
    Contradiction,
    GroupTest,
    RecordError,
    RecordGroup,
    RecordTest,
)
from catseye.reduction.epoch.coordinates import AdjustedCoordinates

PAGE = "results.md"
SOME = 6  # names in a sentence
DIGITS = ".6g"  # of numbers in units that differ from row to row


class ExplanationRow(NamedTuple):
    """Row of contradictions.csv: one number of a record that explains a contradiction.

    contradiction   its number, from 1
    rank            of the explanation, 1 for the best
    part            index into the explanation's parts
    """

    contradiction: int
    rank: int
    explanation: RecordError
    part: int


def _finite(value: float) -> float:
    return value if np.isfinite(value) else float("nan")


def stated_u(test: RecordTest) -> float:
    """Standard uncertainty that a record states; NaN where it states none."""
    return test.u if test.u > 0.0 else float("nan")


RECORDS = Table[Sequence[RecordTest]](
    "records.csv",
    PAGE,
    (
        Column("group", "", "kind of the record", each(lambda t: str(t.group))),
        Column("record", "", "record", each(lambda t: t.record)),
        Column("part", "", "which of its numbers; empty for a record of one number", each(lambda t: t.part)),
        Column("unit", "", "unit of the three numbers that follow", each(lambda t: t.unit)),
        Column(
            "u_record",
            "",
            "standard uncertainty that the record states; empty where it states none",
            each(stated_u),
            DIGITS,
        ),
        Column(
            "error",
            "",
            "error of the record by all ranges and all other records, positive where it states too much; of a "
            "contradicted record the one that explains it; empty where nothing tests it",
            each(lambda t: _finite(t.error)),
            DIGITS,
        ),
        Column("u_error", "", "standard uncertainty of `error`", each(lambda t: _finite(t.u_error)), DIGITS),
        Column("w", "", "`error` over `u_error`", each(lambda t: t.w), ".3f"),
        Column("where", "", "file and key of the record", each(lambda t: t.where)),
    ),
)

CONTRADICTIONS = Table[Sequence[ExplanationRow]](
    "contradictions.csv",
    PAGE,
    (
        Column("contradiction", "", "number of the contradiction", each(lambda r: r.contradiction)),
        Column("rank", "", "of the explanation, 1 for the most likely", each(lambda r: r.rank)),
        Column("group", "", "kind of the record that would be wrong", each(lambda r: str(r.explanation.group))),
        Column("record", "", "that record", each(lambda r: r.explanation.record)),
        Column("part", "", "which of its numbers", each(lambda r: r.explanation.parts[r.part])),
        Column("unit", "", "unit of the two numbers that follow", each(lambda r: r.explanation.unit)),
        Column(
            "error",
            "",
            "error of the record, positive where it states too much",
            each(lambda r: r.explanation.errors[r.part]),
            DIGITS,
        ),
        Column("u_error", "", "standard uncertainty of `error`", each(lambda r: r.explanation.u[r.part]), DIGITS),
        Column(
            "gain",
            "",
            "decrease of the weighted sum of squares if the record is wrong",
            each(lambda r: r.explanation.gain),
            ".2f",
        ),
        Column("where", "", "file and keys of the record", each(lambda r: r.explanation.where)),
    ),
)


def listed_tests(coordinates: AdjustedCoordinates) -> tuple[RecordTest, ...]:
    """Tests of every number; a contradicted record has the error that explains it.

    The adjustment allows for the errors of all records that could explain a contradiction, so that in it each of them
    hides behind the others.
    """
    explained = {
        (explanation.record, part): (explanation, k)
        for contradiction in coordinates.contradictions
        for explanation in contradiction.explanations
        for k, part in enumerate(explanation.parts)
    }
    tests = []
    for test in coordinates.records:
        explanation, k = explained.pop((test.record, test.part), (None, 0))
        if explanation is not None:
            test = replace(test, error=explanation.errors[k], u_error=explanation.u[k])
        tests.append(test)
    return (*tests, *(_test_of(explanation, k) for explanation, k in explained.values()))


def _test_of(explanation: RecordError, part: int) -> RecordTest:
    """Test of what states nothing by itself, such as a line."""
    return RecordTest(
        group=explanation.group,
        record=explanation.record,
        where=explanation.where,
        part=explanation.parts[part],
        unit=explanation.unit,
        u=0.0,
        error=explanation.errors[part],
        u_error=explanation.u[part],
    )


def explanation_rows(contradictions: Iterable[Contradiction]) -> list[ExplanationRow]:
    """Rows of contradictions.csv."""
    return [
        ExplanationRow(number, rank, explanation, part)
        for number, contradiction in enumerate(contradictions, 1)
        for rank, explanation in enumerate(contradiction.explanations, 1)
        for part in range(len(explanation.parts))
    ]


def records_csv(coordinates: AdjustedCoordinates) -> str:
    """Table of every number of every record against its prior."""
    return RECORDS.csv(listed_tests(coordinates))


def contradictions_csv(coordinates: AdjustedCoordinates) -> str:
    """Table of the explanations of each contradiction; no rows without one."""
    return CONTRADICTIONS.csv(explanation_rows(coordinates.contradictions))


def name_of(test: RecordTest) -> str:
    """Record and part as one name.

    >>> name_of(RecordTest(RecordGroup.MONUMENTS, "monument ZY103", "", "east", "mm", 0.1, 1.0, 0.05))
    'monument ZY103 east'
    """
    return f"{test.record} {test.part}".strip()


def by_group(records: Iterable[RecordTest]) -> dict[RecordGroup, list[RecordTest]]:
    """Tests of each group, largest |w| first, untested ones last."""
    groups: dict[RecordGroup, list[RecordTest]] = {group: [] for group in RecordGroup}
    for test in records:
        groups[test.group].append(test)
    return {
        group: sorted(tests, key=lambda t: -abs(t.w) if np.isfinite(t.w) else 1.0)
        for group, tests in groups.items()
        if tests
    }


def worst_of_all(records: Iterable[RecordTest]) -> RecordTest | None:
    """Test with the largest |w|; None where nothing is tested."""
    return max((test for test in records if np.isfinite(test.w)), key=lambda test: abs(test.w), default=None)


def record_objects(coordinates: AdjustedCoordinates) -> dict[str, Any]:
    """Keys of `--json` on records and checks; numbers in the unit beside them."""
    return {
        "records": [_record_object(test) for test in listed_tests(coordinates)],
        "groups": [_group_object(test) for test in coordinates.groups],
        "contradictions": [_contradiction_object(contradiction) for contradiction in coordinates.contradictions],
        "scatter": [_scatter_object(scatter) for scatter in coordinates.scatter],
        "unchecked": list(coordinates.unchecked),
        "unmeasured": list(coordinates.unmeasured),
    }


def _record_object(test: RecordTest) -> dict[str, Any]:
    return {
        "group": str(test.group),
        "record": test.record,
        "part": test.part,
        "unit": test.unit,
        "u_record": stated_u(test),
        "error": test.error,
        "u_error": test.u_error,
        "w": test.w,
        "where": test.where,
    }


def _group_object(test: GroupTest) -> dict[str, Any]:
    return {
        "group": str(test.group),
        "chi_squared": test.statistic,
        "degrees_of_freedom": test.degrees,
        "probability": test.probability,
    }


def _contradiction_object(contradiction: Contradiction) -> dict[str, Any]:
    return {
        "text": contradiction.text,
        "explanations": [
            {
                "group": str(explanation.group),
                "record": explanation.record,
                "parts": list(explanation.parts),
                "unit": explanation.unit,
                "errors": list(explanation.errors),
                "u_errors": list(explanation.u),
                "gain": explanation.gain,
                "where": explanation.where,
            }
            for explanation in contradiction.explanations
        ],
    }


def _scatter_object(scatter: ClassScatter) -> dict[str, Any]:
    return {"class": scatter.name, "variance_factor": scatter.factor, "shots": scatter.shots, "sway": scatter.sway_m}


def records_sentence(coordinates: AdjustedCoordinates) -> str:
    """Numbers tested, and records contradicted, in words; "" without any test."""
    records = listed_tests(coordinates)
    worst = worst_of_all(records)
    if worst is None:
        return ""
    tested = sum(bool(np.isfinite(test.w)) for test in records)
    untested = len(records) - tested
    more = f"; nothing tests {untested} more" if untested else ""
    contradicted = "; ".join(" or ".join(e.record for e in c.explanations) for c in coordinates.contradictions)
    return (
        f"{tested} numbers of the records were tested against the ranges and each other{more}; the largest misfit is "
        f"that of {name_of(worst)}, w {worst.w:+.1f}. "
        + (f"Contradicted by the ranges: {contradicted}." if contradicted else "The ranges contradict none of them.")
    )


def checks_sentences(coordinates: AdjustedCoordinates) -> list[str]:
    """Scatter by class, unchecked and unmeasured points, in words; without what there is not."""
    sentences = []
    if coordinates.scatter:
        sentences.append(f"By class of points: {', '.join(map(_class_words, coordinates.scatter))}.")
    if coordinates.unchecked:
        why = "as an error of one line or survey could move them unseen"
        sentences.append(f"Unchecked, {why}: {some(coordinates.unchecked)}.")
    hidden = {}
    for test in sorted(coordinates.records, key=lambda t: t.detectable):
        if test.unchecked and test.in_common:  # of several parts the least known
            size = f"{test.detectable:.2g} {test.unit}" if np.isfinite(test.detectable) else "any size"
            hidden[test.record.removesuffix(ALIKE)] = size
    if hidden:
        sizes = "; ".join(f"{record} by {size}" for record, size in hidden.items())
        sentences.append(
            f"Nothing else measures these alike, so that smaller errors in common would not show: {sizes}."
        )
    if coordinates.unmeasured:
        sentences.append(f"Not measured: {some(coordinates.unmeasured)}.")
    return sentences


def _class_words(scatter: ClassScatter) -> str:
    sway = f" with a sway of {scatter.sway_m / MILLIMETRE:.2f} mm included" if scatter.sway_m else ""
    return f"{scatter.name} {scatter.factor:.2f}{sway}"


def some(names: Sequence[str], most: int = SOME) -> str:
    """Names in a sentence, the first ones where there are many.

    >>> some(["A", "B"]), some(list("ABCDEFGHI"), 3)
    ('A, B', 'A, B, C and 6 more')
    """
    more = len(names) - most
    return ", ".join(names) if more <= 1 else f"{', '.join(names[:most])} and {more} more"
