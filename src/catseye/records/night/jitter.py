"""jitter.csv: jitter of the telescope's bodies during a night, and the same as columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.records.files.record import Mjd, Record, Within
from catseye.records.files.refusal import in_row

JITTER = "jitter.csv"  # optional
LARGEST_MM = 100.0  # a feed arm in a storm moves by some millimetres; detects metres typed for mm


class JitterRow(Record):
    """Row of jitter.csv.

    mjd_utc   time; linear between the rows of a body, constant before the first and after the last
    body      body of the telescope, not the ground
    u_mm      standard deviation of its points at a shot from their mean positions, along any line
    """

    mjd_utc: Mjd
    body: Literal["arm", "dish", "alidade"]
    u_mm: Annotated[float, Within(0, LARGEST_MM)]


@dataclass(frozen=True, eq=False)
class JitterTable:
    """Times (k,), MJD, and standard deviations (k,), mm, per body."""

    bodies: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]

    def mm(self, mjd_utc: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """Jitter of each listed body, mm, at times (m,)."""
        at = np.asarray(mjd_utc, dtype=float)
        return {body: np.asarray(np.interp(at, times, u)) for body, (times, u) in self.bodies.items()}


def jitter_table(rows: Sequence[JitterRow]) -> JitterTable | None:
    """Rows by body; None without rows.

    Raises InputError for a row not after its body's last.
    """
    bodies: dict[str, list[tuple[float, float]]] = {}
    for number, row in enumerate(rows, start=1):
        entries = bodies.setdefault(row.body, [])
        if entries and row.mjd_utc <= entries[-1][0]:
            before = f"is not after {entries[-1][0]!r}, the last of the {row.body}"
            raise in_row(JITTER, number, f"mjd_utc = {row.mjd_utc!r} {before} (expected in order of time)")
        entries.append((row.mjd_utc, row.u_mm))
    tables = {
        body: (np.array([t for t, _ in entries]), np.array([u for _, u in entries])) for body, entries in bodies.items()
    }
    return JitterTable(tables) if tables else None
