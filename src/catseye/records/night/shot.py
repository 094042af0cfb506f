"""shots.csv and frames.npy: ranger, target and time of each shot, and its samples."""

import hashlib
import math
import mmap
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, BinaryIO

import numpy as np
from pydantic import model_validator

from catseye.records.files.reading import Folder, column
from catseye.records.files.record import Mjd, Name, Record, Within, broken_rule
from catseye.records.files.refusal import in_row, refusal, shown, unreadable
from catseye.records.site.site import MOST_SAMPLES, too_many_samples

MAGIC = b"\x93NUMPY"
LONGEST_HEADER = 65_536  # bytes; numpy itself writes 118 here
SAMPLE_BYTES = 2


class ShotRow(Record):
    """Row of shots.csv: one range; `frame` is its buffer's row in frames.npy, counted from 0.

    shot                number, each once
    mjd_utc             time of the trigger
    ranger              name of the ranger
    target              name of the retroreflector; `ZRG` is the internal cube of the ranger
    cycles              number of cycles of the intermediate frequency in the buffer
    samples_per_cycle   samples in a cycle
    frame               row of frames.npy, from 0
    """

    shot: Annotated[int, Within(0, 2**53)]
    mjd_utc: Mjd
    ranger: Name
    target: Name
    cycles: Annotated[int, Within(1, MOST_SAMPLES)]
    samples_per_cycle: Annotated[int, Within(3, MOST_SAMPLES)]
    frame: Annotated[int, Within(0, 2**53)]

    @model_validator(mode="after")
    def _fits_a_buffer(self) -> "ShotRow":
        if self.cycles * self.samples_per_cycle > MOST_SAMPLES:
            raise broken_rule(too_many_samples(self.cycles, self.samples_per_cycle, MOST_SAMPLES))
        return self


class TunedShotRow(ShotRow):
    """Row of a shots.csv with several modulation frequencies: other columns are in `ShotRow`.

    modulation_hz   frequency of the modulation at this shot: site.toml's, or a further one of the ranger's sheet
    """

    modulation_hz: Annotated[float, Within(1e6, 1e11)]


def read_shots(folder: Folder, file: str = "shots.csv") -> Sequence[ShotRow]:
    """Rows of the shots' table, with the column `modulation_hz` where its header has it."""
    header = folder.text(file).partition("\n")[0]
    return folder.table(file, TunedShotRow if "modulation_hz" in header else ShotRow)


@dataclass(frozen=True, eq=False)
class ShotColumns:
    """All shots in file order, as read-only columns.

    modulation_hz   of each shot; None where all have the site's
    """

    shot: np.ndarray
    mjd_utc: np.ndarray
    ranger: tuple[str, ...]
    target: tuple[str, ...]
    cycles: np.ndarray
    samples_per_cycle: np.ndarray
    frame: np.ndarray
    modulation_hz: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.ranger)


def shot_columns(shots: Sequence[ShotRow]) -> ShotColumns:
    return ShotColumns(
        shot=column([shot.shot for shot in shots], np.int64),
        mjd_utc=column([shot.mjd_utc for shot in shots], np.float64),
        ranger=tuple(shot.ranger for shot in shots),
        target=tuple(shot.target for shot in shots),
        cycles=column([shot.cycles for shot in shots], np.int64),
        samples_per_cycle=column([shot.samples_per_cycle for shot in shots], np.int64),
        frame=column([shot.frame for shot in shots], np.int64),
        modulation_hz=column([s.modulation_hz for s in shots if isinstance(s, TunedShotRow)], np.float64)
        if any(isinstance(s, TunedShotRow) for s in shots)
        else None,
    )


def read_buffers(folder: Folder, file: str = "frames.npy") -> np.memmap:
    """Buffers (rows, samples) of int16, mapped read-only; no code in the file is executed."""
    path = folder.path(file)
    try:
        with path.open("rb") as stream:
            header = header_of(stream, file)
            shape, fortran = checked_header(header, file)
            start, size = stream.tell(), path.stat().st_size
            promised = math.prod(shape) * SAMPLE_BYTES
            if size - start != promised:
                fault = "truncated" if size - start < promised else "too long"
                sizes = f"holds {size - start} bytes of data, its header promises {promised}"
                raise refusal(file, f"{sizes}: {fault}")
            stream.seek(0)
            folder.hashes[file] = hashlib.file_digest(stream, "sha256").hexdigest()
        return np.memmap(path, dtype="<i2", mode="r", offset=start, shape=shape, order="F" if fortran else "C")
    except OSError as problem:
        raise unreadable(file, problem) from problem


