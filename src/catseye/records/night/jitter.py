"""jitter.csv: how far the telescope's bodies shook while a night was measured, and the same as columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.records.files.record import Mjd, Record, Within
from catseye.records.files.refusal import in_row

JITTER = "jitter.csv"  # optional
LARGEST_MM = 100.0  # a feed arm in a storm shakes by some millimetres; metres typed for mm are refused


class JitterRow(Record):
    """A row of jitter.csv.

    mjd_utc   when it was so; linear between the rows of a body, the same before the first and after the last
    body      of the telescope; the ground does not shake
    u_mm      standard deviation of its points, at a shot, from their mean, along any line
    """

    mjd_utc: Mjd
    body: Literal["arm", "dish", "alidade"]
    u_mm: Annotated[float, Within(0, LARGEST_MM)]


@dataclass(frozen=True, eq=False)
class JitterTable:
    """Times (k,), MJD, and standard deviations (k,), mm, of each body."""

    bodies: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]

    def mm(self, mjd_utc: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """Jitter of each body that is named, mm, at times (m,)."""
        at = np.asarray(mjd_utc, dtype=float)
        return {body: np.asarray(np.interp(at, times, u)) for body, (times, u) in self.bodies.items()}


def jitter_table(rows: Sequence[JitterRow]) -> JitterTable | None:
    """The rows by body; None of none.

    Raises InputError: a row that is not after its body's last.
    """
    bodies: dict[str, list[tuple[float, float]]] = {}
    for number, row in enumerate(rows, start=1):
        own = bodies.setdefault(row.body, [])
        if own and row.mjd_utc <= own[-1][0]:
            before = f"is not after {own[-1][0]!r}, the last of the {row.body}"
            raise in_row(JITTER, number, f"mjd_utc = {row.mjd_utc!r} {before} (expected in order of time)")
        own.append((row.mjd_utc, row.u_mm))
    tables = {body: (np.array([t for t, _ in own]), np.array([u for _, u in own])) for body, own in bodies.items()}
    return JitterTable(tables) if tables else None
