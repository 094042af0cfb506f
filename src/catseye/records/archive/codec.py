"""Exact codec of raw samples: each shot's mean cycle, and what departs from it.

A shot repeats one cycle, so that its samples less the mean cycle are noise, some bits smaller than the signal. They are
taken modulo 2^16, so that every row comes back bit for bit, whatever it holds; zigzag maps small negative and positive
values to small unsigned ones, whose high bits bitshuffle then gathers into runs of zeros.
"""

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.int16]
Words = NDArray[np.uint16]


def encoded(samples: Samples, period: int, cycles: int) -> tuple[Samples, Words]:
    """Mean cycles (n, period), and zigzag of the rows' departures from them (n, width).

    samples   (n, width)
    period    samples of a cycle, 1 to width
    cycles    whole cycles at the start of a row from which the mean is taken, 1 or more

    >>> mean, departures = encoded(np.array([[5, -3, 5, -4]], np.int16), 2, 2)
    >>> mean.tolist(), departures.tolist()
    ([[5, -4]], [[0, 2, 0, 0]])
    """
    n = len(samples)
    folded = samples[:, : cycles * period].reshape(n, cycles, period).sum(axis=1, dtype=np.int32)
    mean = np.rint(folded / cycles).astype(np.int16)
    departures = _by_cycle(samples, mean, np.subtract)
    return mean, ((departures << 1) ^ (departures >> 15)).view(np.uint16)


def decoded(mean: Samples, departures: Words) -> Samples:
    """Samples (n, width) from mean cycles (n, period) and zigzag of departures (n, width).

    >>> decoded(np.array([[5, -4]], np.int16), np.array([[0, 2, 0, 0]], np.uint16)).tolist()
    [[5, -3, 5, -4]]
    """
    signs = -(departures & np.uint16(1)).view(np.int16)
    return _by_cycle((departures >> np.uint16(1)).view(np.int16) ^ signs, mean, np.add)


def _by_cycle(rows: Samples, mean: Samples, operation: np.ufunc) -> Samples:
    """Sum or difference modulo 2^16 of rows and their mean cycles, repeated."""
    n, width = rows.shape
    period = mean.shape[1]
    result = np.empty((n, width), np.int16)
    whole = width // period * period
    shape = (n, whole // period, period)
    operation(rows[:, :whole].reshape(shape), mean[:, None, :], out=result[:, :whole].reshape(shape))
    operation(rows[:, whole:], mean[:, : width - whole], out=result[:, whole:])
    return result
