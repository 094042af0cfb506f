"""Files of a surface, and the table of its actuators."""

from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.gateways.surface.objects import (
    FORMAT,
    actuators_object,
    change_object,
    dish_object,
    lookup_object,
    shape_object,
)
from catseye.gateways.surface.report import surface_report
from catseye.gateways.surface.tables import (
    ACTUATOR_MARK,
    ACTUATORS,
    EPOCHS,
    LOOKUP,
    PRISMS,
    ZERNIKE,
    actuators_csv,
    actuators_table,
    change_csv,
    epochs_csv,
    lookup_csv,
    prisms_csv,
    zernike_csv,
)
from catseye.gateways.writers.columns import Table
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import atomic_file
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.samplers_fits import join_tables, write_samplers
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.surface.actuators import rows_of
from catseye.reduction.surface.findings import SurfaceFindings


def surface_object(result: SurfaceFindings) -> dict[str, Any]:
    """Object that `catseye surface --json` prints: one epoch's keys, or `epochs`, `change`, `lookup`."""
    answer: dict[str, Any] = {"format": FORMAT, "verdict": result.verdict.to_object(), "dish": dish_object(result.dish)}
    if len(result.shapes) == 1:
        answer |= shape_object(result.shapes[0])
    else:
        answer["epochs"] = [shape_object(shape) for shape in result.shapes]
    answer["change"] = None if result.change is None else change_object(result.change)
    answer["lookup"] = None if result.lookup is None else lookup_object(result.lookup)
    answer["actuators"] = None if result.actuators is None else actuators_object(result.actuators)
    return answer


def write_surface(
    result: SurfaceFindings, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    when = datetime.now(UTC)
    files: dict[str, Any] = {}
    for k, shape in enumerate(result.shapes):
        tail = f"-{k + 1}" if len(result.shapes) > 1 else ""
        files[f"prisms{tail}.csv"] = lambda shape=shape: prisms_csv(shape)
        files[f"zernike{tail}.csv"] = lambda shape=shape: zernike_csv(shape.expansion, shape.settings.numbering)
    change, lookup, actuators = result.change, result.lookup, result.actuators
    if change is not None:
        files["change.csv"] = lambda: change_csv(change)
        files["change-zernike.csv"] = lambda: zernike_csv(change.expansion, change.settings.numbering)
    if lookup is not None:
        files["lookup.csv"] = lambda: lookup_csv(lookup)
        files["epochs.csv"] = lambda: epochs_csv(lookup)
    if actuators is not None:
        files["actuators.csv"] = lambda: actuators_csv(rows_of(actuators))
    files["surface.json"] = lambda: json_page(surface_object(result))
    files["report.html"] = lambda: report_page(surface_report(result, when, inputs))
    outputs: Files = files
    provenance = {"format": FORMAT, "made_by": "catseye surface", "dish": dish_object(result.dish)}
    provenance["settings"] = asdict(result.shapes[-1].settings)
    write_files(outputs, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    written: list[Table[Any]] = [PRISMS, ZERNIKE, LOOKUP, EPOCHS, ACTUATORS]
    join_tables(directory, written, frame="fitted paraboloid: vertex at its origin, axis along z")


def write_actuators(result: SurfaceFindings, path: Path) -> None:
    """Write the table of actuators as .csv or .fits by its suffix, atomically.

    Raises InputError for another suffix, or if a foreign file would be overwritten.
    """
    if result.actuators is None:
        raise InputError(f"{path}: no actuator corrections were computed (expected actuators)")
    rows = rows_of(result.actuators)
    ending = path.suffix.lower()
    if ending == ".csv":
        with atomic_file(path, "actuators", ACTUATOR_MARK) as pieces:
            pieces.append(actuators_csv(rows))
    elif ending == ".fits":
        write_samplers(path, {"ACTUATORS": actuators_table(rows)}, option="actuators")
    else:
        raise InputError(f"actuators {path}: ends in {ending!r} (expected .csv or .fits)")
