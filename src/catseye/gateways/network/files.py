"""Write the files of an adjusted network, or of two compared epochs."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.gateways.network.comparison import FORMAT as COMPARISON
from catseye.gateways.network.comparison import comparison_object
from catseye.gateways.network.comparison_report import comparison_report
from catseye.gateways.network.objects import FORMAT, network_json
from catseye.gateways.network.report import network_report
from catseye.gateways.network.tables import coordinates_csv, displacements_csv, observations_csv, parameters_csv
from catseye.gateways.network.xml import network_xml
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import ComparedEpochs


def input_hashes(source: Path) -> dict[str, str]:
    """SHA-256 of a network's file, or of the tables and air.toml in its folder, by name.

    source   a file, or a folder with points.csv and ranges.csv
    """
    files = sorted([*source.glob("*.csv"), *source.glob("air.toml")]) if source.is_dir() else [source]
    return {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def write_network(
    adjusted: AdjustedNetwork,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    progress: Progress | None = None,
) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    adjusted    adjusted on a solution
    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name, see `input_hashes`
    progress    called for each file
    """
    when = datetime.now(UTC)
    provenance = {"format": FORMAT, "made_by": "catseye adjust", "settings": _settings(adjusted)}
    write_files(
        _files(adjusted, when, inputs),
        directory,
        {**provenance, **origin(when, inputs)},
        progress=progress,
    )


def write_comparison(
    compared: ComparedEpochs, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write the comparison, the files of each epoch with its number as prefix, and the provenance.

    compared    two epochs
    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "displacements.csv": lambda: displacements_csv(compared),
        "comparison.json": lambda: [json_page(comparison_object(compared))],
        "report.html": lambda: report_page(comparison_report(compared, when, inputs)),
        **_files(replace(compared.first, treatment=None), when, inputs, prefix="epoch-1-"),
        **_files(replace(compared.second, treatment=None), when, inputs, prefix="epoch-2-"),
    }
    d = compared.deformation
    settings = {
        **_settings(compared.first),
        "displacement_level": d.level,
        "displacement_power": d.power,
        "datums_may_differ_by": d.datum,
        "variance_factor": compared.variance_factor.value,
    }
    provenance = {"format": COMPARISON, "made_by": "catseye adjust", "settings": settings}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)


def _settings(adjusted: AdjustedNetwork) -> dict[str, Any]:
    return {
        "level": adjusted.level,
        "mdb_level": adjusted.detectability.level,
        "power": adjusted.detectability.power,
        "scaled": adjusted.scaled,
        "test": adjusted.test,
        "datum": adjusted.solution.datum,
    }


def _files(
    adjusted: AdjustedNetwork,
    when: datetime,
    inputs: Mapping[str, str],
    *,
    prefix: str = "",
) -> Files:
    files: Files = {
        "coordinates.csv": lambda: coordinates_csv(adjusted),
        "observations.csv": lambda: observations_csv(adjusted),
        "parameters.csv": lambda: parameters_csv(adjusted),
        "adjustment.json": lambda: network_json(adjusted, lines=True),
        "adjustment.xml": lambda: network_xml(adjusted),
        "report.html": lambda: report_page(network_report(adjusted, when, inputs, prefix=prefix)),
    }
    return {prefix + name: pieces for name, pieces in files.items()}
