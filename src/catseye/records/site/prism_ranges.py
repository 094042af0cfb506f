"""Ranges of feed-arm rangers to triplet prisms and to each other: a table, or ranges.csv of a reduced night.

A range is from scan point to reference point, with the glass at normal incidence and without the correction for
oblique incidence, which depends on how the unit stands.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal

COLUMNS = ("ranger", "target", "range_m")
CLAIM = "u_range_mm"
OF_A_NIGHT = ("status", "obliquity_mm")  # further columns by which ranges.csv of `catseye reduce` is known
SPAN = (0.5, 2000.0)  # m, of a range


@dataclass(frozen=True, eq=False)
class PrismRanges:
    """Ranges of r rows; several of one pair are repetitions.

    ranger, target   (r,) names
    distance         (r,) m, with Pc and without dPc
    u                (r,) m, standard uncertainty of each; nan where the table states none
    lines            (r,) lines of the file
    file             name of the table
    sha256           of the file
    """

    ranger: tuple[str, ...]
    target: tuple[str, ...]
    distance: np.ndarray
    u: np.ndarray
    lines: tuple[int, ...]
    file: str
    sha256: str


def read_prism_ranges(path: Path) -> PrismRanges:
    """Ranges of a table.

    path   columns ranger, target, range_m and perhaps u_range_mm; or ranges.csv of `catseye reduce`, whose used shots
           count and lose their correction for oblique incidence

    Raises InputError for a table that cannot be used.
    """
    folder = Folder(path.parent)
    text = folder.text(path.name)
    header = [name.strip() for name in text.partition("\n")[0].split(",")]
    of_a_night = all(name in header for name in OF_A_NIGHT)
    if of_a_night:
        required = (*COLUMNS, CLAIM, *OF_A_NIGHT)
        optional = tuple(dict.fromkeys(name for name in header if name not in required))
        table = columns_of(text, path.name, required, optional=optional)
        used = [row for row, status in enumerate(table.cells["status"]) if status == "used"]
    else:
        table = columns_of(text, path.name, COLUMNS, optional=(CLAIM,))
        used = list(range(len(table)))
    distance = table.numbers("range_m", blank=None if not of_a_night else np.nan)
    if of_a_night:
        distance = distance - table.numbers("obliquity_mm", blank=0.0) * MILLIMETRE
    u = table.numbers(CLAIM, blank=np.nan) * MILLIMETRE if CLAIM in table.cells else np.full(len(table), np.nan)
    _refuse_rows(table, used, distance, u)
    if not used:
        raise refusal(path.name, "holds no used shot (expected ranges of a night that was reduced)")
    return PrismRanges(
        ranger=tuple(table.cells["ranger"][row] for row in used),
        target=tuple(table.cells["target"][row] for row in used),
        distance=distance[used],
        u=u[used],
        lines=tuple(int(table.lines[row]) for row in used),
        file=path.name,
        sha256=folder.hashes[path.name],
    )


def _refuse_rows(table: TextColumns, used: list[int], distance: np.ndarray, u: np.ndarray) -> None:
    """Raise InputError for a range or an uncertainty without meaning, or a nameless row."""
    low, high = SPAN
    for row in used:
        for name in ("ranger", "target"):
            if not table.cells[name][row]:
                raise table.refuse(row, f"{name} is empty (expected a name)")
        if not low <= distance[row] <= high:
            raise table.refuse(row, f"range_m = {distance[row]:g} (expected {low:g} to {high:g} m)")
        if not np.isnan(u[row]) and u[row] <= 0.0:
            raise table.refuse(row, f"{CLAIM} = {u[row] / MILLIMETRE:g} (expected above 0, or an empty cell)")
