"""Nights as units of work: a campaign's folder reduced and written by one process."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError
from catseye.service.many.ledger import is_ledger
from catseye.service.many.unit import Unit
from catseye.version import __version__

LEDGER = "ledger"  # folder of the output that is no night
PROCESS = 180 * 2**20  # bytes of a process with its libraries, and of the report's figures
MATRIX = 3.5  # times the full covariance of the points, 8 (3n)^2 bytes: kept, copied, written


def night_units(nights: Sequence[Path], directory: Path, *, air_model: str) -> list[Unit]:
    """A unit a night, each with a folder of its own in the directory.

    Raises InputError for two nights of one name, for an output that lies in an input or is another's, and for a
    night without samples.
    """
    from catseye.gateways.writers.output import refuse_output

    key = hashlib.sha256("\n".join(("reduce", __version__, air_model)).encode()).hexdigest()
    places: dict[str, Path] = {}
    units = []
    for night in (path.resolve() for path in nights):
        name = night.name
        if name in places:
            raise ArgumentError(
                f"two nights are named {name}: {places[name]} and {night} (expected different names, or two calls)"
            )
        if name == LEDGER or name.startswith("."):
            raise ArgumentError(f"{night}: {name!r} cannot name a night's folder (expected another name)")
        places[name], out = night, directory / name
        if directory.is_dir():
            refuse_output(out, night)
        units.append(
            Unit(
                name=name,
                work=reduce_night,
                arguments=(str(night), str(out), air_model),
                key=key,
                memory=memory_of(night),
                inputs=(night,),
                output=out,
            )
        )
    return units


def refuse_directory(directory: Path, nights: Sequence[Path]) -> None:
    """Raise InputError for an output of many nights that is an input, holds one, or is another's."""
    from catseye.gateways.writers.output import refuse_output

    if directory.is_dir() and is_ledger(directory / LEDGER):
        return
    refuse_output(directory, *nights)


def memory_of(night: Path) -> int:
    """Memory that the reduction of a night takes, bytes, by its number of targets.

    A night that cannot be read gets little: it will fail with its reason.
    """
    try:
        text = (night / "targets.toml").read_text(encoding="utf-8", errors="replace")
        samples = np.load(night / "frames.npy", mmap_mode="r").nbytes
    except (OSError, ValueError):
        return PROCESS
    parameters = 3 * text.count("[[target]]")
    return int(PROCESS + MATRIX * 8.0 * parameters**2 + samples)


def reduce_night(night: str, directory: str, air_model: str) -> dict[str, Any]:
    """Summary of a night, after its files are written whole into a directory.

    Raises InputError where it cannot be used or written and EstimationError where there is no answer.
    """
    from catseye.gateways.epoch.files import write_reduction
    from catseye.gateways.writers.output import atomic_directory
    from catseye.memory import give_back
    from catseye.records.night.campaign import read_campaign
    from catseye.reduction.epoch.epoch import reduce_epoch
    from catseye.reduction.epoch.settings import ReductionSettings
    from catseye.reduction.night.digest import digest

    source, out = Path(night), Path(directory)
    reduction = reduce_epoch(read_campaign(source), ReductionSettings(air_model=air_model))
    coordinates = reduction.coordinates
    summary = {
        "verdict": reduction.verdict.to_object(),
        "points": len(coordinates.points),
        "shots": int(np.count_nonzero(coordinates.ranges.used)),
        "rejected": len(reduction.rejected),
        "variance_factor": float(coordinates.variance_factor),
        "degrees_of_freedom": float(coordinates.degrees_of_freedom),
        "median_u_mm": float(np.median(coordinates.u) / MILLIMETRE),
        "digest": digest(reduction),
        "out": str(out),
    }
    reduction = reduction.held()
    give_back()
    with atomic_directory(out, source) as fresh:
        write_reduction(reduction, fresh)
    return summary
