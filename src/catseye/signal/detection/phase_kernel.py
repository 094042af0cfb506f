"""Compiled form of `phase` for many 16-bit buffers.

Import it only when a problem is large. Each buffer is read from memory once: it is folded with wide integer sums, and
while it is still in the cache its scatter is computed about the rounded mean cycle. So the single precision of that
second pass is relative to the noise, not to the signal. The plain form in `phase` and `cycle_scatter` is its test.
"""

import numpy as np
from numba import njit

from catseye.signal.detection.cycle_scatter import BATCHES, COLLAPSE, FEWEST_FOR_BATCHES, FEWEST_FOR_DROPOUT
from catseye.signal.detection.folding import LANES, SAFE_ROWS

_FAST_MATH = {"reassoc", "contract"}  # sums may be reordered: samples are integers, nothing here is infinite
_compiled = njit(cache=True, error_model="numpy", fastmath=_FAST_MATH, nogil=True)
_inlined = njit(error_model="numpy", fastmath=_FAST_MATH)  # cached with their caller


@_inlined
def _fold(samples, n, lanes, acc, total):
    """Add the cycles of one buffer into total (n,) int64; acc (lanes,) int32 is emptied before overflow."""
    m, wide = len(samples) // n, lanes // n
    rows = m // wide
    total[:] = 0
    row = 0
    while row < rows:
        stop = min(rows, row + SAFE_ROWS)
        acc[:] = 0
        while row + 4 <= stop:  # four rows share one visit to acc
            four = samples[row * lanes : (row + 4) * lanes]
            for i in range(lanes):
                acc[i] += (four[i] + four[lanes + i]) + (four[2 * lanes + i] + four[3 * lanes + i])
            row += 4
        while row < stop:
            one = samples[row * lanes : (row + 1) * lanes]
            for i in range(lanes):
                acc[i] += one[i]
            row += 1
        for k in range(wide):
            for j in range(n):
                total[j] += acc[k * n + j]
    for k in range(rows * wide, m):
        for j in range(n):
            total[j] += samples[k * n + j]


@_inlined
def _sum(total, cosine, sine):
    re, im = 0.0, 0.0
    for j in range(len(total)):
        re += total[j] * cosine[j]
        im += total[j] * sine[j]
    return complex(re, im)


