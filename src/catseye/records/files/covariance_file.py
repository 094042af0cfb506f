"""A covariance matrix in a file of its own: what `coordinates.json` names where it would be too large inside.

The file is a FITS image of doubles, a row a coordinate, which FITS readers open; numpy maps it without them:
`np.memmap(path, ">f8", "r", offset, (n, n))`, the offset being a multiple of 2880 bytes that follows END.
"""

import mmap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catseye.records.files.refusal import refusal, shown

KEY = "covariance_file"  # beside "covariance", which is null then
AT_ONCE = 500  # rows that are read together


def part_of(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(k, m) doubles of some rows and columns; of a mapped file no more than this part comes into memory at once."""
    part = np.empty((len(rows), len(columns)))
    base: Any = matrix
    while isinstance(base, np.ndarray):
        base = base.base
    for k in range(0, len(rows), AT_ONCE):
        part[k : k + AT_ONCE] = matrix[rows[k : k + AT_ONCE]][:, columns]
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)
    return part


def stored_covariance(document: Mapping[str, Any], directory: Path, size: int) -> Any:
    """What stands under "covariance" of a document, or, mapped from the disk, in the file that it names.

    document    a coordinates.json
    directory   where it was
    size        rows that are expected

    Raises InputError for a name that leads elsewhere, no such file, and another size.
    """
    name = document.get(KEY)
    if name is None:
        return document.get("covariance")
    if not isinstance(name, str) or Path(name).name != name:
        raise refusal(directory.name, f"{KEY} = {shown(name)} (expected the name of a file beside it)")
    from astropy.io import fits

    path = directory / name
    try:
        matrix = fits.getdata(path, memmap=True)
    except (OSError, TypeError, ValueError, IndexError) as problem:
        raise refusal(name, f"is no FITS image: {problem} (expected as catseye reduce writes it)") from problem
    if np.shape(matrix) != (size, size) or matrix.dtype.kind != "f":
        raise refusal(name, f"has shape {np.shape(matrix)} (expected doubles, ({size}, {size}))")
    return matrix
