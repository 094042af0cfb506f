"""One buffer of samples: from a .npy file, a table or list of numbers, or a shot of a campaign."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.records.files.reading import INTEGER, Folder, cells_of
from catseye.records.files.refusal import NUMBER, refusal, shown, unreadable
from catseye.records.night.campaign import read_campaign
from catseye.records.night.shot import LONGEST_HEADER, header_of
from catseye.records.site.site import MOST_SAMPLES

HEADINGS = {"code": True, "volt": False}  # heading of a column of samples -> True for codes of the converter
TYPES = re.compile(r"'[<>|=]?[iuf][1248]'")  # of the samples in a .npy file


@dataclass(frozen=True, eq=False)
class RecordedBuffer:
    """Samples of one buffer as recorded.

    samples             (k,) codes of a converter (whole numbers), or volts
    name                file, and row or shot
    samples_per_cycle   n; None where the file does not say
    intermediate_hz     Hz; None where it does not
    volts_per_code      V; None where it does not
    bits                of the converter; None where it does not say
    hashes              SHA-256 of the files read
    """

    samples: np.ndarray
    name: str
    hashes: dict[str, str]
    samples_per_cycle: int | None = None
    intermediate_hz: float | None = None
    volts_per_code: float | None = None
    bits: int | None = None

    @property
    def is_codes(self) -> bool:
        """True for codes of the converter, False for volts."""
        return self.samples.dtype.kind in "iu"


def read_buffer(path: Path, *, row: int | None = None, shot: int | None = None) -> RecordedBuffer:
    """Buffer in a file or a campaign's directory.

    path   .npy of one or two dimensions, a table with a column `code` or `volt`, numbers one a line, or a campaign
    row    of a .npy of two dimensions, from 0
    shot   of a campaign, its number in shots.csv

    Nothing in a .npy file is executed. Raises InputError for what cannot be read, and for a row or a shot that is
    missing or not there.
    """
    if path.is_dir():
        if shot is None or row is not None:
            raise refusal(str(path), "is a campaign's directory (expected a shot of it, and no row)")
        return _of_campaign(path, shot)
    if shot is not None:
        raise refusal(
            str(path), f"is not a campaign's directory, so that shot = {shot} means nothing (expected no shot)"
        )
    folder = Folder(path.parent)
    if path.suffix == ".npy":
        samples, name = _of_array(folder, path, row)
    elif row is not None:
        raise refusal(path.name, f"row = {row} of a table of one column (expected a row of a .npy file alone)")
    else:
        samples, name = _of_text(folder.text(path.name), path.name), path.name
    _refuse_length(samples, path.name)
    return RecordedBuffer(samples, name, folder.hashes)


def buffer_of(samples: np.ndarray, *, row: int | None = None, name: str = "array") -> RecordedBuffer:
    """Buffer in an array of codes (whole numbers) or volts.

    samples   of one dimension, or of two with a row

    Raises InputError for another shape or type.
    """
    array = np.asarray(samples)
    if array.dtype.kind not in "iuf":
        raise refusal(name, f"holds {array.dtype} (expected numbers)")
    chosen, label = _row_of(array, name, row)
    _refuse_length(chosen, name)
    return RecordedBuffer(chosen, label, {})


def _of_campaign(path: Path, shot: int) -> RecordedBuffer:
    campaign = read_campaign(path)
    shots, adc = campaign.shots, campaign.site.adc
    at = np.flatnonzero(shots.shot == shot)
    if not len(at):
        raise refusal(f"{path.name}/shots.csv", f"shot {shot} is not there (expected one of {len(shots.shot)})")
    k = int(at[0])
    n, cycles = int(shots.samples_per_cycle[k]), int(shots.cycles[k])
    return RecordedBuffer(
        np.array(campaign.frames[shots.frame[k], : n * cycles]),
        f"{path.name}, shot {shot}: {shots.ranger[k]} to {shots.target[k]}",
        dict(campaign.hashes),
        samples_per_cycle=n,
        intermediate_hz=campaign.site.ranging.if_hz,
        volts_per_code=adc.full_scale_volt / 2 ** (adc.bits - 1),
        bits=adc.bits,
    )


def _of_array(folder: Folder, path: Path, row: int | None) -> tuple[np.ndarray, str]:
    where = folder.path(path.name)
    try:
        with where.open("rb") as stream:
            header = header_of(stream, path.name)
            kind = re.search(r"['\"]descr['\"]: *([^,]*),", header)
            if kind is None or not TYPES.fullmatch(kind[1].strip()):
                raise refusal(path.name, f"header, descr = {shown(kind[1] if kind else header)} (expected numbers)")
            stream.seek(0)
            folder.hashes[path.name] = hashlib.file_digest(stream, "sha256").hexdigest()
        array = np.load(where, mmap_mode="r", allow_pickle=False, max_header_size=LONGEST_HEADER)
    except OSError as problem:
        raise unreadable(path.name, problem) from problem
    except ValueError as problem:
        raise refusal(path.name, f"cannot be read as an array: {problem}") from problem
    return _row_of(array, path.name, row)


def _row_of(array: np.ndarray, name: str, row: int | None) -> tuple[np.ndarray, str]:
    if array.ndim == 1 and row is None:
        return np.array(array), name
    if array.ndim == 2 and row is not None and 0 <= row < len(array):
        return np.array(array[row]), f"{name}, row {row}"
    said = "no row" if row is None else f"row {row}"
    if array.ndim == 2:
        raise refusal(name, f"holds {len(array)} buffers, {said} was asked for (expected 0 to {len(array) - 1})")
    expected = "one buffer without a row" if array.ndim == 1 else "one or two dimensions"
    raise refusal(name, f"has {array.ndim} dimensions, {said} was asked for (expected {expected})")


def _refuse_length(samples: np.ndarray, name: str) -> None:
    if not 3 <= len(samples) <= MOST_SAMPLES:
        raise refusal(name, f"holds {len(samples)} samples (expected 3 to {MOST_SAMPLES})")


def _of_text(text: str, file: str) -> np.ndarray:
    header, rows = cells_of(text, file)
    cells = [header, *rows]
    names = [cell.strip().lower() for cell in header]
    wanted = [name for name in names if name in HEADINGS]
    at, codes = 0, None
    if wanted:
        if len(wanted) > 1:
            raise refusal(file, f"header has the columns {', '.join(wanted)} (expected one of them)")
        at, codes, cells = names.index(wanted[0]), HEADINGS[wanted[0]], rows
    elif len(header) != 1 or not NUMBER.fullmatch(names[0]):
        columns = shown(",".join(header))
        raise refusal(file, f"header, {columns} has no column of samples (expected code or volt, or a list of numbers)")
    read: list[str] = []
    for number, line in enumerate(cells, start=1):
        if len(line) <= at or not NUMBER.fullmatch(line[at].strip()):
            written = shown(",".join(line))
            raise refusal(file, f"row {number}, {written} is not a number in column {at + 1} (expected a sample)")
        read.append(line[at].strip())
    if codes is None:
        codes = all(INTEGER.fullmatch(cell) for cell in read)
    convert: Callable[[str], float] = int if codes else float
    try:
        return np.array([convert(cell) for cell in read], dtype=np.int64 if codes else np.float64)
    except ValueError as problem:
        raise refusal(file, f"a sample of the column code is not a whole number: {problem}") from problem