@_compiled
def phasors(buffers, n, cosine, sine, out):
    """Sum s exp(2 pi i j/n) of buffers (b, m n) int16 into out (b,) complex; cosine, sine (n,)."""
    lanes = n * max(1, LANES // n)
    acc, total = np.empty(lanes, np.int32), np.empty(n, np.int64)
    for b in range(len(buffers)):
        _fold(buffers[b], n, lanes, acc, total)
        out[b] = _sum(total, cosine, sine)


@_compiled
def totals(buffers, width, out):
    """Sum the rows of `width` samples of buffers (b, rows width) int16 into out (b, width) int64."""
    lanes = width * max(1, LANES // width)
    acc = np.empty(lanes, np.int32)
    for b in range(len(buffers)):
        _fold(buffers[b], width, lanes, acc, out[b])


@_inlined
def _ends(samples):
    low, high = samples[0], samples[0]
    for i in range(len(samples)):
        low, high = min(low, samples[i]), max(high, samples[i])
    return low, high


@_inlined
def _one(c, n, centre, cosine, sine, z):
    """Departure of one cycle c (n,) from `centre` (n,): sums into z (2,); returns the sum of squares."""
    re, im, square = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for j in range(n):
        r = np.float32(c[j]) - centre[j]
        re += r * cosine[j]
        im += r * sine[j]
        square += r * r
    z[0], z[1] = re, im
    return square


@_inlined
def _departures(samples, n, m, centre, cosine, sine, z):
    """Departures of all cycles: sums into z (m, 2); returns the sum of squares.

    Four cycles at a time share the loads of the waves and the final sums: three times as fast for 16 a cycle.
    """
    total = np.float64(0.0)
    k = 0
    while k + 4 <= m:
        c = samples[k * n : (k + 4) * n]
        a0, a1, a2, a3 = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
        b0, b1, b2, b3 = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
        square = np.float32(0.0)
        for j in range(n):
            mean, x, y = centre[j], cosine[j], sine[j]
            r0, r1 = np.float32(c[j]) - mean, np.float32(c[n + j]) - mean
            r2, r3 = np.float32(c[2 * n + j]) - mean, np.float32(c[3 * n + j]) - mean
            a0, a1, a2, a3 = a0 + r0 * x, a1 + r1 * x, a2 + r2 * x, a3 + r3 * x
            b0, b1, b2, b3 = b0 + r0 * y, b1 + r1 * y, b2 + r2 * y, b3 + r3 * y
            square += r0 * r0 + r1 * r1 + r2 * r2 + r3 * r3
        z[k, 0], z[k + 1, 0], z[k + 2, 0], z[k + 3, 0] = a0, a1, a2, a3
        z[k, 1], z[k + 1, 1], z[k + 2, 1], z[k + 3, 1] = b0, b1, b2, b3
        total += np.float64(square)
        k += 4
    while k < m:
        total += _one(samples[k * n : (k + 1) * n], n, centre, cosine, sine, z[k])
        k += 1
    return total


@_inlined
def _moments(z, out):
    """Centre z (m, 2); write its squares and product, total and between batches, into out (6,)."""
    m = len(z)
    x, y = 0.0, 0.0
    for k in range(m):
        x += z[k, 0]
        y += z[k, 1]
    x, y = x / m, y / m
    xx, yy, xy = 0.0, 0.0, 0.0
    for k in range(m):
        dx, dy = z[k, 0] - x, z[k, 1] - y
        z[k, 0], z[k, 1] = dx, dy
        xx += dx * dx
        yy += dy * dy
        xy += dx * dy
    out[0], out[1], out[2] = xx, yy, xy
    out[3], out[4], out[5] = np.nan, np.nan, np.nan
    if m < FEWEST_FOR_BATCHES:
        return
    xx, yy, xy = 0.0, 0.0, 0.0
    for g in range(BATCHES):
        first, last = g * m // BATCHES, (g + 1) * m // BATCHES
        x, y = 0.0, 0.0
        for k in range(first, last):
            x += z[k, 0]
            y += z[k, 1]
        xx += x * x / (last - first)
        yy += y * y / (last - first)
        xy += x * y / (last - first)
    out[3], out[4], out[5] = xx, yy, xy


@_inlined
def _dropped(z, moments, x, y):
    """Count collapsed cycles z (m, 2), less their mean (x, y), as `cycle_scatter.dropped_cycles`."""
    m, square = len(z), x * x + y * y
    if m < FEWEST_FOR_DROPOUT:
        return 0
    across = (y * y * moments[0] + x * x * moments[1] - 2.0 * x * y * moments[2]) / (m - 1)  # times square
    if square * square <= 4.0 * COLLAPSE * COLLAPSE * across:
        return 0
    count = 0
    for k in range(m):
        if z[k, 0] * x + z[k, 1] * y < -0.5 * square:
            count += 1
    return count


@_compiled
def statistics(buffers, waves, spectrum, ends, moments, dropped):
    """Statistics of buffers (b, m n) int16, in codes, for `phase`.

    waves     (orders, 2, n), cosine and sine of the harmonics; the second is the fundamental
    spectrum  (b, orders) complex, out: means of s exp(2 pi i k j/n)
    ends      (b, 2) int16, out: lowest and highest sample
    moments   (b, 7), out: sum of squares about the mean cycle, then as `cycle_scatter.moments` of the cycles' phasors
    dropped   (b,), out: cycles whose amplitude collapses
    """
    count, length = buffers.shape
    orders, n = waves.shape[0], waves.shape[2]
    m, lanes = length // n, n * max(1, LANES // n)
    acc, total = np.empty(lanes, np.int32), np.empty(n, np.int64)
    cosine, sine = waves[1, 0].astype(np.float32), waves[1, 1].astype(np.float32)
    centre, single, z = np.empty(n, np.float32), np.empty((m, 2), np.float32), np.empty((m, 2))
    for b in range(count):
        samples = buffers[b]
        _fold(samples, n, lanes, acc, total)
        for i in range(orders):
            spectrum[b, i] = _sum(total, waves[i, 0], waves[i, 1]) / length
        shift = 0.0
        for j in range(n):
            mean = total[j] / m
            centre[j] = np.rint(mean)
            shift += (mean - centre[j]) ** 2
        ends[b, 0], ends[b, 1] = _ends(samples)
        about = _departures(samples, n, m, centre, cosine, sine, single)
        moments[b, 0] = max(about - m * shift, 0.0)
        for k in range(m):
            z[k, 0], z[k, 1] = single[k, 0] * (2.0 / n), single[k, 1] * (2.0 / n)
        _moments(z, moments[b, 1:])
        dropped[b] = _dropped(z, moments[b, 1:], 2.0 * spectrum[b, 1].real, 2.0 * spectrum[b, 1].imag)
