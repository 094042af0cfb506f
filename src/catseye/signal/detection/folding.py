"""Buffers laid out as cycles, and the detection waves."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.errors import ValidityError

LANES = 128  # parallel sums while folding: short rows would not fill the vector units
SAFE_ROWS = 2**15  # rows that fit 32 bits: 2^15 (-2^15) is -2^30, half of their range


def layout(array: NDArray[np.generic], samples_per_cycle: int) -> tuple[int, int]:
    """Samples a cycle n, cycles m of buffers (..., m n).

    Raises ValidityError where they do not fit.
    """
    if array.dtype.kind not in "iuf":
        raise ValidityError(f"samples are of type {array.dtype}, expected integers or floats")
    if not np.isfinite(samples_per_cycle) or samples_per_cycle != int(samples_per_cycle) or samples_per_cycle < 3:
        raise ValidityError(f"{samples_per_cycle} samples a cycle do not determine a phase; at least 3 do")
    n = int(samples_per_cycle)
    length = array.shape[-1] if array.ndim else 0
    if length == 0 or length % n:
        raise ValidityError(f"a buffer of {length} samples is not a whole number of cycles of {n} samples")
    return n, length // n


def exponentials(n: int, orders: tuple[int, ...]) -> NDArray[np.complex128]:
    """Waves exp(2 pi i k l / n), (n, orders): cosine in the real part, sine in the imaginary."""
    turns = np.outer(np.arange(n), orders) % n  # reduced first, so that large k l lose no precision
    return np.exp(2j * np.pi * turns / n)


def fold(block: NDArray[Any]) -> NDArray[Any]:
    """Sum of the m cycles of buffers (b, m, n), (b, n): inner sums of eq. 5.5 and 5.6.

    Integers of up to 32 bits are summed as integers, exactly: 64 bits would take 2^32 cycles to overflow. Wider ones
    are taken as floats.

    Source: [PARKER04] eq. 5.5 and 5.6.
    """
    b, m, n = block.shape
    small = block.dtype.kind in "iu" and block.dtype.itemsize <= 2
    if not small:
        exact = block.dtype.kind in "iu" and block.dtype.itemsize <= 4
        return block.sum(axis=1, dtype=np.int64 if exact else np.float64)
    wide = max(1, LANES // n)  # cycles a row
    rows = m // wide
    total = np.zeros((b, n), dtype=np.int64)
    for start in range(0, rows, SAFE_ROWS):
        stop = min(rows, start + SAFE_ROWS)
        part = block[:, start * wide : stop * wide].reshape(b, stop - start, wide * n)
        total += part.sum(axis=1, dtype=np.int32).reshape(b, wide, n).sum(axis=1, dtype=np.int64)
    if rows * wide < m:
        total += block[:, rows * wide :].sum(axis=1, dtype=np.int64)
    return total
