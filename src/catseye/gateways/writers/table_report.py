"""Report of a result that has passages, figures and tables, and nothing else to explain."""

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import NamedTuple, TypeVar

import numpy as np
from matplotlib.figure import Figure

from catseye.gateways.writers.columns import PRINTED, Table
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import (
    Block,
    Card,
    DrawingBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    origin_section,
)
from catseye.gateways.writers.report_parts import ReportColumn, ReportTable, number, text
from catseye.verdict import Verdict

Source = TypeVar("Source")
DECIMALS = re.compile(r"\.(\d+)f")
MOST_DECIMALS = 5  # shown; the file beside the report has all
MOST_ROWS = 5_000  # listed


class PartOfReport(NamedTuple):
    """Section of a report on tables and figures.

    title     of the section
    tables    in their order
    figures   title -> figure, and its caption
    """

    title: str
    tables: Sequence[TableBlock]
    figures: Mapping[str, tuple[Figure, str]] = {}


def report_table(table: Table[Source], source: Source) -> TableBlock:
    """Table of a report with the columns of a file; the first one names the things.

    table    of the file, whose name without .csv is the key
    source   its rows: of more than 5000 the first ones, as the caption says
    """
    columns: list[ReportColumn] = []
    count = 0
    labels = [column.label for column in table.columns]
    for column in table.columns:
        values = column.value(source)
        if values is None:
            continue
        count = len(values)
        rows, heading = values[:MOST_ROWS], column.label.replace("_", " ")
        key = column.label if labels.count(column.label) == 1 else column.name  # azimuth of a posture, of its error
        if column.form or np.asarray(rows).dtype.kind in "iuf":
            digits = DECIMALS.fullmatch(column.form)
            decimals = 0 if not column.form else None if digits is None else min(int(digits[1]), MOST_DECIMALS)
            u = f"u_{column.label}" if f"u_{column.label}" in labels else ""
            unit = PRINTED.get(column.unit, column.unit)
            columns.append(number(key, heading, rows, unit, decimals, u=u))
        else:
            columns.append(text(key, heading, rows))
    caption = f"The first {MOST_ROWS} of {count} rows; all are in {table.file}." if count > MOST_ROWS else ""
    return TableBlock(table.file.removesuffix(".csv"), ReportTable(tuple(columns), columns[0].key), caption)


def table_report(
    title: str,
    subtitle: str,
    verdict: Verdict,
    *,
    cards: Sequence[Card],
    passages: Sequence[Passage],
    parts: Sequence[PartOfReport],
    when: datetime,
    inputs: Mapping[str, str],
) -> ResultReport:
    """Report of tables and figures.

    subtitle   what the numbers are; the time is added
    parts      sections; one without tables and figures is left out
    when       UTC
    inputs     SHA-256 of each input file, by name
    """
    sections = []
    for part in parts:
        blocks: list[Block] = [
            DrawingBlock(name, svg(figure), caption) for name, (figure, caption) in part.figures.items()
        ]
        blocks += part.tables
        if blocks:
            sections.append(ReportSection(part.title.lower().replace(" ", "-"), part.title, blocks))
    return ResultReport(
        title=title,
        subtitle=f"{subtitle}, by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ",
        verdict=verdict,
        cards=cards,
        passages=passages,
        sections=[*sections, origin_section(when, inputs)],
        label=f"catseye: {title}",
    )
