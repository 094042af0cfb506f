"""Answers from an archive by their question: tables, sentences, figures, JSON, files."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from catseye.aliases import Progress
from catseye.gateways.query import objects, summary, tables
from catseye.gateways.writers.columns import Table
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT = "catseye-query-1"
WIDEST = 36  # characters of a cell on a terminal
MOST_LINES = 24  # rows of a table on a terminal; the middle ones are left out


class AnswerForm(NamedTuple):
    """Form of the answer to one question.

    tables     the main one first; none for SQL, whose columns are its own
    passages   sentences of an answer
    about      its object for JSON, besides the tables
    figures    name of a function of `figures`; "" for none
    shown      columns of the main table on a terminal; none: no table there
    """

    tables: tuple[Table[Any], ...]
    passages: Callable[[Any], list[Passage]]
    about: Callable[[Any], dict[str, Any]]
    figures: str = ""
    shown: tuple[str, ...] = ()


FORMS: Mapping[str, AnswerForm] = {
    "nights": AnswerForm(
        (tables.NIGHTS,),
        summary.nights_passages,
        lambda found: {},
        shown=("night", "source", "points", "elevation_deg", "temperature_c", "variance_factor", "verdict"),
    ),
    "point": AnswerForm(
        (tables.POINT,),
        summary.point_passages,
        objects.point_object,
        figures="point_figures",
        shown=("night", "mjd_utc", "x_m", "y_m", "z_m", "u_x_mm", "u_y_mm", "u_z_mm"),
    ),
    "ranger": AnswerForm(
        (tables.ZEROS, tables.DRIFT),
        summary.ranger_passages,
        lambda series: {"ranger": series.ranger},
        figures="ranger_figures",
        shown=("parameter", "night", "mjd_utc", "value", "u", "own", "u_own"),
    ),
    "pose": AnswerForm(
        (tables.POSE,),
        summary.pose_passages,
        lambda series: {"body": series.body},
        figures="pose_figures",
        shown=(
            *("night", "elevation_deg", "translation_x_mm", "translation_y_mm", "translation_z_mm"),
            *("rotation_x_arcsec", "rotation_y_arcsec", "rotation_z_arcsec"),
        ),
    ),
    "surface": AnswerForm(
        (tables.SURFACE, tables.TERMS, tables.PRISMS),
        summary.surface_passages,
        lambda series: {"left_out": series.left_out},
        figures="surface_figures",
        shown=("night", "elevation_deg", "temperature_c", "prisms", "focal_length_m", "u_focal_length_mm", "rms_um"),
    ),
    "certificates": AnswerForm(
        (tables.CERTIFICATES,),
        summary.certificates_passages,
        lambda found: {"night": found.night, "mjd_utc": found.mjd},
        shown=("instrument", "kind", "validity", "left_d", "value", "u", "unit", "sha256"),
    ),
    "again": AnswerForm(
        (tables.AGAIN,),
        summary.again_passages,
        objects.again_object,
        figures="again_figures",
        shown=("point", "dx_mm", "dy_mm", "dz_mm", "u_dx_mm", "u_dy_mm", "u_dz_mm", "over_u"),
    ),
    "sql": AnswerForm((), summary.sql_passages, objects.sql_object),
}


def answer_object(question: str, answer: Any) -> dict[str, Any]:
    """JSON object of an answer: what it is about, then each table as a list of rows."""
    form = FORMS[question]
    rows = {Path(table.file).stem: objects.rows_of(table, answer) for table in form.tables}
    return {**form.about(answer), **rows}


def answer_figures(question: str, answer: Any) -> "dict[str, Figure]":
    """Figures of an answer by name."""
    name = FORMS[question].figures
    if not name:
        return {}
    drawn: dict[str, Figure] = getattr(import_module("catseye.gateways.query.figures"), name)(answer)
    return drawn


def answer_quantities(question: str, answer: Any) -> dict[str, dict[str, tuple[Any, str]]]:
    """Columns of each table: values and unit, by name without unit."""
    if question == "sql":
        return {"rows": {name: (values, answer.units.get(name, "")) for name, values in answer.columns.items()}}
    return {
        Path(table.file).stem: table.quantities(answer, [column.name for column in table.columns])
        for table in FORMS[question].tables
    }


def answer_lines(question: str, answer: Any) -> list[str]:
    """Main table for a terminal, its middle left out where it is long."""
    form = FORMS[question]
    if question == "sql":
        columns = {name: [_cell(value) for value in values.tolist()] for name, values in answer.columns.items()}
    else:
        named = {column.name: column for column in form.tables[0].columns}
        columns = {name: _cells(named[name], answer) for name in form.shown}
    return _aligned(columns)


def _cells(column: Any, answer: Any) -> list[str]:
    """Cells of a column, long texts cut and numbers without a format rounded."""
    values = column.value(answer)
    plain = values.tolist() if hasattr(values, "tolist") else list(values)
    return column.cells(values) if column.form else [_cell(value) for value in plain]


def _cell(value: Any) -> str:
    """Text of a value for a terminal."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.7g}"
    text = str(value)
    return text if len(text) <= WIDEST else text[: WIDEST - 1] + "…"


def _aligned(columns: Mapping[str, Sequence[str]]) -> list[str]:
    """Lines of a table, its columns aligned."""
    rows = list(zip(*columns.values(), strict=True))
    half = MOST_LINES // 2
    left_out = len(rows) - 2 * half
    shown = rows if left_out <= 1 else [*rows[:half], *rows[-half:]]
    widths = [max(len(text) for text in (name, *cells)) for name, *cells in zip(columns, *shown, strict=True)]
    lines = [
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in ([*columns], *shown)
    ]
    if left_out > 1:
        lines.insert(half + 1, f"... {left_out} more rows")
    return lines


def write_answer(
    question: str,
    answer: Any,
    directory: Path,
    inputs: Mapping[str, str],
    about: Mapping[str, Any],
    progress: Progress | None = None,
) -> None:
    """Write JSON, tables and figures of an answer into an empty directory.

    inputs   SHA-256 of what was read, by name
    about    verdict and question, for the JSON
    """
    from catseye.gateways.writers.drawing import svg
    from catseye.gateways.writers.objects import json_page
    from catseye.gateways.writers.written import origin, write_files

    files: dict[str, Callable[[], Any]] = {
        "result.json": lambda: json_page({"format": FORMAT, **about, **answer_object(question, answer)})
    }
    for table in FORMS[question].tables:
        files[table.file] = partial(table.pieces, answer)
    for name, drawn in answer_figures(question, answer).items():
        files[f"{name}.svg"] = partial(svg, drawn)
    provenance = {"format": FORMAT, "made_by": f"catseye query, {question}", **origin(datetime.now(UTC), inputs)}
    write_files(files, directory, provenance, progress=progress)
