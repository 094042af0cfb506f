"""Synchronous detection of a stream of interleaved channels."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.detection.folding import exponentials, fold, layout
from catseye.signal.detection.phase import BLOCK_SAMPLES, COMPILED_FROM, HARMONICS, Detection, detect


@dataclass
class ChannelStream:
    """Cut buffers of c interleaved channels from a stream.

    Chunks need not end with a cycle or a buffer.

    channels            c, at least 1
    samples_per_cycle   n of each channel, at least 3
    cycles              m of a buffer, at least 1
    volts_per_code      V, above 0
    converter_ends      as for `detect`
    harmonics           as for `detect`

    It stores only the samples of the buffer in progress. Channels are sampled one after the other in each
    time slot: a channel's phase is that of its own samples, so a converter that takes channel i a time tau_i after the
    slot adds 2 pi IF tau_i to it, which a reference taken on the same channel removes.

    Source: [PARKER04] section 5.2, eq. 5.5 and 5.6 channel by channel.

    >>> j = np.arange(40)
    >>> stream = ChannelStream(channels=2, samples_per_cycle=8, cycles=2)
    >>> samples = np.stack([np.cos(2 * np.pi * j / 8 - phi) for phi in (1.0, 2.0)], axis=1)
    >>> len(stream.feed(samples[:15]).phasor), np.round(stream.feed(samples[15:]).phase, 12).tolist(), stream.waiting
    (0, [[1.0, 2.0], [1.0, 2.0]], 8)
    """

    channels: int
    samples_per_cycle: int
    cycles: int
    volts_per_code: float = 1.0
    converter_ends: tuple[float, float] | None = None
    harmonics: Sequence[int] = HARMONICS
    waiting: int = field(default=0, init=False)  # time slots in the buffer in progress
    _pending: NDArray[np.generic] | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse settings that can never give a buffer."""
        if self.channels < 1 or self.cycles < 1:
            raise ValidityError(f"{self.channels} channels of {self.cycles} cycles: expected at least 1 of each")
        self._detect(np.zeros((0, max(1, self.cycles) * int(self.samples_per_cycle), self.channels)))

    def feed(self, samples: ArrayLike) -> Detection:
        """Take the next chunk; return completed buffers, (buffers, channels).

        samples   (t, c) codes or volts, of one type throughout; any t; may be a memory map

        Raises ValidityError, and takes nothing, for a chunk of another width or type.
        """
        chunk = np.asarray(samples)
        self._check(chunk)
        size = self.cycles * int(self.samples_per_cycle)
        if self._pending is None:
            self._pending = np.empty((size, self.channels), dtype=chunk.dtype)
        parts = []
        used = 0
        if self.waiting:
            used = min(size - self.waiting, len(chunk))
            self._pending[self.waiting : self.waiting + used] = chunk[:used]
            self.waiting += used
            if self.waiting < size:
                return self._detect(np.empty((0, size, self.channels), dtype=chunk.dtype))
            parts.append(self._detect(self._pending[None]))
        complete = (len(chunk) - used) // size
        parts.append(self._detect(chunk[used : used + complete * size].reshape(complete, size, self.channels)))
        remainder = chunk[used + complete * size :]
        self._pending[: len(remainder)] = remainder
        self.waiting = len(remainder)
        return joined(parts)

    def _check(self, chunk: NDArray[np.generic]) -> None:
        if chunk.ndim != 2 or chunk.shape[1] != self.channels:
            raise ValidityError(f"a chunk of shape {chunk.shape} is not (time, {self.channels} channels)")
        if chunk.dtype.kind not in "iuf":
            raise ValidityError(f"samples are of type {chunk.dtype}, expected integers or floats")
        if self._pending is not None and chunk.dtype != self._pending.dtype:
            raise ValidityError(f"a chunk of {chunk.dtype} follows {self._pending.dtype}: one stream has one type")

    def _detect(self, buffers: NDArray[np.generic]) -> Detection:
        """Detect (b, m n, c) in blocks, by channel."""
        step = max(1, 4 * BLOCK_SAMPLES // (buffers.shape[1] * self.channels))
        return joined(
            [
                detect(
                    np.ascontiguousarray(buffers[start : start + step].transpose(0, 2, 1)),
                    self.samples_per_cycle,
                    self.volts_per_code,
                    converter_ends=self.converter_ends,
                    harmonics=self.harmonics,
                )
                for start in range(0, max(1, len(buffers)), step)
            ]
        )


def interleaved_phasors(
    samples: ArrayLike, samples_per_cycle: int, volts_per_code: float = 1.0, *, compiled: bool | None = None
) -> NDArray[np.complex128]:
    """Phasors (..., c) of buffers of c interleaved channels, V.

    The samples are not rearranged.

    samples              (..., m n, c) codes or volts, as a converter interleaves them
    samples_per_cycle    n of each channel, at least 3
    volts_per_code       V, above 0
    compiled             True for the compiled form, for int16 (None: from 2^25 samples on); the same to rounding

    A cycle of all channels is one row of n c samples: rows are summed as for one channel, and trigonometry is done once
    a buffer and channel. `ChannelStream` also gives noise and status.

    Source: [PARKER04] eq. 5.5 and 5.6 channel by channel.

    >>> j = np.arange(16)
    >>> both = np.stack([np.cos(2 * np.pi * j / 8 - phi) for phi in (1.0, 2.0)], axis=1)
    >>> np.round(np.angle(interleaved_phasors(both, 8)), 12).tolist()
    [1.0, 2.0]
    """
    array = np.asarray(samples)
    if array.ndim < 2 or array.shape[-1] < 1:
        raise ValidityError(f"samples of shape {array.shape} are not (..., time, channels)")
    c = array.shape[-1]
    n, m = layout(np.moveaxis(array, -1, 0), samples_per_cycle)
    if not 0.0 < volts_per_code < np.inf:
        raise ValidityError(f"volts per code {volts_per_code} V is not above 0 and finite")
    buffers = array.reshape(-1, m, n * c)
    fits = array.dtype == np.int16 and array.dtype.isnative
    if compiled and not fits:
        raise ValidityError(f"the compiled form serves native int16 samples, not {array.dtype}; leave `compiled` out")
    fast = fits and (array.size >= COMPILED_FROM if compiled is None else compiled)
    wave = exponentials(n, (1,))[:, 0] * (2.0 * volts_per_code / (m * n))
    out = np.empty((len(buffers), c), dtype=complex)
    step = max(1, (16 if fast else 1) * BLOCK_SAMPLES // (m * n * c))
    for start in range(0, len(buffers), step):
        block = buffers[start : start + step]
        if fast:
            from catseye.signal.detection import phase_kernel

            total = np.empty((len(block), n * c), dtype=np.int64)
            phase_kernel.totals(np.ascontiguousarray(block).reshape(len(block), -1), n * c, total)
        else:
            total = fold(block)
        out[start : start + step] = np.einsum("bnc,n->bc", total.reshape(-1, n, c), wave)
    return out.reshape((*array.shape[:-2], c))


def joined(parts: Sequence[Detection]) -> Detection:
    """Concatenate detections along their first axis."""
    return _joined(parts)


def _joined(parts: Sequence[Any]) -> Any:
    first = parts[0]
    if len(parts) == 1:
        return first
    if is_dataclass(first):
        names = [f.name for f in fields(first)]
        return replace(first, **{name: _joined([getattr(part, name) for part in parts]) for name in names})  # type: ignore[type-var]
    return np.concatenate(parts)
