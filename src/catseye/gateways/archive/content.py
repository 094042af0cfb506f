"""Content of a night for an archive, before it is written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

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
    samples: str = ""
    periods: np.ndarray | None = None
    cycles: np.ndarray | None = None


def broadcast(columns: Mapping[str, Any], rows: int) -> Columns:
    """Columns of one length: single values repeated."""
    return {name: np.broadcast_to(np.asarray(value), (rows,)) for name, value in columns.items()}
