"""Recover readable rows of a damaged SQLite journal into a new one.

SQLite reads a table by its tree from the root: if a page is missing, all behind it is. Here each existing page is read
by itself. A page of a table's tree has that table's rows; on a page whose path from the root is lost, rows are
recognised by their number of cells and the type of each. Recovered rows are not trusted for that: they are verified
against the chain like any journal.

Source: [SQLITE24] secs. 1.3, 1.6, 2.1, 4.1: pages, cells, records, the log.
"""

import mmap
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from sqlalchemy.dialects import sqlite as dialect
from sqlalchemy.schema import CreateTable

from catseye.coordinator.journal.cells import cell_kinds
from catseye.coordinator.journal.tables import (
    APPLICATION_ID,
    CHAIN,
    EVENTS,
    FIRST_CHAINED,
    FORMAT,
    METADATA,
    PARTS,
    RUNS,
    VERSION,
    JournalTable,
)
from catseye.errors import InputError

USUAL_PAGE = 8192  # bytes, in a journal made by catseye
SIZES = tuple(2**k for k in range(9, 17))
MAGIC = b"SQLite format 3\0"
HEADER = 100  # bytes before the first page's tree
INTERIOR_INDEX, INTERIOR_TABLE, LEAF_INDEX, LEAF_TABLE = 2, 5, 10, 13  # a page's first byte
LOG_HEADER, FRAME_HEADER = 32, 24  # bytes of a log
LOG_MAGIC = (0x377F0682, 0x377F0683)  # checksums of little-endian words, and of big-endian ones
WIDTHS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}  # bytes of an integer by its serial type
MOST_CELL = 2**30  # bytes of one record, SQLite's own limit
OF_CHAINS = (CHAIN, PARTS)  # missing in a journal of version 1
TOGETHER = 256  # rows written at once
Record = tuple[object, ...]


class _Damaged(Exception):
    """A cell that is unreadable."""


@dataclass
class Recovery:
    """Contents recovered from a damaged journal.

    rows    by table
    lost    cells that are unreadable, or belong to no table
    pages, missing   pages read; pages named by a table's tree but missing
    """

    rows: dict[str, int] = field(default_factory=dict)
    lost: int = 0
    pages: int = 0
    missing: int = 0

    def __str__(self) -> str:
        events = sum(self.rows.values())
        return f"{events} rows recovered from {self.pages} pages; {self.lost} cells and {self.missing} pages lost"


def recover(damaged: Path, new: Path) -> Recovery:
    """Recover all readable rows of a journal into a new one.

    damaged   file, with its log beside it
    new       file to write

    Raises InputError: no readable row; a full disk.
    """
    recovery = Recovery()
    try:
        with _pages(damaged) as pages, closing(sqlite3.connect(new, isolation_level=None)) as target:
            _create(target)
            for table, rows in _recovered_rows(pages, recovery):
                _write(target, table, rows, recovery)
            _name_runs(target)
            target.execute("INSERT OR IGNORE INTO journal VALUES (?, ?)", (FORMAT, VERSION))
            (version,) = target.execute("SELECT min(version) FROM journal").fetchone()
            if version < FIRST_CHAINED:
                target.executescript("".join(f"DROP TABLE {table.name};" for table in OF_CHAINS))
    except (OSError, ValueError, sqlite3.Error) as problem:
        raise InputError(
            f"journal {damaged}: cannot be recovered: {problem} (expected disk space beside the output)"
        ) from problem
    if not recovery.rows:
        raise InputError(f"journal {damaged}: no readable row in {recovery.pages} pages (use its backup)")
    return recovery


# Writing -------------------------------------------------------------------------------------------------------------


def _create(target: sqlite3.Connection) -> None:
    target.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    target.execute("PRAGMA synchronous = OFF")  # temporary, for the export only
    for table in METADATA.sorted_tables:
        target.execute(str(CreateTable(table).compile(dialect=dialect.dialect())))


