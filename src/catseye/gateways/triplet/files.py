"""Files of triplet calibrations: a sheet for each as text, page and JSON, and one table."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.gateways.calibrations.certificate_record import FORMAT
from catseye.gateways.triplet.objects import triplet_object
from catseye.gateways.triplet.sheet import text_sheet, triplet_report
from catseye.gateways.triplet.tables import triplets_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import PROVENANCE
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.written import origin, write_files
from catseye.reduction.triplet.result import TripletReduction


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
        files[f"{path.stem}.html"] = partial(_page, reduction, path.name, when, hashes[path])
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


def _page(reduction: TripletReduction, file: str, when: datetime, digest: str) -> str:
    return report_page(triplet_report(reduction, file, when, digest))
