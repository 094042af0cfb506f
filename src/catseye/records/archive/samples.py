"""Raw samples of an archived night: blosc2 frames, each chunk the mean cycles and departures of a block of shots."""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catseye.errors import InputError
from catseye.records.archive.codec import Samples, decoded
from catseye.records.archive.index import damaged
from catseye.records.archive.parquet import scale_module
from catseye.records.archive.reading import ArchiveFolder, refuse_damaged
from catseye.records.files.refusal import refusal

FRAME_FORMAT = "catseye-samples-1"
META, PERIODS, CHECKSUMS = "catseye", "periods", "crc32"  # names of a frame's metadata
SHOTS = 64  # of a chunk: 1 MiB of night-01's


@dataclass(frozen=True, eq=False)
class SampleFrame:
    """Frame of samples, open for reading.

    path        of the file
    shape       rows and samples of a row
    shots       rows of a chunk
    columns     largest period
    periods     (rows,) samples of a cycle
    checksums   CRC-32 of each chunk's samples
    schunk      of blosc2
    """

    path: Path
    shape: tuple[int, int]
    shots: int
    columns: int
    periods: np.ndarray
    checksums: np.ndarray
    schunk: Any

    @staticmethod
    def open(path: Path) -> "SampleFrame":
        """Frame of a file; InputError, naming it, if it is damaged or newer."""
        blosc2 = scale_module("blosc2")
        try:
            schunk = blosc2.open(str(path), mode="r", dparams={"nthreads": 1})
            meta = schunk.vlmeta[META]
            periods = np.frombuffer(schunk.vlmeta[PERIODS], "<u4")
            checksums = np.frombuffer(schunk.vlmeta[CHECKSUMS], "<u4")
        except (RuntimeError, ValueError, KeyError, OSError) as problem:
            raise damaged(path, "is no frame of samples") from problem
        if meta["format"] != FRAME_FORMAT:
            raise refusal(str(path), f"format = {meta['format']!r} (expected {FRAME_FORMAT!r}; use a newer catseye)")
        rows, width = meta["shape"]
        return SampleFrame(path, (rows, width), meta["shots"], meta["columns"], periods, checksums, schunk)

    def block(self, number: int) -> Samples:
        """Samples of a chunk's rows; InputError if they differ from their checksum."""
        first = number * self.shots
        periods = self.periods[first : first + self.shots]
        n, width = len(periods), self.shape[1]
        try:
            words = np.frombuffer(self.schunk.decompress_chunk(number), "<u2")
            mean = words[: n * self.columns].view("<i2").reshape(n, self.columns)
            departures = words[n * self.columns :].reshape(n, width)
        except (RuntimeError, ValueError) as problem:
            raise self._damaged(number) from problem
        samples = np.empty((n, width), np.int16)
        for period in np.unique(periods):
            rows = periods == period
            samples[rows] = decoded(mean[rows, :period], departures[rows])
        if checksum(samples) != self.checksums[number]:
            raise self._damaged(number)
        return samples

    def blocks(self) -> Iterator[Samples]:
        """Samples of all chunks in turn."""
        for number in range(len(self.checksums)):
            yield self.block(number)

    def rows(self, rows: Sequence[int] | np.ndarray) -> Samples:
        """Samples of some rows, in their order; only chunks that hold one are unpacked."""
        wanted = np.asarray(rows, dtype=np.int64)
        if wanted.size and (wanted.min() < 0 or wanted.max() >= self.shape[0]):
            wrong = wanted.min() if wanted.min() < 0 else wanted.max()
            raise InputError(f"{self.path}: row {wrong} is unknown (expected 0 to {self.shape[0] - 1})")
        result = np.empty((len(wanted), self.shape[1]), np.int16)
        for number in np.unique(wanted // self.shots).tolist():
            inside = wanted // self.shots == number
            result[inside] = self.block(number)[wanted[inside] - number * self.shots]
        return result

    def _damaged(self, number: int) -> InputError:
        return damaged(self.path, f"rows {number * self.shots} and on differ from their checksum")


def checksum(samples: Samples) -> int:
    """CRC-32 of samples as they lie in memory."""
    return zlib.crc32(np.ascontiguousarray(samples, "<i2").data)


def sample_frame(archive: ArchiveFolder, night: str) -> SampleFrame:
    """Frame of a night's samples; InputError without samples, or for a file of another size."""
    entry = archive.entry(night)
    file = entry.file("samples")
    if file is None:
        raise refusal(str(archive.directory), f"night {entry.night} has no samples in the archive")
    refuse_damaged(archive.directory, file, footer=True)
    return SampleFrame.open(archive.directory / file.path)


def read_samples(archive: ArchiveFolder, night: str, rows: Sequence[int] | None = None) -> Samples:
    """Samples of a night, (shots, samples) int16, bit for bit as they were archived.

    night   identifier, or a beginning that only one has
    rows    of the campaign's frames.npy; None for all

    Raises InputError: an unknown night, one without samples, a damaged file.
    """
    frame = sample_frame(archive, night)
    return frame.rows(range(frame.shape[0]) if rows is None else rows)
