"""Phase from zero crossings, as the Clark-Hess meter.

For comparison with synchronous detection.

Effect of clipping, derived. A pure cosine cut off on one side stays symmetric in time about its peak, and its mean, the
comparator's level after AC coupling, drops by L. The rising edge comes early by arcsin(L/A), the falling one late by as
much: a phase from *one* edge is biased, as section 5.2 of the notes says, but the *average of both edges*, which is
what the Clark-Hess takes, is not; nor is the fundamental. The notes' example is wrong for the meter they name. The
average is biased once the waveform is not symmetric in time: an odd harmonic h sin 3x moves both edges alike, by h rad
to first order, where the fundamental does not notice; a second harmonic h sin 2x moves them by 2 h L/A through the
dropped level; and the filter of the AC coupling itself turns the harmonics of a clipped wave against its fundamental.
`studies/phase_estimators.py` measures all of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction

BLOCK_SAMPLES = 2**18  # samples processed at a time: temporaries fit the cache


@dataclass(frozen=True, eq=False)
class Crossing:
    """Phases by zero crossings, one element a buffer.

    NaN without crossings, or where a sample is not finite.

    phase       rad in [0, 2 pi): the average of both edges
    rising      rad in [0, 2 pi), from rising edges alone
    falling     rad in [0, 2 pi), from falling edges alone
    duty        share of the cycle above the level; 1/2 for a wave that crosses it symmetrically
    edges       (..., 2) number of rising and falling edges; beyond the cycles where noise makes the comparator chatter
    """

    phase: NDArray[np.float64]
    rising: NDArray[np.float64]
    falling: NDArray[np.float64]
    duty: NDArray[np.float64]
    edges: NDArray[np.int64]


def crossing_phase(
    samples: ArrayLike, samples_per_cycle: int, *, level: float | None = None, hysteresis: float = 0.0
) -> Crossing:
    """Phase of s = A cos(2 pi j/n - phi) from zero crossings.

    The reference is a square wave locked to the samples.

    samples              (..., m n) V or codes: m cycles of n samples each
    samples_per_cycle    n, at least 3
    level                the comparator's level; by default the mean of each buffer (AC coupling)
    hysteresis           0 or more: the comparator switches up at level + this, down at level - this

    Edges are placed by a straight line between two samples. That alone biases the phase by up to 0.016 (2 pi/n)^3 rad,
    both edges alike (n even): 0.24 um at 64 samples a cycle, 15 um at 16. White noise of rms s gives s/A sqrt(1/3m) on
    average, sqrt(n/6) times that of synchronous detection, as it uses four samples of each cycle. Hysteresis delays
    both edges: +arcsin(h/A), which makes phase depend on amplitude.

    Raises ValidityError for buffers that are not whole cycles. Source: [PARKER04] section 5.2, first paragraph.

    >>> wave = np.cos(2 * np.pi * np.arange(640) / 64 - 2.0)
    >>> crossing = crossing_phase(np.minimum(wave, 0.5), 64)  # clipped: the edges part, their average stays
    >>> [round(float(x), 3) for x in (crossing.rising, crossing.falling, crossing.phase, crossing.duty)]
    [1.891, 2.109, 2.0, 0.535]
    """
    array = np.asarray(samples)
    if array.dtype.kind not in "iuf" or array.ndim == 0:
        raise ValidityError(
            f"samples of type {array.dtype} in {array.ndim} dimensions; expected (..., samples) numbers"
        )
    if not 0.0 <= hysteresis < np.inf:
        raise ValidityError(f"hysteresis {hysteresis} is not 0 or more and finite")
    n = samples_per_cycle
    if n != int(n) or n < 3:
        raise ValidityError(f"{n} samples a cycle do not determine a phase; at least 3 do")
    if array.shape[-1] == 0 or array.shape[-1] % int(n):
        raise ValidityError(f"a buffer of {array.shape[-1]} samples is not a whole number of cycles of {n} samples")
    buffers, shape = array.astype(float, copy=False).reshape(-1, array.shape[-1]), array.shape[:-1]
    rising, falling, edges = _edge_phases(buffers, float(n), level, hysteresis)
    apart = np.angle(np.exp(1j * (falling - rising)))  # gives the duty cycle
    return Crossing(
        phase=fraction(rising + 0.5 * apart, 0.0).reshape(shape),
        rising=fraction(rising, 0.0).reshape(shape),
        falling=fraction(falling, 0.0).reshape(shape),
        duty=(0.5 + apart / TWO_PI).reshape(shape),
        edges=edges.reshape(*shape, 2),
    )


def _edge_phases(
    buffers: NDArray[np.float64], period: float, level: float | None, hysteresis: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Phases from rising and falling edges, and their numbers (count, 2); `period` in samples.

    cos(2 pi t - phi) rises through zero at 2 pi t = phi - pi/2 and falls at phi + pi/2.
    """
    count = len(buffers)
    phases, edges = np.full((2, count), np.nan), np.zeros((count, 2), dtype=np.int64)
    step = max(1, BLOCK_SAMPLES // max(buffers.shape[-1], 1))
    for start in range(0, count, step):
        rows = slice(start, start + step)
        block = buffers[rows]
        with np.errstate(invalid="ignore"):
            height = block - (block.mean(axis=-1, keepdims=True) if level is None else level)
        usable = np.isfinite(height).all(axis=-1)
        height[~usable] = 0.0
        for k, sense in enumerate((1.0, -1.0)):
            row, time = _edges(sense * height, hysteresis)
            turned = np.exp(1j * (TWO_PI * time / period + sense * np.pi / 2.0))
            size = len(block)
            sums = np.bincount(row, turned.real, size) + 1j * np.bincount(row, turned.imag, size)
            number = np.bincount(row, minlength=size)
            phases[k, rows] = np.where(number > 0, np.angle(sums), np.nan)
            edges[rows, k] = number
    return phases[0], phases[1], edges


def _edges(height: NDArray[np.float64], hysteresis: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Row and time (in samples) of the upward switching of a comparator with hysteresis on (buffers, samples)."""
    state = np.where(height > hysteresis, 1, np.where(height < -hysteresis, -1, 0))
    last = np.where(state != 0, np.arange(height.shape[-1]), 0)
    state = np.take_along_axis(
        state, np.maximum.accumulate(last, axis=-1), axis=-1
    )  # within the band the state is unchanged
    row, before = np.nonzero((state[:, :-1] < 0) & (state[:, 1:] > 0))
    low, high = height[row, before], height[row, before + 1]
    return row, before + (hysteresis - low) / (high - low)
