"""Covariance matrix in a separate file, for a `coordinates.json` with too many points.

The file is a FITS image of doubles, one row per coordinate, for any FITS reader; numpy maps it directly:
`np.memmap(path, ">f8", "r", offset, (n, n))`, where offset is the multiple of 2880 bytes after END.
"""

import mmap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catseye.records.files.refusal import refusal, shown

KEY = "covariance_file"  # key used when "covariance" is null
BLOCK_ROWS = 500  # rows that are read together


def part_of(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Block of a matrix as (k, m) doubles; of a mapped file only this block enters memory."""
    part = np.empty((len(rows), len(columns)))
    base: Any = matrix
    while isinstance(base, np.ndarray):
        base = base.base
    for k in range(0, len(rows), BLOCK_ROWS):
        part[k : k + BLOCK_ROWS] = matrix[rows[k : k + BLOCK_ROWS]][:, columns]
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)
    return part


def stored_covariance(document: Mapping[str, Any], directory: Path, size: int) -> Any:
    """Value of "covariance" in a document, or the matrix mapped from the file that it names.

    document    a coordinates.json
    directory   directory of the document
    size        expected number of rows

    Raises InputError for a name in another directory, a missing file, or a wrong size.
    """
    name = document.get(KEY)
    if name is None:
        return document.get("covariance")
    if not isinstance(name, str) or Path(name).name != name:
        raise refusal(directory.name, f"{KEY} = {shown(name)} (expected the name of a file in the same directory)")
    from astropy.io import fits

    path = directory / name
    try:
        matrix = fits.getdata(path, memmap=True)
    except (OSError, TypeError, ValueError, IndexError) as problem:
        raise refusal(name, f"is not a FITS image: {problem} (expected the output of catseye reduce)") from problem
    if np.shape(matrix) != (size, size) or matrix.dtype.kind != "f":
        raise refusal(name, f"has shape {np.shape(matrix)} (expected doubles, ({size}, {size}))")
    return matrix
