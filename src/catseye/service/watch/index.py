"""Index of a journal by time and by number, through its keys alone: a week is searched as fast as an hour.

Events of a run are in order of `seq`, and nearly in order of time: a shot is stamped at its first sample and stored
after its last. So a time, or a number that counts up, is found by bisection along the primary key.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from sqlalchemy import Connection, TextClause, text

from catseye.constants import SECONDS_PER_DAY
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import SiteFolder

LATE_TICKS = round(5.0 / SECONDS_PER_DAY * TICKS_PER_DAY)  # by which an event may stand behind later ones
FRESH = 1.0  # s for which the list of runs is believed
BEGINNING, END = 0, 2**62  # ticks of no limit


@dataclass(frozen=True, eq=False)
class Stretch:
    """Rows of one table in one file of a run: those with low <= seq < high."""

    part: JournalReader
    run: int
    low: int
    high: int


class JournalIndex:
    """Runs of a journal, and stretches of their tables.

    Raises InputError: no journal there, or an unreadable one.
    """

    def __init__(self, place: str):
        self.reader = JournalReader(place)
        self._runs: tuple[StoredRun, ...] = ()
        self._parts: dict[int, tuple[JournalReader, ...]] = {}
        self._until = 0.0
        self._sites: dict[int, SiteFolder] = {}

    def runs(self) -> tuple[StoredRun, ...]:
        """All runs, oldest first.

        Raises InputError without any.
        """
        if time.monotonic() >= self._until:
            self._runs = self.reader.runs()
            newest = self._runs[-1].run if self._runs else 0
            self._parts.pop(newest, None)  # it may have been continued in another file
            self._until = time.monotonic() + FRESH
        if not self._runs:
            raise InputError(f"journal {self.reader.place}: contains no run (expected at least one)")
        return self._runs

    def run(self, which: int | None = None, at: float | None = None) -> StoredRun:
        """Run of a number, or the one that lasted at an MJD, or the last.

        Raises InputError for an unknown one.
        """
        runs = self.runs()
        if which is not None:
            for run in runs:
                if run.run == which:
                    return run
            raise InputError(f"run {which} is not in the journal (expected {runs[0].run} to {runs[-1].run})")
        before = runs if at is None else [run for run in runs if run.started <= at * TICKS_PER_DAY]
        return before[-1] if before else runs[0]

    def site(self, which: int | None = None) -> SiteFolder:
        """Records of a run, read once."""
        number = self.run(which).run
        if number not in self._sites:
            self._sites[number] = self.reader.site(number)
            self.reader.close()  # the files themselves are not needed again
        return self._sites[number]

    def parts(self, run: int) -> tuple[JournalReader, ...]:
        """Files of a run, in order."""
        if run not in self._parts:
            self._parts[run] = self.reader.parts(run)
        return self._parts[run]

    def runs_between(self, since: float | None, until: float | None) -> list[StoredRun]:
        """Runs that may hold events of a span, oldest first."""
        low, high = limits(since, until)
        runs = self.runs()
        ends = [*(run.started for run in runs[1:]), END]
        return [run for run, end in zip(runs, ends, strict=True) if run.started <= high and end >= low]

    def stretches(
        self, table: str, since: float | None, until: float | None, *, run: int | None = None
    ) -> Iterator[Stretch]:
        """Stretches of a table that hold all rows of a span of MJD, the latest first."""
        low, high = limits(since, until)
        runs = self.runs_between(since, until) if run is None else [self.run(run)]
        for each in reversed(runs):
            for part in reversed(self.parts(each.run)):
                with part.reading() as connection:
                    ends = ends_of(connection, table, each.run)
                    if ends is None:
                        continue
                    first = ends[0] if low <= BEGINNING else first_seq(connection, table, each.run, low - LATE_TICKS)
                    last = ends[1] + 1 if high >= END else first_seq(connection, table, each.run, high + LATE_TICKS)
                if first < last:
                    yield Stretch(part, each.run, first, last)


def limits(since: float | None, until: float | None) -> tuple[int, int]:
    """First and last ticks of a span of MJD."""
    low = BEGINNING if since is None else round(since * TICKS_PER_DAY)
    return low, END if until is None else round(until * TICKS_PER_DAY)


@cache
def _step(table: str, column: str) -> TextClause:
    return text(f"SELECT seq, {column} FROM {table} WHERE run = :run AND seq >= :seq ORDER BY seq LIMIT 1")


@cache
def _end(table: str, way: str) -> TextClause:
    return text(f"SELECT seq FROM {table} WHERE run = :run ORDER BY seq {way} LIMIT 1")


def ends_of(connection: Connection, table: str, run: int) -> tuple[int, int] | None:
    """First and last seq of a run in a table; None if it has no row."""
    first = connection.execute(_end(table, "ASC"), {"run": run}).scalar()
    last = connection.execute(_end(table, "DESC"), {"run": run}).scalar()
    return None if first is None or last is None else (int(first), int(last))


def first_seq(connection: Connection, table: str, run: int, value: int, column: str = "ticks") -> int:
    """Lowest seq from which on a column that counts up has a value or more; behind the last if none has."""
    ends = ends_of(connection, table, run)
    if ends is None:
        return 0
    low, high = ends[0], ends[1] + 1
    while low < high:
        middle = (low + high) // 2
        row = connection.execute(_step(table, column), {"run": run, "seq": middle}).first()
        if row is None or row[1] >= value:
            high = middle
        else:
            low = int(row[0]) + 1
    return low
