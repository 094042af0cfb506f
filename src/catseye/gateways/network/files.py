"""Write the files of an adjusted network, or of two compared epochs."""

import hashlib
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catseye.aliases import Progress
from catseye.gateways.network.comparison import FORMAT as COMPARISON
from catseye.gateways.network.comparison import ComparedEpochs, comparison_object
from catseye.gateways.network.findings import Findings
from catseye.gateways.network.objects import FORMAT, network_json
from catseye.gateways.network.tables import coordinates_csv, displacements_csv, observations_csv, parameters_csv
from catseye.gateways.network.xml import network_xml
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.network import AdjustedNetwork


def input_hashes(source: Path) -> dict[str, str]:
    """SHA-256 of a network's file, or of the tables in its folder, by name.

    source   a file, or a folder with points.csv and ranges.csv
    """
    files = sorted(source.glob("*.csv")) if source.is_dir() else [source]
    return {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def write_network(
    findings: Findings,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    progress: Progress | None = None,
    treated: "AdjustedNetwork | None" = None,
) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    findings    findings on a solution
    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name, see `input_hashes`
    progress    called for each file
    treated     treatment of the observations, if requested
    """
    when = datetime.now(UTC)
    provenance = {"format": FORMAT, "made_by": "catseye adjust", "settings": _settings(findings)}
    write_files(
        _files(findings, when, inputs, treated=treated),
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
    from catseye.gateways.network.comparison_report import comparison_report

    when = datetime.now(UTC)
    files: Files = {
        "displacements.csv": lambda: displacements_csv(compared),
        "comparison.json": lambda: [json_page(comparison_object(compared))],
        "report.html": lambda: [comparison_report(compared, when, inputs)],
        **_files(compared.first, when, inputs, prefix="epoch-1-"),
        **_files(compared.second, when, inputs, prefix="epoch-2-"),
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


def _settings(findings: Findings) -> dict[str, Any]:
    return {"level": findings.level, "scaled": findings.scaled, "test": findings.test, "datum": findings.solution.datum}


def _files(
    findings: Findings,
    when: datetime,
    inputs: Mapping[str, str],
    *,
    prefix: str = "",
    treated: "AdjustedNetwork | None" = None,
) -> Files:
    from catseye.gateways.network.report import network_report  # matplotlib is heavy

    files: Files = {
        "coordinates.csv": lambda: coordinates_csv(findings),
        "observations.csv": lambda: observations_csv(findings),
        "parameters.csv": lambda: parameters_csv(findings),
        "adjustment.json": lambda: network_json(findings, lines=True, treated=treated),
        "adjustment.xml": lambda: network_xml(findings),
        "report.html": lambda: [network_report(findings, when, inputs, prefix=prefix, treated=treated)],
    }
    return {prefix + name: pieces for name, pieces in files.items()}
