"""Files of a scan, a search or an identified servo: tables, figures, JSON, last the provenance."""

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from catseye.gateways.writers.columns import Table
from catseye.gateways.writers.drawing import Figure, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.samplers_fits import join_tables
from catseye.gateways.writers.written import Files, origin, write_files

Sources = Mapping[Table[Any], Any]  # what each table is written from


def write_scan(
    directory: Path,
    made_by: str,
    *,
    sources: Sources,
    answer: Mapping[str, Any],
    figures: Mapping[str, Figure],
    hashes: Mapping[str, str],
) -> None:
    """Write every file of a result into an empty directory.

    made_by   the command, for the provenance
    sources   of each table
    answer    JSON object, for `result.json`
    figures   by their names
    hashes    SHA-256 of each file read, by its name
    """
    when = datetime.now(UTC)
    form = f"catseye-{made_by.removeprefix('catseye ').replace(' ', '-')}-1"
    files: Files = {
        **{table.file: partial(table.csv, source) for table, source in sources.items()},
        "result.json": lambda: json_page({"format": form, **answer}),
        **{f"{name}.svg": partial(svg, figure) for name, figure in figures.items()},
    }
    write_files(files, directory, {"format": form, "made_by": made_by, **origin(when, hashes)})
    join_tables(directory, list(sources))
