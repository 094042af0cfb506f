"""Files of detection's results."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.gateways.detection.buffer_figures import buffer_figure
from catseye.gateways.detection.buffer_objects import buffer_object
from catseye.gateways.detection.cycle_objects import cycle_figure, cycle_object
from catseye.gateways.detection.tables import HARMONICS, LENGTHS, METHODS
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.detection.buffer_phase import BufferPhase
from catseye.reduction.detection.cycle_lengths import CycleLengths

FORMAT = "catseye-detection-1"


def write_buffer(
    result: BufferPhase, directory: Path, inputs: Mapping[str, str], progress: Progress | None = None
) -> None:
    """Write tables, figure, JSON and provenance of `catseye phase --out`.

    result       from `buffer_phase`
    directory   existing, from `writers.output.atomic_directory`
    inputs      hashes of the input files
    progress    called for each file
    """
    files: dict[str, Callable[[], Any]] = {
        "methods.csv": lambda: METHODS.csv(result.methods),
        "harmonics.csv": lambda: HARMONICS.csv(result.harmonics or None),
        "phase.json": lambda: json_page(buffer_object(result)),
        "buffer.svg": lambda: svg(buffer_figure(result)),
    }
    _write("catseye phase", files, directory, inputs, progress)


def write_cycles(
    result: CycleLengths, directory: Path, inputs: Mapping[str, str], progress: Progress | None = None
) -> None:
    """Write table, figure, JSON and provenance of `catseye cycles --out`.

    result       from `cycle_lengths`
    directory   existing, from `writers.output.atomic_directory`
    inputs      hashes of the input files
    progress    called for each file
    """
    files: Files = {
        "lengths.csv": lambda: LENGTHS.csv(result.shots),
        "cycles.json": lambda: json_page(cycle_object(result)),
        "cycles.svg": lambda: svg(cycle_figure(result)),
    }
    _write("catseye cycles", files, directory, inputs, progress)


def _write(command: str, files: Files, directory: Path, inputs: Mapping[str, str], progress: Progress | None) -> None:
    made = {"format": FORMAT, "made_by": command}
    write_files(files, directory, {**made, **origin(datetime.now(UTC), dict(inputs))}, progress=progress)