def release_buffers(buffers: np.ndarray) -> None:
    """Release the memory of mapped buffers; later access reads the file again."""
    mapped = getattr(buffers, "_mmap", None)
    if mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


def header_of(stream: BinaryIO, file: str) -> str:
    """Text of the header that describes the array; the stream is then at the data."""
    opening = stream.read(8)
    if not opening:
        raise refusal(file, "holds 0 bytes: empty")
    if len(opening) < 8 or opening[:6] != MAGIC or opening[6] not in (1, 2, 3):
        raise refusal(file, f"starts with {shown(opening)} (expected the .npy signature {MAGIC!r}, version 1 to 3)")
    width = 2 if opening[6] == 1 else 4
    length = int.from_bytes(stream.read(width), "little")
    header = stream.read(min(length, LONGEST_HEADER))
    if len(header) != length:
        raise refusal(file, f"holds {len(header)} bytes of header, its size field promises {length}: truncated")
    return header.decode("latin-1")


def checked_header(header: str, file: str) -> tuple[tuple[int, int], bool]:
    """Shape of an array that can be buffers, and True if columns come first."""
    kind = re.search(r"['\"]descr['\"]: *['\"]([^'\"]*)['\"]", header)
    order = re.search(r"['\"]fortran_order['\"]: *(True|False)", header)
    shape = re.search(r"['\"]shape['\"]: *\(([0-9, ]{0,60})\)", header)
    if kind and kind[1].startswith("|O"):
        raise refusal(file, f"header, descr = {shown(kind[1])} holds pickled objects, never read (expected '<i2')")
    if not kind or kind[1] != "<i2":
        raise refusal(file, f"header, descr = {shown(kind[1] if kind else header)} (expected '<i2', int16)")
    if not order or not shape:
        raise refusal(file, f"header {shown(header)} (expected fortran_order and shape)")
    sizes = [int(size) for size in re.findall("[0-9]+", shape[1])]
    if len(sizes) != 2 or not all(sizes):
        raise refusal(file, f"header, shape = ({shape[1]}) (expected (buffers, samples), none of them zero)")
    return (sizes[0], sizes[1]), order[1] == "True"


def refuse_shots(file: str, shots: Sequence[ShotRow], buffers: np.memmap) -> None:
    """Raise InputError unless shots are unique, in time order, each with its own buffer."""
    if not shots:
        raise refusal(file, "row 1 is missing, 0 shots (expected at least one)")
    rows, width = buffers.shape
    rows_of_ids: dict[int, int] = {}
    rows_of_frames: dict[int, int] = {}
    latest: dict[str, float] = {}
    previous = -math.inf
    for row, shot in enumerate(shots, start=1):
        if not shot.frame < rows:
            raise in_row(file, row, f"frame = {shot.frame} is not in frames.npy (expected 0 to {rows - 1})")
        if shot.cycles * shot.samples_per_cycle > width:
            raise in_row(file, row, too_many_samples(shot.cycles, shot.samples_per_cycle, width))
        if (first := rows_of_ids.setdefault(shot.shot, row)) != row:
            raise in_row(file, row, f"shot = {shot.shot} is in row {first} already (expected each shot once)")
        if (first := rows_of_frames.setdefault(shot.frame, row)) != row:
            raise in_row(file, row, f"frame = {shot.frame} is in row {first} already (expected one buffer per shot)")
        if shot.mjd_utc < previous:
            raise in_row(file, row, f"mjd_utc = {shot.mjd_utc!r} is before {previous!r} (expected in order of time)")
        if shot.mjd_utc <= latest.get(shot.ranger, -math.inf):
            simultaneous = f"mjd_utc = {shot.mjd_utc!r} is also the time of {shot.ranger}'s last shot"
            raise in_row(file, row, f"{simultaneous} (expected a later time)")
        latest[shot.ranger] = previous = shot.mjd_utc
