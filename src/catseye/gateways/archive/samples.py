"""Raw samples as a blosc2 frame."""

import errno
from pathlib import Path
from shutil import disk_usage

import numpy as np

from catseye.records.archive.codec import Samples, encoded
from catseye.records.archive.parquet import scale_module
from catseye.records.archive.samples import CHECKSUMS, FRAME_FORMAT, META, PERIODS, SHOTS, SampleFrame, checksum

LEVEL = 1  # of zstd: with a block of a whole chunk as small as level 9 with blosc2's own, and some 50 times as fast
BLOCK = 2**20  # bytes


def write_samples(path: Path, samples: Samples, periods: np.ndarray, cycles: np.ndarray) -> None:
    """Write samples, and read them back to see that they come back bit for bit.

    path      of the new file
    samples   (n, width), mapped or in memory; one chunk at a time is touched
    periods   (n,) samples of a cycle of each row, 1 to width
    cycles    (n,) whole cycles at the start of each row

    Raises OSError or InputError: a full disk.
    """
    blosc2 = scale_module("blosc2")
    n, width = samples.shape
    columns = int(periods.max())
    size = 2 * SHOTS * (columns + width)
    parameters = {
        "codec": blosc2.Codec.ZSTD,
        "clevel": LEVEL,
        "typesize": 2,
        "filters": [blosc2.Filter.BITSHUFFLE],
        "blocksize": min(BLOCK, size),
        "nthreads": 1,
    }
    schunk = blosc2.SChunk(chunksize=size, contiguous=True, urlpath=str(path), mode="w", cparams=parameters)
    checksums = []
    try:
        for first in range(0, n, SHOTS):
            block = np.ascontiguousarray(samples[first : first + SHOTS], "<i2")
            checksums.append(checksum(block))
            schunk.append_data(_words(block, periods[first : first + SHOTS], cycles[first : first + SHOTS], columns))
        schunk.vlmeta[META] = {"format": FRAME_FORMAT, "shape": [n, width], "shots": SHOTS, "columns": columns}
        schunk.vlmeta[PERIODS] = periods.astype("<u4").tobytes()
        schunk.vlmeta[CHECKSUMS] = np.array(checksums, "<u4").tobytes()
        del schunk
        if sum(len(block) for block in SampleFrame.open(path).blocks()) != n:
            raise RuntimeError("samples did not come back as they were written")
    except RuntimeError as problem:  # blosc2's, without a number
        full = disk_usage(path.parent).free < size
        raise OSError(errno.ENOSPC if full else errno.EIO, f"{'disk full: ' * full}{problem}") from problem


def _words(block: Samples, periods: np.ndarray, cycles: np.ndarray, columns: int) -> np.ndarray:
    """Content of a chunk: mean cycles, and then departures."""
    n, width = block.shape
    words = np.zeros(n * (columns + width), np.uint16)
    mean, departures = words[: n * columns].reshape(n, columns), words[n * columns :].reshape(n, width)
    for period, count in np.unique(np.stack([periods, cycles], axis=1), axis=0):
        rows = np.flatnonzero((periods == period) & (cycles == count))
        means, departures[rows] = encoded(block[rows], period, count)
        mean[rows, :period] = means.view(np.uint16)
    return words
