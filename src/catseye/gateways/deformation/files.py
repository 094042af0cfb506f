"""Files of movements from changes of ranges."""

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from catseye.aliases import Progress
from catseye.gateways.deformation.figures import movement_figures
from catseye.gateways.deformation.objects import FORMAT, movement_passages, movements_object
from catseye.gateways.deformation.tables import CHANGES, CONSTRAINTS, MOVEMENTS
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import Card, ResultReport
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.table_report import PartOfReport, report_table, table_report
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.deformation.movements import MeasuredMovements


def movements_report(measured: MeasuredMovements, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of movements.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    words, changes = measured.words, measured.changes
    figures = {name: (drawn.figure, drawn.caption) for name, drawn in movement_figures(measured).items()}
    fit = f"p = {measured.p_fit:.2g}" if np.isfinite(measured.p_fit) else "unchecked"
    tests = [report_table(CONSTRAINTS, measured)] if measured.tests else []
    return table_report(
        "Movements between two epochs",
        f"{len(words)} points from {len(changes.stations)} stations, after less before",
        measured.verdict,
        cards=[
            Card("Moved", f"{words.count('moved')} of {len(words)}", f"points, level {measured.level:g} for all"),
            Card("Undetermined", str(words.count("undetermined")), "points with too few ranges"),
            Card("Agreement", fit, f"of the changes, {measured.degrees_of_freedom} degrees of freedom"),
        ],
        passages=movement_passages(measured),
        parts=[
            PartOfReport("Movements", [report_table(MOVEMENTS, measured)], figures),
            PartOfReport("Constraints", tests),
            PartOfReport("Changes of range", [report_table(CHANGES, measured)]),
        ],
        when=when,
        inputs=inputs,
    )


def write_movements(
    measured: MeasuredMovements, directory: Path, inputs: Mapping[str, str], progress: Progress | None = None
) -> None:
    """Write report, tables, JSON and figures, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    """
    when = datetime.now(UTC)
    tables = (MOVEMENTS, CHANGES, CONSTRAINTS) if measured.tests else (MOVEMENTS, CHANGES)
    files: Files = {
        **{table.file: partial(table.pieces, measured) for table in tables},
        "movements.json": lambda: json_page(movements_object(measured)),
        "report.html": lambda: report_page(movements_report(measured, when, inputs)),
        **{f"{name}.svg": partial(svg, drawn.figure) for name, drawn in movement_figures(measured).items()},
    }
    provenance = {"format": FORMAT, "made_by": "catseye movements"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
