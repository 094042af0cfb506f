"""Archive of samplers: FITS files of all rows, one a period, while a site runs.

A file is complete under its name: it is written beside, synchronised, and renamed. What a killed process had not
written is lost, at most a period and the time of writing; nothing half-written has a name that ends in .fits.
"""

import asyncio
import math
import os
import threading
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catseye.clock import Clock
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.coordinator.samplers.columns import COLUMNS, TEXTS, unit_of
from catseye.coordinator.samplers.pose_rows import Row
from catseye.coordinator.samplers.rings import EpochPoint
from catseye.errors import InputError
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable, ascii_text, sampler_tables
from catseye.geometry.sky.time_tag import utc_text
from catseye.ranger.line import parse_stamp
from catseye.records.night.live import TICKS_PER_DAY

SHORTEST, LONGEST = 5.0, 3600.0  # s, of a period
MOST_ROWS = 1_000_000  # kept while nothing can be written; then the oldest periods are lost
UNFINISHED = ".unfinished-"
FRAMES = {"POINTS": "ground", "POSE": "reflector", "BEAM": "reflector", "FOCUS": "reflector", "SURFACE": "reflector"}
KELVIN = 273.15
Added = tuple[str, Row | EpochPoint]
Report = Callable[[str | None], None]


class SamplerArchive:
    """Archivist of one site's samplers.

    directory   of the archive: a folder for each day, a file for each period
    every       s of a period, which begins at a whole multiple of it in UTC
    site        its name, in the header
    report      called after each period with the reason why nothing can be written, or None

    `trouble` is that reason, `written` the files of this process.

    Raises InputError: the directory cannot be used.
    """

    def __init__(self, directory: Path, *, every: float, clock: Clock, site: str, report: Report):
        self.directory, self.every, self._clock, self._site, self._report = directory, every, clock, site, report
        self._rows: list[Added] = []
        self._waiting: list[tuple[int, list[Added]]] = []  # begin, and rows of periods that are not written yet
        self._number = self._period(ticks_now(clock))  # of the present period, since MJD 0
        self._lock = threading.Lock()  # a period may be under way in a thread when the last one is written
        self.trouble: str | None = None
        self.written: list[Path] = []
        try:
            directory.mkdir(parents=True, exist_ok=True)
            for remainder in directory.glob(f"*/{UNFINISHED}*"):
                remainder.unlink()
        except OSError as problem:
            raise InputError(f"{directory}: cannot hold an archive: {problem.strerror or problem}") from problem

    def add(self, name: str, row: Row | EpochPoint) -> None:
        """Add a row of a sampler to the present period."""
        self._rows.append((name, row))

    async def run(self) -> None:
        """Write each period at its end, until cancelled."""
        while True:
            end = self._begins(self._number + 1)
            await asyncio.sleep(max(0.01, (end - ticks_now(self._clock)) / TICKS_PER_SECOND))
            if ticks_now(self._clock) >= end:
                self._close_period(ticks_now(self._clock))
                await asyncio.to_thread(self._write)
                self._report(self.trouble)

    def finish(self) -> None:
        """Write all rows that are not in a file yet."""
        self._close_period(ticks_now(self._clock))
        self._write()

    def _begins(self, number: int) -> int:
        """Ticks at which a period begins."""
        return round(number * self.every * TICKS_PER_SECOND)

    def _period(self, ticks: int) -> int:
        """Number of the period of an instant."""
        return math.floor((ticks + 0.5) / (self.every * TICKS_PER_SECOND))

    def _close_period(self, now_ticks: int) -> None:
        rows, self._rows = self._rows, []
        if rows:
            self._waiting.append((self._begins(self._number), rows))
        self._number = max(self._period(now_ticks), self._number)
        while len(self._waiting) > 1 and sum(len(item) for _, item in self._waiting) > MOST_ROWS:
            self._waiting.pop(0)

    def _write(self) -> None:
        """Write the periods that wait, oldest first; those that cannot be written wait on."""
        with self._lock:
            try:
                while self._waiting:
                    self.written.append(self._file(*self._waiting[0]))
                    self._waiting.pop(0)
                self.trouble = None
            except (OSError, InputError) as problem:
                self.trouble = f"samplers cannot be archived in {self.directory}: {problem} (retried each period)"

    def _file(self, begin: int, rows: Sequence[Added]) -> Path:
        text = utc_text(begin / TICKS_PER_DAY)  # 2024-11-21T03:01:00...Z
        header: dict[str, str | int | float | bool] = {
            "SITE": ascii_text(self._site),
            "BEGINS": text,
            "PERIOD": self.every,
        }
        content = sampler_tables(archive_tables(rows), header=header)
        folder = self.directory / text[:10]
        folder.mkdir(exist_ok=True)
        name = f"samplers-{text[11:19].replace(':', '')}"
        fresh = folder / f"{UNFINISHED}{name}"
        with fresh.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        path = _free(folder, name)
        fresh.rename(path)
        with suppress(OSError):
            _synchronise(folder)
        return path


def archive_tables(rows: Sequence[Added]) -> dict[str, SamplerTable]:
    """FITS tables of rows, by sampler; temperatures in kelvin, times exact in TICKS."""
    by_name: defaultdict[str, list[Row]] = defaultdict(list)
    for name, row in rows:
        by_name[name].append(row.row() if isinstance(row, EpochPoint) else row)
    return {name: _table(name, by_name[name]) for name in COLUMNS if by_name[name]}


def _table(name: str, rows: Sequence[Row]) -> SamplerTable:
    ticks = np.array([parse_stamp(row[0]) for row in rows], dtype=np.int64)
    columns: dict[str, SamplerColumn] = {"TICKS": SamplerColumn("", ticks, "1e-8 d since MJD 0, exact")}
    for k, column in enumerate(COLUMNS[name], start=1):
        title, made = _column(column, [row[k] for row in rows])
        columns[title] = made
    return SamplerTable(name, columns, mjd=ticks / TICKS_PER_DAY, comment=f"sampler {name}", frame=FRAMES.get(name, ""))


def _column(column: str, texts: Sequence[str]) -> tuple[str, SamplerColumn]:
    """FITS column of a sampler's column, with its name."""
    if column in TEXTS or column == "reference_mjd_d":
        return column.upper(), SamplerColumn("", np.array([ascii_text(text) for text in texts], dtype=str))
    values: ArrayLike = np.array([math.nan if text == "none" else float(text) for text in texts])
    if column == "temperature_c":
        return "TEMPERATURE_K", SamplerColumn("K", np.asarray(values) + KELVIN)
    return column.upper(), SamplerColumn(unit_of(column), values, _comment(column))


def _comment(column: str) -> str:
    ends: Mapping[str, str] = {"_percent": "per cent", "_ppm": "parts per million", "_counts": "counts of an encoder"}
    return next((text for end, text in ends.items() if column.endswith(end)), "")


def _free(folder: Path, name: str) -> Path:
    """Path of a new file: a period may have several, of processes one after another."""
    path, number = folder / f"{name}.fits", 1
    while path.exists():
        number += 1
        path = folder / f"{name}-{number}.fits"
    return path


def _synchronise(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
