"""Return of a retroreflector by angle, a CSV: `incidence_deg`, `rotation_deg`, `amplitude_volt` or `power_mw`.

`analyser_deg`, perhaps: angle of an analyser before the detector from the field of the light; blank without one.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal

MEASURED = {"amplitude_volt": "V", "power_mw": "mW"}
FARTHEST_DEG, MOST_TURN_DEG = 90.0, 720.0
MOST = 1e4  # V, mW


@dataclass(frozen=True, eq=False)
class AngleReadings:
    """Readings of one or several tables, in their order.

    names       of the files
    incidence   (n,) rad, signed, as the stage counts
    rotation    (n,) rad, azimuth of the ranger about the retroreflector's axis, as the stage counts
    value       (n,) in `unit`
    unit        "V" or "mW"
    table       (n,) index of each reading's file
    analyser    (n,) rad, of an analyser from the field of the light, nan without one; None: none in any table
    """

    names: tuple[str, ...]
    incidence: np.ndarray
    rotation: np.ndarray
    value: np.ndarray
    unit: Literal["V", "mW"]
    table: np.ndarray
    analyser: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.value)


def read_angles(paths: list[Path]) -> tuple[AngleReadings, dict[str, str]]:
    """Readings of tables, and the SHA-256 of each by its path; InputError names file, line, value."""
    units, columns, analysers = set(), [], []
    for path in paths:
        table = columns_of(
            Folder(path.parent).text(path.name),
            path.name,
            ["incidence_deg"],
            optional=["rotation_deg", "analyser_deg", *MEASURED],
        )
        measured = [name for name in MEASURED if name in table.cells]
        if len(measured) != 1:
            what = " and ".join(measured) or "neither"
            raise refusal(path.name, f"line 1 has {what} (expected one of {', '.join(MEASURED)})")
        incidence, value = table.numbers("incidence_deg"), table.numbers(measured[0])
        rotation = table.numbers("rotation_deg") if "rotation_deg" in table.cells else np.zeros(len(table))
        table.check("incidence_deg", np.abs(incidence) < FARTHEST_DEG, "above -90 to below 90 degrees")
        if "rotation_deg" in table.cells:
            table.check("rotation_deg", np.abs(rotation) <= MOST_TURN_DEG, "-720 to 720 degrees")
        table.check(measured[0], (value >= 0.0) & (value <= MOST), f"0 to {MOST:g} {MEASURED[measured[0]]}")
        analyser = np.full(len(table), np.nan)
        if "analyser_deg" in table.cells:
            analyser = table.numbers("analyser_deg", blank=np.nan)
            table.check("analyser_deg", ~(np.abs(analyser) > 180.0), "-180 to 180 degrees, or a blank")
        analysers.append(analyser * DEGREE)
        units.add(MEASURED[measured[0]])
        columns.append((incidence * DEGREE, rotation * DEGREE, value))
    if len(units) > 1:
        raise InputError(f"{paths[0].name} and others have different units, V and mW (expected one)")
    incidence, rotation, value = (np.concatenate(item) for item in zip(*columns, strict=True))
    which = np.repeat(np.arange(len(paths)), [len(item[2]) for item in columns])
    names = tuple(path.name for path in paths)
    hashes = {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}
    return AngleReadings(
        names,
        incidence,
        rotation,
        value=value,
        unit="V" if "V" in units else "mW",
        table=which,
        analyser=None if np.isnan(analyser := np.concatenate(analysers)).all() else analyser,
    ), hashes
