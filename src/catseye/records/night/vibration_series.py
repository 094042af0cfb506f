"""Recorded vibration at full rate: VIBRATION.csv of a quadrant detector, of displacements, ranges or coordinates."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal

TIME = "time_s"
KINDS: Final[dict[str, tuple[tuple[str, ...], ...]]] = {  # kind -> its columns, in the order of the axes
    "quadrant": (("q1", "q2", "q3", "q4"),),
    "displacement": (("x_mm", "y_mm", "z_mm"), ("x_mm", "y_mm")),
    "range": (("range_m",),),
    "ground": (("x_m", "y_m", "z_m"),),
}
COLUMNS: Final = tuple(dict.fromkeys(name for forms in KINDS.values() for form in forms for name in form))
LEAST = 64  # rows
MOST = 50_000


@dataclass(frozen=True, eq=False)
class VibrationSeries:
    """Samples of a vibrating structure.

    file      name for messages
    kind      "quadrant": signals of four quadrants, any unit; "displacement"; "range"; "ground": coordinates
    columns   names of the columns read
    seconds   (n,) s, rising, of the middle of each sample
    values    (n, columns) signals, or m; nan where lost
    """

    file: str
    kind: str
    columns: tuple[str, ...]
    seconds: np.ndarray
    values: np.ndarray


def read_vibration_series(path: Path | str) -> VibrationSeries:
    """Series of a VIBRATION.csv (docs/formats/vibration.md); a blank cell is a lost sample.

    Raises InputError with file, line, value and expectation: columns of no kind, times that do not rise, too few rows.
    """
    path = Path(path)
    text = Folder(path.parent).text(path.name)
    table = columns_of(text, path.name, [TIME], optional=COLUMNS)
    present = {name for name in table.cells if name != TIME}
    forms_present = [(kind, form) for kind, forms in KINDS.items() for form in forms if present == set(form)]
    if not forms_present:
        forms = "; ".join(",".join(form) for forms in KINDS.values() for form in forms)
        raise refusal(path.name, f"has the columns {', '.join(sorted(present)) or 'of no kind'} (expected {TIME} and "
                      f"one of {forms})")  # fmt: skip
    if not LEAST <= len(table) <= MOST:
        raise refusal(path.name, f"has {len(table)} rows (expected {LEAST} to {MOST})")
    kind, form = forms_present[0]
    seconds = table.numbers(TIME)
    table.check(TIME, np.diff(seconds, prepend=-np.inf) > 0.0, "a later time than the line before")
    scale = MILLIMETRE if kind == "displacement" else 1.0
    values = np.column_stack([table.numbers(name, blank=np.nan) for name in form]) * scale
    return VibrationSeries(path.name, kind, form, seconds, values)
