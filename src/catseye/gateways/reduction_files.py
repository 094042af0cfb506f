"""All files of a reduction, written into a directory."""

import hashlib
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from catseye.gateways.objects import coordinates_object, json_page, pose_object, provenance_object
from catseye.gateways.output import PROVENANCE
from catseye.gateways.reports import report
from catseye.gateways.tables import coordinates_csv, ranges_csv, surface_csv
from catseye.reduction.epoch import Reduction
from catseye.reduction.ranges import Progress


def write_reduction(reduction: Reduction, directory: Path, progress: Progress | None = None) -> None:
    """Tables, objects, report, and last the provenance with the hashes of the others."""
    when = datetime.now(UTC)
    files: dict[str, Callable[[], str]] = {
        "ranges.csv": lambda: ranges_csv(reduction),
        "coordinates.csv": lambda: coordinates_csv(reduction),
        "surface.csv": lambda: surface_csv(reduction),
        "coordinates.json": lambda: json_page(coordinates_object(reduction)),
        "pose.json": lambda: json_page(pose_object(reduction)),
        "report.html": lambda: report(reduction, when),
    }
    outputs: dict[str, str] = {}
    for done, (name, text) in enumerate(files.items()):
        if progress is not None:
            progress(f"writing {name}", done, len(files))
        raw = text().encode("utf-8")
        (directory / name).write_bytes(raw)
        outputs[name] = hashlib.sha256(raw).hexdigest()
    (directory / PROVENANCE).write_bytes(json_page(provenance_object(reduction, when, outputs)).encode("utf-8"))
    if progress is not None:
        progress("writing", len(files), len(files))
