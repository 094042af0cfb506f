"""Files of an EDM baseline, and its record of pillars."""

from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from catseye.aliases import Progress
from catseye.gateways.baseline.objects import baseline_object
from catseye.gateways.baseline.report import baseline_report
from catseye.gateways.baseline.tables import distances_csv, observations_csv, pillars_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.records.laboratory.baseline import FORMAT, Baseline, baseline_text
from catseye.reduction.baseline.instrument import record_values

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

MARK = f'format = "{FORMAT}"'


def write_calibration(
    calibration: "BaselineCalibration", directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    calibration   a calibration
    directory     existing, from `writers.output.atomic_directory`
    inputs        SHA-256 of each input file, by name
    progress      called for each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "pillars.csv": lambda: pillars_csv(calibration),
        "distances.csv": lambda: distances_csv(calibration),
        "observations.csv": lambda: observations_csv(calibration),
        "baseline.json": lambda: json_page(baseline_object(calibration)),
        "report.html": lambda: report_page(baseline_report(calibration, when, inputs)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye baseline", "settings": asdict(calibration.settings)}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)


def record_text(
    calibration: "BaselineCalibration",
    inputs: Mapping[str, str],
    *,
    name: str = "baseline",
    serial: str | None = None,
    measured_on: date | None = None,
    by: str | None = None,
    report: str | None = None,
) -> str:
    """Text of BASELINE.toml.

    calibration   a calibration
    inputs        SHA-256 of each input file, by name
    name          of the baseline
    serial        of the instrument
    measured_on   day of the shots
    by            who measured
    report        reference to the report
    """
    record = Baseline(
        format=FORMAT,
        name=name,
        serial=serial,
        measured_on=measured_on,
        by=by,
        report=report,
        inputs_sha256=dict(inputs),
        **record_values(calibration),
    )
    return baseline_text(record)
