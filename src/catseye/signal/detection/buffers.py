"""Status of each buffer, as a value and in words."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.detection.cycle_scatter import CycleScatter
from catseye.signal.detection.phase import HARMONICS, Detection, detect

SHORTEST_RUN = 8  # samples: fewer equal ones occur by chance where a cycle has few samples
RUN_BLOCK = 2**20  # samples searched for runs at a time


class BufferStatus(IntEnum):
    """Status of one buffer, worse ones higher.

    Up to CLIPPED there is a phasor, which can be bad above WEAK.
    """

    GOOD = 0
    WEAK = 1
    NO_SCATTER = 2
    DROPOUT = 3
    STUCK = 4
    CLIPPED = 5
    NOT_FINITE = 6
    WRONG_LENGTH = 7
    NOT_SAMPLES = 8


TEXTS = {
    BufferStatus.GOOD: "",
    BufferStatus.WEAK: "amplitude {amplitude:.4g} V is below the limit {weakest:.4g} V",
    BufferStatus.NO_SCATTER: "{cycles} cycles of {n} samples do not show their noise, so the uncertainty "
    "is unknown; take at least 2 cycles, and noise above a converter step",
    BufferStatus.DROPOUT: "{dropped} of {cycles} cycles have less than half the amplitude; was the beam cut?",
    BufferStatus.STUCK: "a run of at least {run} equal samples (a cycle has {n}); look at the converter",
    BufferStatus.CLIPPED: "{clipped} samples at the converter's ends (largest {largest:.4g} V)",
    BufferStatus.NOT_FINITE: "a sample is NaN, infinite, or too large to be squared",
    BufferStatus.WRONG_LENGTH: "{length} samples, expected {expected}",
    BufferStatus.NOT_SAMPLES: "expected a row of integers or floats",
}


@dataclass(frozen=True, eq=False)
class Inspection:
    """Detection and status of b buffers.

    status              (b,) int8 of BufferStatus; `text` says it in words
    detection           of b buffers; NaN and zero counts where there is no phasor
    length              (b,) samples; -1 where it is not a row of samples
    samples_per_cycle   n
    cycles              the cycles expected; None: any whole number
    weakest             V, the limit for WEAK; 0: none
    """

    status: NDArray[np.int8]
    detection: Detection
    length: NDArray[np.int64]
    samples_per_cycle: int
    cycles: int | None
    weakest: float

    def text(self, buffer: int) -> str:
        """Status text of one buffer: fault and remedy."""
        name = BufferStatus(self.status[buffer]).name.lower().replace("_", " ")
        detail = self.detail(buffer)
        return f"{name}: {detail}" if detail else name

    def detail(self, buffer: int) -> str:
        """Detail of one buffer without its status name."""
        n, detection = self.samples_per_cycle, self.detection
        expected = f"a whole number of cycles of {n}" if self.cycles is None else f"{self.cycles} cycles of {n}"
        return TEXTS[BufferStatus(self.status[buffer])].format(
            amplitude=float(detection.amplitude[buffer]),
            weakest=self.weakest,
            cycles=int(detection.scatter.cycles[buffer]),
            n=n,
            dropped=int(detection.scatter.dropped[buffer]),
            run=shortest_run(n),
            clipped=int(detection.clipped[buffer]),
            largest=float(detection.largest[buffer]),
            length=int(self.length[buffer]),
            expected=expected,
        )


def inspect_buffers(
    buffers: ArrayLike | Sequence[ArrayLike],
    samples_per_cycle: int,
    volts_per_code: float = 1.0,
    *,
    cycles: int | None = None,
    converter_ends: tuple[float, float] | None = None,
    harmonics: Sequence[int] = HARMONICS,
    weakest: float = 0.0,
) -> Inspection:
    """Detect buffers of any length or quality, with a status each.

    buffers              (b, samples), or a sequence of b rows, which may be of any length and type
    samples_per_cycle    n, at least 3
    volts_per_code       V, above 0
    cycles               m expected; None takes any whole number of cycles
    converter_ends       as for `detect`
    harmonics            as for `detect`
    weakest              V, amplitude below which a buffer is WEAK; without it a weak return is good, with a large
                         uncertainty

    The worst status is returned. Only the arguments raise (ValidityError), never a buffer.

    Source: [PARKER04] section 5.2; the rules for dropout in `cycle_scatter`, for stuck converters in `has_long_run`.

    >>> wave = np.rint(1000 * np.cos(2 * np.pi * np.arange(128) / 64)).astype(np.int16)
    >>> noisy = wave + np.arange(128) % 5
    >>> seen = inspect_buffers([noisy, noisy[:100], np.full(128, np.nan)], 64, 0.001)
    >>> seen.text(0), seen.text(1)
    ('good', 'wrong length: 100 samples, expected a whole number of cycles of 64')
    >>> seen.text(2)
    'not finite: a sample is NaN, infinite, or too large to be squared'
    """
    if not 0.0 <= weakest < np.inf:
        raise ValidityError(f"weakest amplitude {weakest} V is not 0 or above and finite")
    if cycles is not None and cycles < 1:
        raise ValidityError(f"{cycles} cycles are not a buffer; at least 1 is expected")
    n = int(samples_per_cycle)
    # raises for invalid arguments
    detect(np.zeros(2 * max(n, 1)), samples_per_cycle, volts_per_code, harmonics=harmonics)
    count = len(buffers)  # type: ignore[arg-type]
    status, length = np.zeros(count, dtype=np.int8), np.full(count, -1, dtype=np.int64)
    detection = _empty_detection(count, len(tuple(harmonics)))
    groups: dict[tuple[int, str], list[int]] = {}
    table = buffers if isinstance(buffers, np.ndarray) and buffers.ndim == 2 and buffers.dtype.kind in "iuf" else None
    rows: list[NDArray[np.generic]] = []
    if table is not None:
        length[:] = table.shape[1]
        groups[table.shape[1], table.dtype.str] = list(range(count))
    else:
        rows = [_row(buffer) for buffer in buffers]  # type: ignore[union-attr]
        for i, row in enumerate(rows):
            if row.ndim != 1 or row.dtype.kind not in "iuf":
                status[i] = BufferStatus.NOT_SAMPLES
                continue
            length[i] = len(row)
            groups.setdefault((len(row), row.dtype.str), []).append(i)
    for (size, _), members in groups.items():
        if size == 0 or size % n or (cycles is not None and size != cycles * n):
            status[members] = BufferStatus.WRONG_LENGTH
            continue
        block = table if table is not None else np.stack([rows[i] for i in members])
        part = detect(block, n, volts_per_code, converter_ends=converter_ends, harmonics=harmonics)
        status[members] = _judged(part, has_long_run(block, shortest_run(n)), weakest)
        _copy_rows(detection, members, part)
    return Inspection(
        status=status, detection=detection, length=length, samples_per_cycle=n, cycles=cycles, weakest=weakest
    )


def shortest_run(samples_per_cycle: int) -> int:
    """Shortest run of equal samples that a live signal cannot show.

    It is more than half a cycle, and at least 8.

    In half a cycle a sine changes by its amplitude or more, so only a signal below a converter step stays constant that
    long.
    """
    return max(samples_per_cycle // 2 + 1, SHORTEST_RUN)


def has_long_run(samples: NDArray[np.generic], run: int) -> NDArray[np.bool_]:
    """True (b,) for buffers with `run` equal samples in a row.

    Such a run spans two neighbouring points of a grid of run//2 samples. Only where these are equal is the buffer
    searched in full.
    """
    step = max(1, run // 2)
    answer = np.zeros(len(samples), dtype=bool)
    block_rows = max(1, RUN_BLOCK // max(1, samples.shape[-1]))
    for start in range(0, len(samples), block_rows):
        block = samples[start : start + block_rows]
        grid = block[:, ::step]
        suspects = np.flatnonzero((grid[:, 1:] == grid[:, :-1]).any(axis=1))
        for i in suspects:
            changes = np.flatnonzero(np.diff(block[i]) != 0)
            edges = np.concatenate([[-1], changes, [block.shape[1] - 1]])
            answer[start + i] = np.max(np.diff(edges)) >= run
    return answer


def _judged(detection: Detection, stuck: NDArray[np.bool_], weakest: float) -> NDArray[np.int8]:
    """Worst status that applies, tested in order of severity."""
    status = np.zeros(detection.phasor.shape, dtype=np.int8)
    status[detection.amplitude < weakest] = BufferStatus.WEAK
    status[~(detection.u_phasor > 0.0)] = BufferStatus.NO_SCATTER
    status[detection.scatter.dropped > 0] = BufferStatus.DROPOUT
    status[stuck] = BufferStatus.STUCK
    status[detection.clipped > 0] = BufferStatus.CLIPPED
    finite = np.isfinite(detection.phasor) & np.isfinite(detection.largest) & ~np.isinf(detection.u_phasor)
    status[~finite] = BufferStatus.NOT_FINITE
    return status


def _row(buffer: ArrayLike) -> NDArray[np.generic]:
    """Buffer as an array; an empty object array if invalid."""
    try:
        return np.asarray(buffer)
    except (ValueError, TypeError):
        return np.empty((), dtype=object)


def _empty_detection(count: int, harmonics: int) -> Detection:
    def nan(*tail: int) -> NDArray[np.float64]:
        return np.full((count, *tail), np.nan)

    def zero() -> NDArray[np.int64]:
        return np.zeros(count, dtype=np.int64)

    scatter = CycleScatter(cycles=zero(), total=nan(3), between=nan(3), dropped=zero())
    return Detection(
        phasor=nan().astype(complex),
        u_phasor=nan(),
        offset=nan(),
        overtones=nan(harmonics).astype(complex),
        noise=nan(),
        largest=nan(),
        clipped=zero(),
        scatter=scatter,
    )


def _copy_rows(into: Detection, rows: Sequence[int], part: Detection) -> None:
    for destination, source in ((into, part), (into.scatter, part.scatter)):
        for field in fields(destination):
            target = getattr(destination, field.name)
            if isinstance(target, np.ndarray):
                target[rows] = getattr(source, field.name)
