"""Files of a structure's model or of its vibration: tables, JSON, report, samplers, provenance."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from catseye.aliases import Progress
from catseye.gateways.structure.objects import (
    FORMAT,
    structure_object,
    structure_samplers,
    vibration_object,
    vibration_samplers,
)
from catseye.gateways.structure.report import structure_report, vibration_report
from catseye.gateways.structure.tables import coefficients_csv, prediction_csv, residuals_csv, spectra_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.samplers_fits import SAMPLERS, join_samplers
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.structure.findings import StructureFindings
from catseye.reduction.structure.vibration import Vibration


def write_structure(
    found: StructureFindings, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write the files of a model.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    when = datetime.now(UTC)
    fit, predicted = found.fit, found.predicted
    files: Files = {
        "coefficients.csv": lambda: coefficients_csv(fit),
        "residuals.csv": lambda: residuals_csv(fit, found.check),
        "structure.json": lambda: json_page({"format": FORMAT, **structure_object(found)}),
        "report.html": lambda: report_page(structure_report(found, when, inputs)),
    }
    if predicted is not None:
        files = {"prediction.csv": lambda: prediction_csv(predicted, found.request), **files}
    provenance = {
        "format": FORMAT,
        "made_by": "catseye structure",
        "model": vars(fit.model) | {"group": fit.series.group},
    }
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    join_samplers(directory, SAMPLERS, structure_samplers(found))


def write_vibration(
    vibration: Vibration,
    directory: Path,
    *,
    zero_mjd: float,
    inputs: Mapping[str, str],
    progress: Progress | None = None,
) -> None:
    """Write the files of a vibration; arguments as for `write_structure`; zero_mjd: MJD of 0 s."""
    when = datetime.now(UTC)
    files: Files = {
        "spectra.csv": lambda: spectra_csv(vibration),
        "vibration.json": lambda: json_page({"format": FORMAT, **vibration_object(vibration)}),
        "report.html": lambda: report_page(vibration_report(vibration, when, inputs)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye structure --vibration", "start_mjd_utc": zero_mjd}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    join_samplers(directory, SAMPLERS, vibration_samplers(vibration, zero_mjd))