def _write(target: sqlite3.Connection, table: JournalTable, rows: Sequence[Record], recovery: Recovery) -> None:
    """Insert rows; existing ones stay, since a table's own tree comes first."""
    places = ", ".join("?" * len(table.columns))
    target.execute("BEGIN")
    before = target.total_changes
    target.executemany(f"INSERT OR IGNORE INTO {table.name} VALUES ({places})", rows)
    recovery.rows[table.name] = recovery.rows.get(table.name, 0) + target.total_changes - before
    target.execute("COMMIT")


def _name_runs(target: sqlite3.Connection) -> None:
    """Add a substitute record for each run whose own is lost."""
    events = " UNION ALL ".join(f"SELECT run, ticks FROM {table.name}" for table in EVENTS)
    query = f"SELECT run, min(ticks) FROM ({events}) WHERE run NOT IN (SELECT run FROM runs) GROUP BY run"
    blank = {column.name: "" for column in RUNS.columns} | {"ended_ticks": None, "seed": None, "settings": "{}"}
    for run, ticks in target.execute(query).fetchall():
        record = blank | {"run": run, "uuid": f"lost-{run}", "started_ticks": ticks, "pid": 0, "buffers": 1}
        places = ", ".join("?" * len(record))
        target.execute(f"INSERT INTO runs VALUES ({places})", tuple(record.values()))


# Tables --------------------------------------------------------------------------------------------------------------


def _recovered_rows(pages: "_Pages", recovery: Recovery) -> "Iterator[tuple[JournalTable, list[Record]]]":
    """Rows by table: first from the tables' trees, then from other pages."""
    visited: set[int] = set()
    gathered: dict[str, list[Record]] = {}
    roots = _roots(pages, recovery)
    trees = [(METADATA.tables.get(name), root) for name, root in roots]
    for table, root in sorted(trees, key=lambda tree: tree[0] is None):
        for number in _tree(pages, root, visited, recovery):
            if table is not None:
                yield from _rows(pages, number, [table], gathered, recovery)
    for number in range(2, pages.count + 1):
        if number not in visited:
            yield from _rows(pages, number, list(METADATA.tables.values()), gathered, recovery)
    recovery.pages = pages.count
    for name, rows in gathered.items():
        if rows:
            yield METADATA.tables[name], rows


def _rows(
    pages: "_Pages", number: int, tables: "list[JournalTable]", gathered: dict[str, list[Record]], recovery: Recovery
) -> "Iterator[tuple[JournalTable, list[Record]]]":
    """Collect a page's rows; yield a table's when there are many."""
    alone = len(tables) == 1
    for kind, rowid, record in pages.records(number, recovery if alone else None):
        table, row = _fitting(tables, kind, rowid, record)
        if table is None:
            recovery.lost += alone
            continue
        gathered.setdefault(table.name, []).append(row)
        if len(gathered[table.name]) >= TOGETHER:
            yield table, gathered.pop(table.name)


def _fitting(
    tables: "list[JournalTable]", kind: int, rowid: int | None, record: Record
) -> "tuple[JournalTable | None, Record]":
    """Table whose columns match a record's cells, and its row; else None."""
    for table in tables:
        if (kind == LEAF_TABLE) != _has_rowid(table) or len(record) != len(table.columns):
            continue
        row = record
        if rowid is not None and record[:1] == (None,):  # an integer primary key is the row's number itself
            row = (rowid, *record[1:])
        if all(isinstance(cell, kinds) for cell, kinds in zip(row, cell_kinds(table), strict=True)):
            return table, row
    return None, record


def _has_rowid(table: JournalTable) -> bool:
    return table.dialect_options["sqlite"]["with_rowid"] is not False


def _roots(pages: "_Pages", recovery: Recovery) -> list[tuple[str, int]]:
    """Name and root page of each tree in the schema, if readable."""
    roots = []
    for number in _tree(pages, 1, set(), recovery):
        for kind, _, record in pages.records(number, recovery):
            if kind == LEAF_TABLE and len(record) == 5 and isinstance(record[3], int) and record[3] > 0:
                roots.append((str(record[1]), record[3]))
    return roots


