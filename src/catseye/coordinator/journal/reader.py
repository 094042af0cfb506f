"""Journal reader: runs and their events, in order, read-only."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from sqlalchemy import Connection, Engine, Select, inspect, select
from sqlalchemy.exc import SQLAlchemyError

from catseye.coordinator.journal.cells import check_cells, damaged, json_object
from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.coordinator.journal.place import bytes_of, place_of, reading_engine, refuse_foreign, refused
from catseye.coordinator.journal.rows import LARGEST_INTEGER, StoredRow, entry_of, unpack
from catseye.coordinator.journal.tables import (
    BUFFERS,
    EVENTS,
    PARTS,
    RUN_FILES,
    RUNS,
    SHOTS,
    TEXTS,
    JournalTable,
    version_of,
)
from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder, read_site

LINK_BYTES = 40  # minimum of a row of the chain
PIECE = 512  # events read at once: 8 MB if each is a buffer
Kind = Literal["shots", "weather", "postures", "commands", "happenings", "solutions", "documents"]


@dataclass(frozen=True, eq=False)
class StoredRun:
    """Record of one run.

    run          its number in the journal, from 1
    started, ended   ticks; `ended` None while it runs, and for ever if it was killed
    settings     of the coordinator
    versions     of catseye, python, numpy
    buffers      True if samples were stored
    hashes       SHA-256 of its files by relative path
    """

    run: int
    uuid: str
    started: int
    ended: int | None
    site: str
    seed: int | None
    settings: dict[str, object]
    host: str
    pid: int
    versions: dict[str, str]
    buffers: bool
    hashes: dict[str, str]


class JournalReader:
    """Reader of a journal, also while it is written.

    url   a file, or postgresql://USER@HOST/DATABASE

    Raises InputError: no journal there, a newer one, an unreadable one.
    """

    def __init__(self, url: str | Path):
        self._where = place_of(url)
        self.place = self._where.shown
        refuse_foreign(self._where, fresh=False)
        self._engine: Engine = reading_engine(self._where)
        self._folders: list[TemporaryDirectory[str]] = []
        self._other_parts: dict[str, JournalReader] = {}
        self.left_out: Mapping[int, Collection[int]] = {}  # by run: events skipped because they fail verification
        self.alone = False  # True to ignore files before and after this one
        with self.reading() as connection:
            self.version = version_of(connection, self.place)
            self.tables = frozenset(inspect(connection).get_table_names())
            if self.version == 0:
                raise InputError(f"journal {self.place}: is not a journal: it has no tables (expected one)")

    def __repr__(self) -> str:
        return f"<Journal {self.place}: {len(self.runs())} runs>"

    def runs(self) -> tuple[StoredRun, ...]:
        """All runs of the journal, oldest first."""
        with self.reading() as connection:
            files: dict[int, dict[str, str]] = {}
            for row in connection.execute(select(RUN_FILES).order_by(RUN_FILES.c.path)):
                check_cells(RUN_FILES, row, f"journal {self.place}")
                files.setdefault(row.run, {})[row.path] = row.sha256
            runs = []
            for row in connection.execute(select(RUNS).order_by(RUNS.c.run)):
                check_cells(RUNS, row, f"journal {self.place}: run {row.run}")
                runs.append(_stored(row, files.get(row.run, {}), self.place))
            return tuple(runs)

    def run(self, which: int | str | None = None) -> StoredRun:
        """One run: by number, by its uuid or the beginning of it, or the last.

        Raises InputError if there is none, or more than one.
        """
        runs = self.runs()
        matching = runs[-1:] if which is None else tuple(run for run in runs if _is(run, which))
        if len(matching) != 1:
            contents = f"runs 1 to {runs[-1].run}" if runs else "no runs"
            raise InputError(f"journal {self.place}: run {which!r} names {len(matching)} runs (it contains {contents})")
        return matching[0]

    def events(
        self,
        run: int,
        after: int = 0,
        *,
        until: int | None = None,
        kinds: Sequence[Kind] | None = None,
        buffers: bool = True,
    ) -> Iterator[tuple[int, Entry]]:
        """Events of a run, (seq, entry), in the order of the reduction's input.

        after     seq: those after it
        until     seq: those up to it
        kinds     tables wanted; all
        buffers   True for shots with their samples, if stored

        Raises InputError for a damaged journal, after all events before the damage.
        """
        for part in self.parts(run):
            part.left_out = self.left_out
            yield from part._local_events(run, after, until, kinds=kinds, buffers=buffers)

    def _local_events(
        self, run: int, after: int, until: int | None, *, kinds: Sequence[Kind] | None, buffers: bool
    ) -> Iterator[tuple[int, Entry]]:
        """`events` of this file only."""
        tables = [table for table in EVENTS if kinds is None or table.name in kinds]
        last = self._local_last(run) if until is None else min(until, self._local_last(run))
        stops = [seq for seq in sorted(self.left_out.get(run, ())) if after < seq <= last]
        for stop in (*stops, last + 1):
            while after < stop - 1:
                upto = min(after + PIECE, stop - 1)
                piece = self._piece(run, after, upto, tables, buffers)
                yield from piece
                after = upto
                if not piece:  # there may be a large gap of numbers
                    with self.reading() as connection:
                        after = min(stop - 1, next_seq(connection, tables, run, upto) - 1)
            after = stop

    def shots(self, run: int, *, buffers: bool = True) -> Iterator[tuple[int, AnsweredShot]]:
        """Shots of a run, with their seq."""
        for seq, entry in self.events(run, kinds=["shots"], buffers=buffers):
            if isinstance(entry, AnsweredShot):
                yield seq, entry

    def solutions(self, run: int) -> Iterator[tuple[int, EpochSolution]]:
        """Solutions of a run, with their seq."""
        for seq, entry in self.events(run, kinds=["solutions"]):
            if isinstance(entry, EpochSolution):
                yield seq, entry

    def last(self, run: int) -> int:
        """Seq of a run's last event; 0 if none."""
        return max(part._local_last(run) for part in self.parts(run))

    @property
    def most_events(self) -> int:
        """Largest number of events that this file can hold.

        Each has a link of 32 bytes and its row's header.
        """
        return LARGEST_INTEGER if self._where.path is None else bytes_of(self._where) // LINK_BYTES

    def _local_last(self, run: int) -> int:
        with self.reading() as connection:
            return _last(connection, run)

    def parts(self, run: int) -> "tuple[JournalReader, ...]":
        """Files of a rotated run, in order.

        Raises InputError: one of them is missing, or is named twice.
        """
        if self.alone or self._where.path is None:
            return (self,)
        parts, names = [self], {self._where.path.name}
        while (name := parts[0]._adjacent(run, "follows", names)) is not None:
            parts.insert(0, self._part(name))
        while (name := parts[-1]._adjacent(run, "followed_by", names)) is not None:
            parts.append(self._part(name))
        return tuple(parts)

    def _adjacent(self, run: int, which: str, names: set[str]) -> str | None:
        """Name of the previous or next file, added to `names`; None if none."""
        if PARTS.name not in self.tables:
            return None
        with self.reading() as connection:
            name: object = connection.scalar(select(PARTS.c[which]).where(PARTS.c.run == run))
        if name is None:
            return None
        if not isinstance(name, str) or not name or Path(name).name != name:
            raise InputError(f"journal {self.place}: run {run} continues in {name!r} (expected a file beside it)")
        if name in names:
            raise damaged(f"journal {self.place}: the table 'parts' of run {run}", f"{name!r} twice, a circle")
        names.add(name)
        return name

    def _part(self, name: str) -> "JournalReader":
        if name not in self._other_parts:
            self._other_parts[name] = JournalReader(Path(str(self._where.path)).with_name(name))
        return self._other_parts[name]

    def files(self, run: int) -> dict[str, str]:
        """Texts of a run's files by relative path."""
        query = (
            select(RUN_FILES.c.path, TEXTS.c.text)
            .join(TEXTS, RUN_FILES.c.sha256 == TEXTS.c.sha256, isouter=True)
            .where(RUN_FILES.c.run == run)
            .order_by(RUN_FILES.c.path)
        )
        with self.reading() as connection:
            texts = {row.path: row.text for row in connection.execute(query)}
        for path, text in texts.items():
            if not isinstance(text, str):
                what = "no text" if text is None else "bytes (expected text)"
                raise damaged(f"journal {self.place}: file {path!r} of run {run}", what)
        return texts

    def site(self, run: int) -> SiteFolder:
        """Site of a run, in a temporary directory that the reader removes."""
        folder = TemporaryDirectory(prefix="catseye-site-")
        self._folders.append(folder)
        root = Path(folder.name)
        for name in ("monuments", "mirrors", "triplets"):
            (root / name).mkdir()
        for path, text in self.files(run).items():
            where = (root / path).resolve()
            if root.resolve() not in where.parents:
                raise InputError(f"journal {self.place}: run {run} has a file {path!r} outside its site")
            where.parent.mkdir(parents=True, exist_ok=True)
            where.write_text(text, encoding="utf-8", newline="")
        return read_site(root)

    def close(self) -> None:
        """Remove the temporary directories."""
        for reader in self._other_parts.values():
            reader.close()
        while self._folders:
            self._folders.pop().cleanup()

    def __enter__(self) -> "JournalReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Connection in a transaction, a snapshot of the journal.

        Raises InputError: an error of the database.
        """
        try:
            with self._engine.connect() as connection, connection.begin():
                yield connection
        except SQLAlchemyError as problem:
            raise refused(self._where, problem) from problem

    def _piece(
        self, run: int, after: int, upto: int, tables: Sequence[JournalTable], buffers: bool
    ) -> list[tuple[int, Entry]]:
        """Events after a seq and up to another, in one snapshot."""
        events: list[tuple[int, Entry]] = []
        with self.reading() as connection:
            samples: dict[int, StoredRow] = {}
            if buffers and SHOTS in tables:
                samples = {row.seq: row for row in connection.execute(_between(BUFFERS, run, after, upto))}
            for table in tables:
                for row in connection.execute(_between(table, run, after, upto)):
                    place = f"journal {self.place}: run {run}, event {row.seq}"
                    check_cells(table, row, place)
                    buffer = samples.get(row.seq) if table is SHOTS else None
                    unpacked = None
                    if buffer is not None:
                        check_cells(BUFFERS, buffer, place)
                        unpacked = unpack(buffer, max(1, row.samples_per_cycle), place)
                    try:
                        events.append((row.seq, entry_of(table.name, row, unpacked)))
                    except (ValueError, RecursionError) as problem:  # invalid JSON, a covariance of another size
                        raise damaged(f"{place}: a row of {table.name!r}", f"invalid content ({problem})") from None
        events.sort(key=lambda pair: pair[0])
        return events


def _between(table: JournalTable, run: int, after: int, upto: int) -> Select[tuple[object, ...]]:
    return select(table).where(table.c.run == run, table.c.seq > after, table.c.seq <= upto).order_by(table.c.seq)


def _last(connection: Connection, run: int) -> int:
    return max(highest_seq(connection, table, run) for table in EVENTS)


def highest_seq(connection: Connection, table: JournalTable, run: int) -> int:
    """Highest number of a run's rows in a table; 0 if none.

    Damaged ones, text and bytes, sort above all numbers.
    """
    seq = table.c.seq
    highest: object = connection.scalar(
        select(seq).where(table.c.run == run, seq <= LARGEST_INTEGER).order_by(seq.desc()).limit(1)
    )
    return int(highest) if isinstance(highest, int | float) else 0


def next_seq(connection: Connection, tables: Sequence[JournalTable], run: int, after: int) -> int:
    """Lowest number above another of a run's rows in some tables.

    Above all of them if there is none.
    """
    numbers = []
    for table in tables:
        seq = table.c.seq
        lowest: object = connection.scalar(
            select(seq).where(table.c.run == run, seq > after, seq <= LARGEST_INTEGER).order_by(seq).limit(1)
        )
        numbers.append(int(lowest) if isinstance(lowest, int | float) else LARGEST_INTEGER)
    return max(after + 1, min(numbers, default=LARGEST_INTEGER))


def _is(run: StoredRun, which: int | str) -> bool:
    return run.run == which if isinstance(which, int) else run.uuid.startswith(which)


def _stored(row: StoredRow, files: dict[str, str], place: str) -> StoredRun:
    try:
        settings = json_object(row.settings)
    except (ValueError, RecursionError) as problem:
        raise damaged(f"journal {place}: the settings of run {row.run}", f"no JSON object ({problem})") from None
    return StoredRun(
        run=row.run,
        uuid=row.uuid,
        started=row.started_ticks,
        ended=row.ended_ticks,
        site=row.site,
        seed=row.seed,
        settings=settings,
        host=row.host,
        pid=row.pid,
        versions={"catseye": row.catseye, "python": row.python, "numpy": row.numpy},
        buffers=row.buffers,
        hashes=files,
    )
