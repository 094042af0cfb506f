"""All files of a reduction, written into a directory."""

from datetime import UTC, datetime
from pathlib import Path

from catseye.gateways.epoch.objects import coordinates_object, pose_object, provenance_object
from catseye.gateways.epoch.report import report
from catseye.gateways.epoch.tables import coordinates_csv, ranges_csv, surface_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, write_files
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.ranges import Progress


def write_reduction(reduction: Reduction, directory: Path, progress: Progress | None = None) -> None:
    """Tables, objects, report, and last the provenance with the hashes of the others."""
    when = datetime.now(UTC)
    files: Files = {
        "ranges.csv": lambda: ranges_csv(reduction),
        "coordinates.csv": lambda: coordinates_csv(reduction),
        "surface.csv": lambda: surface_csv(reduction),
        "coordinates.json": lambda: json_page(coordinates_object(reduction)),
        "pose.json": lambda: json_page(pose_object(reduction)),
        "report.html": lambda: report(reduction, when),
    }
    write_files(files, directory, provenance_object(reduction, when), progress=progress)