def _tree(pages: "_Pages", root: int, visited: set[int], recovery: Recovery) -> Iterator[int]:
    """Existing pages of a tree, each once."""
    ahead = [root]
    while ahead:
        number = ahead.pop()
        if number in visited:
            continue
        visited.add(number)
        if not pages.has(number):
            recovery.missing += 1
            continue
        yield number
        ahead += pages.children(number)


# Pages ---------------------------------------------------------------------------------------------------------------


@contextmanager
def _pages(path: Path) -> "Iterator[_Pages]":
    """Pages of a file, with those in its log."""
    log = Path(f"{path}-wal")
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        if log.exists() and log.stat().st_size > LOG_HEADER:
            with log.open("rb") as second, mmap.mmap(second.fileno(), 0, access=mmap.ACCESS_READ) as frames:
                yield _Pages(raw, frames)
        else:
            yield _Pages(raw, None)


class _Pages:
    """Pages by number, from 1; a cut page is missing."""

    def __init__(self, raw: mmap.mmap, log: mmap.mmap | None):
        size = 0
        if len(raw) >= HEADER and raw[: len(MAGIC)] == MAGIC:
            (size,) = struct.unpack(">H", raw[16:18])
        size = 65_536 if size == 1 else size
        valid = size in SIZES
        self.size = size if valid else USUAL_PAGE
        self.usable = self.size - (raw[20] if valid and raw[20] <= 32 else 0)
        self._raw, self._log = raw, log
        self._logged = {} if log is None else _logged(log, self.size)
        self.count = max(len(raw) // self.size, max(self._logged, default=0))

    def has(self, number: int) -> bool:
        return number in self._logged or 1 <= number <= len(self._raw) // self.size

    def page(self, number: int) -> bytes:
        if number in self._logged and self._log is not None:
            at = self._logged[number]
            return self._log[at : at + self.size]
        if not self.has(number):
            raise _Damaged
        return self._raw[(number - 1) * self.size : number * self.size]

    def children(self, number: int) -> list[int]:
        """Pages below an interior one."""
        page, at = self.page(number), HEADER * (number == 1)
        if page[at] not in (INTERIOR_INDEX, INTERIOR_TABLE):
            return []
        cells = [cell for cell in _pointers(page, at) if cell + 4 <= len(page)]
        return [_u32(page, cell) for cell in cells] + [_u32(page, at + 8)]

    def records(self, number: int, recovery: Recovery | None) -> Iterator[tuple[int, int | None, Record]]:
        """Records on a page: kind of page, row's number if any, cells."""
        if not self.has(number):
            return
        page, at = self.page(number), HEADER * (number == 1)
        kind = page[at]
        if kind not in (INTERIOR_INDEX, LEAF_INDEX, LEAF_TABLE):
            return
        for cell in _pointers(page, at):
            try:
                yield kind, *self._record(page, cell, kind)
            except (_Damaged, IndexError, struct.error, UnicodeDecodeError):
                if recovery is not None:
                    recovery.lost += 1

    def _record(self, page: bytes, at: int, kind: int) -> tuple[int | None, Record]:
        if kind == INTERIOR_INDEX:
            at += 4
        size, at = _varint(page, at)
        rowid = None
        if kind == LEAF_TABLE:
            rowid, at = _varint(page, at)
        if not 0 < size <= MOST_CELL:
            raise _Damaged
        return rowid, _cells(self._payload(page, at, size, kind))

    def _payload(self, page: bytes, at: int, size: int, kind: int) -> bytes:
        """Bytes of a record, including overflow pages."""
        most = self.usable - 35 if kind == LEAF_TABLE else (self.usable - 12) * 64 // 255 - 23
        if size <= most:
            return _cut(page, at, size)
        least = (self.usable - 12) * 32 // 255 - 23
        local = least + (size - least) % (self.usable - 4)
        local = local if local <= most else least
        parts, remaining = [_cut(page, at, local)], size - local
        following, visited = _u32(page, at + local), set[int]()
        while remaining > 0:
            if following in visited or not self.has(following):
                raise _Damaged
            visited.add(following)
            more = self.page(following)
            parts.append(_cut(more, 4, min(remaining, self.usable - 4)))
            remaining -= len(parts[-1])
            following = _u32(more, 0)
        return b"".join(parts)


def _pointers(page: bytes, at: int) -> list[int]:
    """Offsets of a page's cells."""
    first = at + (12 if page[at] in (INTERIOR_INDEX, INTERIOR_TABLE) else 8)
    count = min(struct.unpack_from(">H", page, at + 3)[0], (len(page) - first) // 2)
    return [cell for cell in struct.unpack_from(f">{count}H", page, first) if first <= cell < len(page)]


def _cells(payload: bytes) -> Record:
    """Cells of a record.

    Raises _Damaged, UnicodeDecodeError.
    """
    size, at = _varint(payload, 0)
    kinds = []
    while at < size:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    if at != size:
        raise _Damaged
    cells: list[object] = []
    for kind in kinds:
        cell, at = _cell(payload, at, kind)
        cells.append(cell)
    if at != len(payload):
        raise _Damaged
    return tuple(cells)


def _cell(payload: bytes, at: int, kind: int) -> tuple[object, int]:
    if kind == 0:
        return None, at
    if kind in WIDTHS:
        width = WIDTHS[kind]
        return int.from_bytes(_cut(payload, at, width), "big", signed=True), at + width
    if kind == 7:
        return struct.unpack(">d", _cut(payload, at, 8))[0], at + 8
    if kind in (8, 9):
        return kind - 8, at
    if kind < 12:
        raise _Damaged
    width = (kind - 12) // 2
    raw = _cut(payload, at, width)
    return (raw.decode("utf-8") if kind % 2 else raw), at + width


def _cut(raw: bytes, at: int, size: int) -> bytes:
    if at + size > len(raw):
        raise _Damaged
    return raw[at : at + size]


def _u32(raw: bytes, at: int) -> int:
    return int(struct.unpack_from(">I", raw, at)[0])


def _varint(raw: bytes, at: int) -> tuple[int, int]:
    """A number of one to nine bytes, and the offset after it."""
    value = 0
    for k in range(8):
        byte = raw[at + k]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + k + 1
    value = value << 8 | raw[at + 8]
    return value - (1 << 64 if value >= 1 << 63 else 0), at + 9


# Log -----------------------------------------------------------------------------------------------------------------


def _logged(log: mmap.mmap, size: int) -> dict[int, int]:
    """Offset of each page in a log, by its last complete transaction.

    An invalid frame ends the log.
    """
    magic, _, page_size, _, *salts = struct.unpack_from(">6I", log, 0)
    if magic not in LOG_MAGIC or page_size != size:
        return {}
    words = ">" if magic == LOG_MAGIC[1] else "<"
    sums = _sums(words, log[:24], (0, 0))
    if sums != struct.unpack_from(">2I", log, 24):
        return {}
    pages: dict[int, int] = {}
    pending: dict[int, int] = {}
    for at in range(LOG_HEADER, len(log) - FRAME_HEADER - size + 1, FRAME_HEADER + size):
        number, commit, *frame_salts = struct.unpack_from(">4I", log, at)
        sums = _sums(words, log[at : at + 8], sums)
        sums = _sums(words, log[at + FRAME_HEADER : at + FRAME_HEADER + size], sums)
        if frame_salts != salts or sums != struct.unpack_from(">2I", log, at + 16):
            break
        pending[number] = at + FRAME_HEADER
        if commit:
            pages |= pending
            pending.clear()
    return pages


def _sums(words: str, raw: bytes, sums: tuple[int, int]) -> tuple[int, int]:
    """Running checksum of the log."""
    one, two = sums
    for a, b in struct.iter_unpack(f"{words}2I", raw):
        one = (one + a + two) & 0xFFFFFFFF
        two = (two + b + one) & 0xFFFFFFFF
    return one, two
