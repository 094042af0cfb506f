"""Content of a night for an archive, before it is written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

MJD_OF_ORDINAL_0 = 678_576  # date.toordinal() of a day whose Modified Julian Date is 0
Columns = Mapping[str, np.ndarray | Sequence[Any]]


@dataclass(frozen=True, eq=False)
class NightContent:
    """Night to be written.

    night           identifier
    first, last     MJD of its earliest and latest row
    source          `campaign` or `journal`
    inputs_sha256   over names and SHA-256 of the inputs
    provenance      settings and certificates; of a journal, run and head of the chain
    tables          columns of each table, by its name; missing columns are null
    directory       of the inputs; None without inputs
    inputs          paths of the inputs, relative to it
    origin          of a journal's run its uuid; "" of a campaign
    samples         the one of them that holds samples as an array of NumPy; "" without samples
    periods         (rows of samples,) samples of a cycle
    cycles          (rows of samples,) whole cycles at the start of a row
    """

    night: str
    first: float
    last: float
    source: str
    inputs_sha256: str
    provenance: Mapping[str, Any]
    tables: Mapping[str, Columns]
    directory: Path | None = None
    inputs: Sequence[str] = field(default=())
    origin: str = ""
    samples: str = ""
    periods: np.ndarray | None = None
    cycles: np.ndarray | None = None


@dataclass(frozen=True)
class NightInputs:
    """Inputs of a night that is to be archived.

    night       identifier
    sha256      over names and SHA-256 of the inputs
    directory   of the files
    files       their paths, relative to it
    size        bytes of them
    when        time of archiving, UTC
    """

    night: str
    sha256: str
    directory: Path
    files: tuple[str, ...]
    size: int
    when: datetime

    @property
    def row(self) -> dict[str, Any]:
        """Columns of the row in `nights`."""
        return {
            "night": self.night,
            "inputs_sha256": self.sha256,
            "raw_bytes": self.size,
            "archived_mjd": mjd_of(self.when.date()) + (self.when - day_of(self.when)) / timedelta(days=1),
        }


def mjd_of(day: date | None) -> float:
    """Modified Julian Date of a day's beginning; NaN for None.

    >>> mjd_of(date(2026, 1, 1))
    61041.0
    """
    return float("nan") if day is None else float(day.toordinal() - MJD_OF_ORDINAL_0)


def day_of(when: datetime) -> datetime:
    """Beginning of a time's day."""
    return when.replace(hour=0, minute=0, second=0, microsecond=0)


def broadcast(columns: Mapping[str, Any], rows: int) -> Columns:
    """Columns of one length: single values repeated."""
    return {name: np.broadcast_to(np.asarray(value), (rows,)) for name, value in columns.items()}
