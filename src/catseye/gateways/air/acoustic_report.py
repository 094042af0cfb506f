"""Files of acoustic paths: tables, JSON and one report."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.gateways.air.acoustic_objects import (
    full_object,
    words,
)
from catseye.gateways.air.charts import acoustic_charts
from catseye.gateways.air.tables import path_temperatures_csv, shots_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import (
    Block,
    Card,
    Heading,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, sentences, text, uncertainty
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.air.sound_path import AcousticPath, AcousticReduction

FORMAT = "catseye-acoustic-1"


def write_acoustic(reduction: "AcousticReduction", directory: Path, progress: Progress | None = None) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    reduction   paths as reduced
    directory   existing, from `writers.output.atomic_directory`
    progress    called for each file
    """
    when, paths = datetime.now(UTC), reduction.paths
    files: Files = {
        "path_temperatures.csv": lambda: path_temperatures_csv(paths),
        "shots.csv": lambda: shots_csv(paths),
        "acoustic.json": lambda: json_page(full_object(reduction)),
        "report.html": lambda: report_page(acoustic_report(reduction, when)),
    }
    settings = {"model": paths[0].model, "air_model": paths[0].air_model}
    provenance = {"format": FORMAT, "made_by": "catseye acoustic", "settings": settings}
    write_files(files, directory, {**provenance, **origin(when, reduction.inputs)}, progress=progress)


def acoustic_report(reduction: "AcousticReduction", when: datetime) -> ResultReport:
    """Report of acoustic paths; `when` is UTC."""
    return ResultReport(
        title="Temperature by sound",
        subtitle=f"reduced by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ",
        verdict=reduction.verdict,
        sections=[
            *(_section(k, path) for k, path in enumerate(reduction.paths)),
            origin_section(when, reduction.inputs),
        ],
        cards=[card for path in reduction.paths for card in _cards(path)],
        label="catseye: temperature by sound",
    )


def _cards(path: "AcousticPath") -> list[Card]:
    sheet, over = path.sheet, path.mean
    if not over.used:
        return []
    way = f"from {sheet.ranger} to {sheet.target}"
    return [
        Card("Temperature", f"{over.temperature_c:.3f} °C", f"u = {over.u_temperature_c:.3f} °C, {way}"),
        Card("Wind", f"{over.wind:+.2f} m/s", way),
        Card("Group index", f"{over.refractivity / PPM:.3f} ppm", f"u = {over.u_refractivity / PPM:.3f} ppm, {way}"),
    ]


def _section(number_: int, path: "AcousticPath") -> ReportSection:
    return ReportSection(
        f"path-{number_}",
        f"{path.sheet.ranger} to {path.sheet.target}",
        [
            TableBlock(f"summary-{number_}", sentences(words(path))),
            *acoustic_charts(path, f"-{number_}"),
            *_budget(path, f"budget-{number_}"),
            Heading("Shots"),
            TableBlock(f"shots-{number_}", _shots(path)),
        ],
    )


def _budget(path: "AcousticPath", key: str) -> list[Block]:
    if not path.used.any():
        return []
    k = int(np.argmax(path.used))
    rows = [(name, float(part[k])) for name, part in path.temperatures.parts_c.items()]
    rows.append(("combined", float(path.temperatures.u_temperature_c[k])))
    lead = "Standard uncertainty of the first used shot by cause; causes add in quadrature."
    table = ReportTable.of_rows(rows, text("cause", "cause"), uncertainty("u", "u", unit="°C", digits=4))
    return [Text(lead), TableBlock(key, table)]


def _shots(path: "AcousticPath") -> ReportTable:
    shots, air = path.shots, path.temperatures
    back = np.full(len(shots.mjd), np.nan) if shots.time_ba is None else shots.time_ba
    return ReportTable(
        (
            number("mjd", "MJD", shots.mjd, digits=6),
            text("file", "file", shots.file),
            number("time_ab", "A to B", shots.time_ab * 1e3, "ms", 5),
            number("time_ba", "B to A", back * 1e3, "ms", 5),
            number("temperature", "temperature", air.temperature_c, "°C", 3, u="u_temperature"),
            uncertainty("u_temperature", "u", air.u_temperature_c, "°C", 3),
            number("wind", "wind", air.wind, "m/s", 2),
            number("refractivity", "n_g − 1", air.group_refractivity / PPM, "ppm", 3),
            text("status", "status", [path.status(k) for k in range(len(shots.mjd))], kind="long"),
        )
    )
