"""Scan over a retroreflector, a CSV: `azimuth_counts,elevation_counts,amplitude_volt`."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder

COLUMNS = ("azimuth_counts", "elevation_counts", "amplitude_volt")
MOST_COUNTS = 1e6  # ten turns
MOST_VOLT = 1e3


@dataclass(frozen=True, eq=False)
class ScanReadings:
    """Amplitudes at counts, in file order.

    name        of the file
    counts      (n, 2) azimuth and elevation
    amplitude   (n,) V
    where       place of each row in the file, in words
    digest      SHA-256 of the file
    """

    name: str
    counts: np.ndarray
    amplitude: np.ndarray
    where: tuple[str, ...]
    digest: str

    def __len__(self) -> int:
        return len(self.amplitude)


def read_scan(path: Path | str) -> ScanReadings:
    """Scan of a table; InputError names file, line, value."""
    path = Path(path)
    table = columns_of(Folder(path.parent).text(path.name), path.name, COLUMNS)
    na, ne, volt = (table.numbers(name) for name in COLUMNS)
    for name, values in (("azimuth_counts", na), ("elevation_counts", ne)):
        table.check(name, np.abs(values) <= MOST_COUNTS, f"-{MOST_COUNTS:g} to {MOST_COUNTS:g}")
    table.check("amplitude_volt", (volt >= 0.0) & (volt <= MOST_VOLT), f"0 to {MOST_VOLT:g} V")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return ScanReadings(path.name, np.column_stack([na, ne]), volt, table.where(), digest)
