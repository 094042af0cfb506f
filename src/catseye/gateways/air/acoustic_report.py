"""Files of acoustic paths: tables, JSON and one HTML report."""

from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.gateways.air.acoustic_figures import acoustic_figures
from catseye.gateways.air.acoustic_objects import (
    full_object,
    words,
)
from catseye.gateways.air.tables import path_temperatures_csv, shots_csv
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.air.sound_path import AcousticPath, AcousticReduction

FORMAT = "catseye-acoustic-1"
CAPTIONS = {
    "recording": "Recording of the first shot around the predicted arrival.",
    "correlation": "Correlation with the known signal over the window and around its peak. Dots are samples; "
    "the arrival is interpolated between them.",
    "temperature": "Mean temperature of the path. The band includes what all shots share: length, electronics, "
    "humidity, crosswind, formula. The bars show only what varies from shot to shot.",
}


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
        "report.html": lambda: acoustic_report(reduction, when),
    }
    settings = {"model": paths[0].model, "air_model": paths[0].air_model}
    provenance = {"format": FORMAT, "made_by": "catseye acoustic", "settings": settings}
    write_files(files, directory, {**provenance, **origin(when, reduction.inputs)}, progress=progress)


def acoustic_report(reduction: "AcousticReduction", when: datetime) -> str:
    """HTML report; `when` is UTC."""
    paths = reduction.paths
    names = [f"{path.sheet.ranger} to {path.sheet.target}" for path in paths]
    links = "".join(f'<a href="#path-{i}">{escape(name)}</a>' for i, name in enumerate(names))
    header = (
        f'<header><h1>Temperature by sound</h1><div class="faint">reduced by catseye on {when:%Y-%m-%d %H:%M} UTC; '
        f'u = standard uncertainty, 1σ</div><nav>{links}<a href="#provenance">Provenance</a></nav></header>'
    )
    body = [
        header,
        verdict_line(reduction.verdict),
        *(_section(i, path) for i, path in enumerate(paths)),
        _provenance(reduction.inputs, when),
    ]
    return page("catseye: temperature by sound", "\n".join(body))


def _section(number: int, path: "AcousticPath") -> str:
    sheet, over = path.sheet, path.mean
    cards = [
        card("Temperature", f"{over.temperature_c:.3f} °C", f"u = {over.u_temperature_c:.3f} °C"),
        card("Wind", f"{over.wind:+.2f} m/s", f"from {sheet.ranger} to {sheet.target}"),
        card("Group index", f"{over.refractivity / PPM:.3f} ppm", f"u = {over.u_refractivity / PPM:.3f} ppm"),
    ] if over.used else []  # fmt: skip
    passages = "".join(f"<dt>{escape(title)}</dt><dd>{escape(text)}</dd>" for title, text in words(path))
    drawn = acoustic_figures(path)
    return section(
        f"path-{number}",
        f"{sheet.ranger} to {sheet.target}",
        f'<div class="cards">{"".join(cards)}</div>',
        f"<dl>{passages}</dl>",
        *(picture(drawn[name], caption) for name, caption in CAPTIONS.items() if name in drawn),
        _budget(path),
        _shots(path),
    )


def _budget(path: "AcousticPath") -> str:
    if not path.used.any():
        return ""
    k = int(np.argmax(path.used))
    rows = [(name, f"{float(part[k]):.4f}") for name, part in path.temperatures.parts_c.items()]
    rows.append(("combined", f"{float(path.temperatures.u_temperature_c[k]):.4f}"))
    return paragraph("Standard uncertainty of the first used shot, °C, by cause; causes add in quadrature.") + table(
        ("cause", "u (°C)"), rows, "tn"
    )


def _shots(path: "AcousticPath") -> str:
    shots, air = path.shots, path.temperatures
    back = np.full(len(shots.mjd), np.nan) if shots.time_ba is None else shots.time_ba

    def cell(value: float, form: str) -> str:
        return format(float(value), form) if np.isfinite(value) else ""

    rows = [
        (f"{shots.mjd[k]:.6f}", shots.file[k], cell(shots.time_ab[k] * 1e3, ".5f"), cell(back[k] * 1e3, ".5f"),
         cell(air.temperature_c[k], ".3f"), cell(air.u_temperature_c[k], ".3f"), cell(air.wind[k], "+.2f"),
         cell(air.group_refractivity[k] / PPM, ".3f"), path.status(k))
        for k in range(len(shots.mjd))
    ]  # fmt: skip
    columns = ("MJD", "file", "A to B (ms)", "B to A (ms)", "°C", "u (°C)", "wind (m/s)", "n_g - 1 (ppm)", "status")
    return table(columns, rows, "ntnnnnnnw")


def _provenance(inputs: Mapping[str, str], when: datetime) -> str:
    return section(
        "provenance",
        "Provenance",
        table(("file read", "SHA-256"), list(inputs.items()), "th"),
        table(("item", "value"), [("made (UTC)", f"{when:%Y-%m-%d %H:%M:%S}"), *versions().items()], "tt"),
    )
