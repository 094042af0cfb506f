"""Write all files of a reduction into a directory."""

from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np

from catseye.aliases import Progress
from catseye.gateways.epoch.objects import COVARIANCE, coordinates_object, matrix_file, pose_object, provenance_object
from catseye.gateways.epoch.record_tests import contradictions_csv, records_csv
from catseye.gateways.epoch.report import reduction_report
from catseye.gateways.epoch.results_fits import RESULTS, results_fits
from catseye.gateways.epoch.tables import coordinates_csv, ranges_csv, surface_csv
from catseye.gateways.epoch.third_order import DOCUMENT, STRUCTURE_CSV, structure_csv, third_order_object
from catseye.gateways.writers.matrix_fits import matrix_pages
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import FORMAT
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.written import Files, write_files
from catseye.reduction.epoch.epoch import Reduction

STEP = 150  # points whose rows are computed together


def _covariance(reduction: Reduction) -> Iterator[bytes]:
    """Full covariance of coordinates.json."""
    coordinates = reduction.coordinates
    indices = np.arange(len(coordinates.points))
    cards = {
        "BUNIT": ("m2", "ground frame; x, y, z point by point"),
        "CAMPAIGN": (reduction.campaign.site.campaign.name, ""),
        "ORDER": ("covariance_order", "of coordinates.json in this directory"),
    }
    parts = (coordinates.joint.between(indices[k : k + STEP], indices) for k in range(0, len(indices), STEP))
    return matrix_pages(parts, 3 * len(indices), cards)


def write_reduction(reduction: Reduction, directory: Path, progress: Progress | None = None) -> None:
    """Write tables, JSON, report, and the provenance with their hashes."""
    when = datetime.now(UTC)
    cached = cache(reduction.held)  # once, for both FITS files and the page

    order = reduction.third_order
    separate = matrix_file(reduction.coordinates.points) == COVARIANCE
    files: Files = {
        "ranges.csv": lambda: ranges_csv(reduction),
        "coordinates.csv": lambda: coordinates_csv(reduction),
        "surface.csv": lambda: surface_csv(reduction),
        "records.csv": lambda: records_csv(reduction.coordinates),
        "contradictions.csv": lambda: contradictions_csv(reduction.coordinates),
        "coordinates.json": lambda: json_page(coordinates_object(reduction)),
        **({COVARIANCE: lambda: _covariance(cached())} if separate else {}),
        RESULTS: lambda: results_fits(cached()),
        **({} if order is None else {STRUCTURE_CSV: lambda: structure_csv(order)}),
        **({} if order is None else {DOCUMENT: lambda: json_page({"format": FORMAT, **third_order_object(order)})}),
        "pose.json": lambda: json_page(pose_object(reduction)),
        "report.html": lambda: report_page(reduction_report(cached(), when, progress)),
    }
    write_files(files, directory, provenance_object(reduction, when), progress=progress)
