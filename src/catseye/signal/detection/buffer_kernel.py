"""Compiled detection of one buffer of 16-bit samples.

Does the work of `phase.detect` and `buffers.has_long_run`, and takes out the run of a moving target's phase.

A range rate v changes the phase by -4 pi f v/c a second. Over a buffer the plain mean is that of the middle with
sin(x)/x of the amplitude, x half the run; but the run looks like slow noise, and the leakage is constant while the
return turns. Both effects vanish where the run is known to a few per cent, as from the telescope's drives.

For programs that process each buffer on arrival: the plain forms, which are its test, take half a millisecond of array
overhead. Import it only for continuous streams: loading takes 0.2 s, once.
"""

import numpy as np
from numba import njit

from catseye.signal.detection.cycle_scatter import BATCHES, COLLAPSE, FEWEST_FOR_BATCHES, FEWEST_FOR_DROPOUT

# places in `out`, after the mean's two parts: offset, harmonics 2 and 3, lowest, highest, ..., six moments
OFFSET, SECOND, LOW, HIGH, CLIPPED, LONGEST, DROPPED, TOTAL, BETWEEN = 2, 3, 5, 6, 7, 8, 9, 10, 13


@njit(cache=True, error_model="numpy", nogil=True)
def _moments(re, im, out):
    """Sums of squares and products of departures from the mean, then of batches; NaN below 16 cycles."""
    m = len(re)
    mean_re, mean_im = re.mean(), im.mean()
    xx = yy = xy = 0.0
    for k in range(m):
        a, b = re[k] - mean_re, im[k] - mean_im
        xx, yy, xy = xx + a * a, yy + b * b, xy + a * b
    out[0], out[1], out[2] = xx, yy, xy
    if m < FEWEST_FOR_BATCHES:
        out[3:6] = np.nan
        return
    xx = yy = xy = 0.0
    for batch in range(BATCHES):
        first, last = batch * m // BATCHES, (batch + 1) * m // BATCHES
        a = b = 0.0
        for k in range(first, last):
            a, b = a + re[k] - mean_re, b + im[k] - mean_im
        size = last - first
        xx, yy, xy = xx + a * a / size, yy + b * b / size, xy + a * b / size
    out[3], out[4], out[5] = xx, yy, xy


@njit(cache=True, error_model="numpy", nogil=True)
def one_buffer(samples, n, ends, run, leaked, out, still):
    """Statistics of one buffer (m n,) int16, in codes.

    Writes out (16,), and for a running phase the moving return into still (8,).

    ends     lowest and highest code that count as clipped
    run      rad a cycle of phase motion; 0: `still` is not written
    leaked   codes, complex, constant leakage in the samples
    still    re, im of the mean, then the six moments
    """
    m = len(samples) // n
    re, im, total = np.zeros(m), np.zeros(m), np.zeros(n)
    cosine, sine = np.empty(n), np.empty(n)
    for j in range(n):
        cosine[j], sine[j] = np.cos(2.0 * np.pi * j / n), np.sin(2.0 * np.pi * j / n)
    low, high, clipped, longest, row = samples[0], samples[0], 0, 1, 0
    before = samples[0]
    for k in range(m):
        a = b = 0.0
        for j in range(n):
            s = samples[k * n + j]
            a += s * cosine[j]
            b += s * sine[j]
            total[j] += s
            low, high = min(low, s), max(high, s)
            clipped += (s <= ends[0]) | (s >= ends[1])
            row = row + 1 if s == before else 1
            longest, before = max(longest, row), s
        re[k], im[k] = 2.0 * a / n, 2.0 * b / n
    out[0], out[1], out[2] = re.mean(), im.mean(), total.mean() / m
    for i, order in enumerate((2, 3)):
        a = b = 0.0
        for j in range(n):
            a += total[j] * np.cos(2.0 * np.pi * order * j / n)
            b += total[j] * np.sin(2.0 * np.pi * order * j / n)
        factor = 2.0 if 2 * order < n else 1.0 if 2 * order == n else np.nan
        out[3 + i] = factor * np.hypot(a, b) / (m * n)
    out[5], out[6], out[7], out[8] = low, high, clipped, longest
    _moments(re, im, out[10:])
    out[9] = _dropped(re, im, out[0], out[1], out[10:]) if m >= FEWEST_FOR_DROPOUT else 0.0
    if run != 0.0:
        _stop_rotation(re, im, n, run, leaked, still)


@njit(cache=True, error_model="numpy", nogil=True)
def _dropped(re, im, mean_re, mean_im, moments):
    """Count cycles that collapse, as `cycle_scatter.dropped_cycles`."""
    m, square = len(re), mean_re**2 + mean_im**2
    if square == 0.0:
        return 0
    size = np.sqrt(square)
    c, s = mean_re / size, mean_im / size
    across = max(s * s * moments[0] + c * c * moments[1] - 2.0 * s * c * moments[2], 0.0) / (m - 1)
    if square <= 4.0 * COLLAPSE**2 * across:
        return 0
    count = 0
    for k in range(m):
        count += (re[k] - mean_re) * mean_re + (im[k] - mean_im) * mean_im < -0.5 * square
    return count


@njit(cache=True, error_model="numpy", nogil=True)
def _stop_rotation(re, im, n, run, leaked, still):
    """Turn each cycle back by the phase run, below pi a cycle in size.

    A phase that runs by p(j) within a cycle of phasor A exp(i theta) leaves a A exp(i theta) + b A exp(-i theta), a the
    mean of exp(ip) and b that of exp(-ip + 4 pi i j/n). Exact for an even run.

    Source: [PARKER04] eq. 5.1-5.3 for each cycle.
    """
    m = len(re)
    direct, image = 0.0, 0j
    for j in range(n):
        within = run * (j - 0.5 * (n - 1)) / n
        direct += np.cos(within)
        image += np.exp(1j * (4.0 * np.pi * j / n - within))
    direct, image = direct / n, image / n
    scale = 1.0 / (direct**2 - abs(image) ** 2)
    for k in range(m):
        z = complex(re[k], im[k]) - leaked
        z = (direct * z - image * z.conjugate()) * scale * np.exp(-1j * run * (k - 0.5 * (m - 1)))
        re[k], im[k] = z.real, z.imag
    still[0], still[1] = re.mean(), im.mean()
    _moments(re, im, still[2:])
