"""What became of each buffer of a lot, as a value and in words: whatever comes in, every buffer gets its status."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.detection.cycle_scatter import CycleScatter
from catseye.signal.detection.phase import HARMONICS, Detection, detect

SHORTEST_RUN = 8  # samples: fewer that are equal happen by chance where a cycle has few samples
RUN_BLOCK = 2**20  # samples looked at for runs at a time


class BufferStatus(IntEnum):
    """What became of one buffer, worse ones higher; those up to CLIPPED have a phasor, which can be bad above WEAK."""

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
    BufferStatus.WEAK: "amplitude {amplitude:.4g} V is below the limit of {weakest:.4g} V",
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
    """b buffers, what they say and whether it can be used.

    status              (b,) int8 of BufferStatus; `text` says it in words
    detection           of b buffers; NaN and zero counts where there is no phasor
    length              (b,) samples; -1 where it is no row of samples
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
        """The status of one buffer in words: what is wrong and what to do."""
        name = BufferStatus(self.status[buffer]).name.lower().replace("_", " ")
        detail = self.detail(buffer)
        return f"{name}: {detail}" if detail else name

    def detail(self, buffer: int) -> str:
        """The same without the status."""
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
    """Detect each of a lot of buffers that may differ in length and may be bad, with a status each.

    buffers              (b, samples), or a sequence of b rows, which may be of any length and type
    samples_per_cycle    n, at least 3
    volts_per_code       V, above 0
    cycles               m expected; None takes any whole number of cycles
    converter_ends       as for `detect`
    harmonics            as for `detect`
    weakest              V, amplitude below which a buffer is called weak; without it a weak return is good, and its
                         uncertainty tells

    The gravest status is given. Only the arguments raise (ValidityError), never a buffer.

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
        raise ValidityError(f"{cycles} cycles are no buffer; at least 1 is")
    n = int(samples_per_cycle)
    # refuses what no buffer can mend
    detect(np.zeros(2 * max(n, 1)), samples_per_cycle, volts_per_code, harmonics=harmonics)
    count = len(buffers)  # type: ignore[arg-type]
    status, length = np.zeros(count, dtype=np.int8), np.full(count, -1, dtype=np.int64)
    detection = _nothing(count, len(tuple(harmonics)))
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
        _put(detection, members, part)
    return Inspection(status, detection, length, n, cycles, weakest)


def status_of(detection: Detection, *, weakest: float = 0.0) -> NDArray[np.int8]:
    """(...) BufferStatus of what was detected before; STUCK needs the samples and is not told here.

    detection   any shape
    weakest     V, amplitude below which a buffer is called weak
    """
    return _judged(detection, np.zeros(detection.phasor.shape, dtype=bool), weakest)


def shortest_run(samples_per_cycle: int) -> int:
    """Equal samples in a row that a live signal does not show: more than half a cycle, and at least 8.

    In half a cycle a sine changes by its amplitude or more, so only one below a converter step stays that long.
    """
    return max(samples_per_cycle // 2 + 1, SHORTEST_RUN)


def has_long_run(samples: NDArray[np.generic], run: int) -> NDArray[np.bool_]:
    """(b,) whether buffers (b, samples) hold a run of at least `run` equal samples.

    Such a run spans two neighbouring points of a grid of run//2 samples. Where these are equal the buffer is looked at
    in full, the others are done with.
    """
    step = max(1, run // 2)
    answer = np.zeros(len(samples), dtype=bool)
    at_once = max(1, RUN_BLOCK // max(1, samples.shape[-1]))
    for start in range(0, len(samples), at_once):
        block = samples[start : start + at_once]
        grid = block[:, ::step]
        suspects = np.flatnonzero((grid[:, 1:] == grid[:, :-1]).any(axis=1))
        for i in suspects:
            changes = np.flatnonzero(np.diff(block[i]) != 0)
            edges = np.concatenate([[-1], changes, [block.shape[1] - 1]])
            answer[start + i] = np.max(np.diff(edges)) >= run
    return answer


def _judged(detection: Detection, stuck: NDArray[np.bool_], weakest: float) -> NDArray[np.int8]:
    """The gravest status that applies; the conditions stand in order of gravity."""
    status = np.zeros(detection.phasor.shape, dtype=np.int8)
    status[detection.amplitude < weakest] = BufferStatus.WEAK
    status[~(detection.u_phasor > 0.0)] = BufferStatus.NO_SCATTER
    status[detection.scatter.dropped > 0] = BufferStatus.DROPOUT
    status[stuck] = BufferStatus.STUCK
    status[detection.clipped > 0] = BufferStatus.CLIPPED
    known = np.isfinite(detection.phasor) & np.isfinite(detection.largest) & ~np.isinf(detection.u_phasor)
    status[~known] = BufferStatus.NOT_FINITE
    return status


def _row(buffer: ArrayLike) -> NDArray[np.generic]:
    """The buffer as an array; an empty pair of brackets of objects where it cannot be one."""
    try:
        return np.asarray(buffer)
    except (ValueError, TypeError):
        return np.empty((), dtype=object)


def _nothing(count: int, harmonics: int) -> Detection:
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


def _put(into: Detection, rows: Sequence[int], part: Detection) -> None:
    for whole, piece in ((into, part), (into.scatter, part.scatter)):
        for field in fields(whole):
            target = getattr(whole, field.name)
            if isinstance(target, np.ndarray):
                target[rows] = getattr(piece, field.name)
