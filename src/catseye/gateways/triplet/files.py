"""Files of triplet calibrations: a sheet for each as text, page and JSON, and one table."""

import csv
import io
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.gateways.calibrations.certificate_record import FORMAT
from catseye.gateways.triplet.objects import triplet_object
from catseye.gateways.triplet.sheet import html_sheet, text_sheet
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import PROVENANCE
from catseye.gateways.writers.written import origin, write_files
from catseye.reduction.triplet.result import TripletReduction

COLUMNS = (
    "file", "triplet", "h_corr_mm", "u_h_corr_mm", "l_mpbc_mm", "u_l_mpbc_mm", "difference_mm", "u_difference_mm",
    "accepted", "conformity_probability", "placements", "p",
)  # fmt: skip


def write_triplets(
    units: Mapping[Path, TripletReduction],
    directory: Path,
    hashes: Mapping[Path, str],
    *,
    progress: Progress | None = None,
) -> None:
    """Write text, page and JSON for each sheet NAME.toml, triplets.csv, and the provenance.

    units       calibrations by the file of their sheet
    directory   existing, from `writers.output.atomic_directory`
    hashes      SHA-256 of each file
    progress    called for each file

    Raises InputError if two sheets have the same name, or one has the name of the provenance.
    """
    refuse_namesakes(list(units))
    when = datetime.now(UTC)
    files: dict[str, Callable[[], str]] = {}
    for path, reduction in units.items():
        files[f"{path.stem}.txt"] = partial(text_sheet, reduction, path.name)
        files[f"{path.stem}.html"] = partial(html_sheet, reduction, path.name, when, hashes[path])
        files[f"{path.stem}.json"] = partial(_object_page, reduction, path.name)
    files["triplets.csv"] = lambda: triplets_csv({path.name: reduction for path, reduction in units.items()})
    provenance = {"format": FORMAT, "made_by": "catseye triplet"}
    inputs = {path.name: hashes[path] for path in units}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)


def _object_page(reduction: TripletReduction, name: str) -> str:
    return json_page(triplet_object(reduction, name))


def refuse_namesakes(paths: list[Path]) -> None:
    """Raise InputError for sheets of the same name, which would overwrite each other, or PROVENANCE."""
    by_stem: dict[str, Path] = {}
    for path in paths:
        if f"{path.stem}.json" == PROVENANCE:
            raise InputError(f"{path}: {PROVENANCE} would be written twice (expected a sheet of another name)")
        if path.stem in by_stem:
            raise InputError(
                f"{path}: has the name of {by_stem[path.stem]} (expected sheets of different names in one output)"
            )
        by_stem[path.stem] = path


def triplets_csv(units: Mapping[str, TripletReduction]) -> str:
    """One row per unit, lengths in mm; an empty cell is unknown.

    units   calibrations by the name of their sheet
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(_row(file, reduction) for file, reduction in units.items())
    return stream.getvalue()


def _row(file: str, f: TripletReduction) -> tuple[Any, ...]:
    lengths = (f.h_corr, f.u_h_corr, f.l_mpbc, f.u_l_mpbc, f.difference, f.u_difference)
    millimetres = (_plain(1e3 * x) for x in lengths)
    accepted = "yes" if f.accepted else "no"
    return (
        file,
        f.measurement.triplet,
        *millimetres,
        accepted,
        _plain(f.conformity_probability),
        len(f.h),
        _plain(f.p),
    )


def _plain(value: float) -> str:
    return f"{value:.6f}" if math.isfinite(value) else ""
