"""Journal writer: entries in order, durable, in a thread of its own.

One commit holds the entries of some ms; an `append` is one transaction. If the database fails (disk full, server
down), an alarm is raised, entries are queued, and writing is retried until it succeeds: the reduction's input is
journalled exactly once.
"""

import asyncio
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from sqlalchemy import Connection, Engine, insert, update
from sqlalchemy.exc import DataError, IntegrityError, SQLAlchemyError

from catseye.coordinator.journal.chain import Head, LinkKind, event_cells, link_of
from catseye.coordinator.journal.entries import Item, Run
from catseye.coordinator.journal.place import (
    JournalAddress,
    WriterLock,
    bytes_of,
    fold,
    identity,
    next_place,
    place_of,
    refuse_foreign,
    refused,
    writing_engine,
)
from catseye.coordinator.journal.protocol import NotDurable
from catseye.coordinator.journal.rows import PACKED, RAW, Row, Rows, pack, rows_of
from catseye.coordinator.journal.run import begin, go_on
from catseye.coordinator.journal.tables import CHAIN, METADATA, PARTS, RUNS, SOLUTIONS, JournalTable, insertion
from catseye.coordinator.parts import Clock, ticks_now
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY

MOST_ROWS = 512  # rows of one commit
MOST_WAITING = 20_000  # rows queued
MOST_BYTES = 256 * 2**20  # of samples queued
PATIENCE = 2.0  # s of trouble after which futures fail
FIRST_WAIT, LONGEST_WAIT = 0.05, 2.0  # s of back-off between retries
LOOK, RETRY_ROTATION = (
    1.0,
    600.0,
)  # s between two checks of the file's size, and until a failed rotation is retried
LONGEST_DURABLE = 10.0  # s, timeout of `durable`: a server may hang silently

Tell = Callable[[str], None]
_Callbacks = tuple[
    Tell | None, Tell | None, Callable[[Head], None] | None
]  # callbacks of an alarm, of its end, of a head


@dataclass(frozen=True)
class JournalSettings:
    """Settings of a run's writer.

    group          s that a commit waits for more
    keep_buffers   store samples: without them a replay has only the rangers' amplitudes and phases
    compress       samples in half the space for 0.2 ms each
    patience       s of trouble after which the futures of queued entries fail; they stay queued all the same
    rotate_bytes   size at which the run continues in another file; 0: none
    rotate_nightly True to rotate at noon UTC, too
    """

    group: float = 0.001
    keep_buffers: bool = True
    compress: bool = False
    patience: float = PATIENCE
    rotate_bytes: int = 0
    rotate_nightly: bool = False


@dataclass(eq=False)
class Batch:
    """Rows of one append, including seq, for one transaction."""

    rows: Rows
    size: int  # bytes of samples
    future: "Future[int]" = field(default_factory=Future)
    last: int = 0  # seq of its last entry
    refused: InputError | None = None  # error of the database: its numbers are chained, nothing else is stored
    since: float = field(default_factory=time.monotonic)

    def fail(self, problem: InputError) -> None:
        if not self.future.done():
            self.future.set_exception(problem)

    def done(self, seq: int) -> None:
        if not self.future.done():
            self.future.set_result(seq)


class Journal:
    """Writer of one run; created by `open`.

    run      its number in this journal
    place    where it is, for people
    """

    def __init__(
        self,
        place: JournalAddress,
        engine: Engine,
        lock: WriterLock,
        start: tuple[int, bytes],
        *,
        clock: Clock,
        settings: JournalSettings,
        callbacks: _Callbacks,
    ):
        (self.run, first), self.place = start, place.shown
        self._last = 0, first  # seq and hash of the last durable link: one object, read by other threads
        self._where, self._engine, self._lock = place, engine, lock
        self._clock, self._settings = clock, settings
        self._packing = PACKED if settings.compress else RAW
        self._on_alarm, self._on_recovery, self._on_head = callbacks
        self._wake = threading.Condition()
        self._queue: deque[Batch] = deque()
        self._waiting = self._bytes = self._seq = 0
        self._closing = False
        self._give_up = float("inf")
        self._trouble: str | None = None
        self._busy_since: float | None = None
        self._connection: Connection | None = None
        self._inserts = {table.name: insertion(table, engine.dialect) for table in METADATA.tables.values()}
        self._file = identity(place)
        self._night, self._look_at = self._current_night(), 0.0
        self._held: str | None = None
        self._thread = threading.Thread(target=self._work, name="journal", daemon=True)
        self._thread.start()

    @classmethod
    def open(
        cls,
        url: str | Path,
        *,
        run: Run,
        clock: Clock,
        settings: JournalSettings | None = None,
        on_alarm: Tell | None = None,
        on_recovery: Tell | None = None,
        on_head: Callable[[Head], None] | None = None,
    ) -> "Journal":
        """Create or convert the journal at a place, and begin a run in it.

        url            a file, or postgresql://USER@HOST/DATABASE
        on_alarm       called once, from the journal's thread, with the reason when writing fails
        on_recovery    called when it works again
        on_head        called with the chain's head when an epoch's solution is durable, and at the end: a copy kept
                       elsewhere authenticates everything before it

        Raises InputError: a bad place, a foreign file or database, a newer journal, one that cannot be written, a file
        that has a writer.
        """
        place, settings = place_of(url), settings or JournalSettings()
        refuse_foreign(place, fresh=True)
        if settings.rotate_bytes or settings.rotate_nightly:
            next_place(place)  # refuses a server
        lock = WriterLock(place)
        try:
            start = begin(place, run, clock, buffers=settings.keep_buffers)
            engine = writing_engine(place)
        except SQLAlchemyError as problem:
            lock.release()
            raise refused(place, problem) from problem
        except InputError:
            lock.release()
            raise
        return cls(
            place,
            engine,
            lock,
            start,
            clock=clock,
            settings=settings,
            callbacks=(on_alarm, on_recovery, on_head),
        )

    @property
    def head(self) -> Head:
        """The last durable link of the chain."""
        return Head.of(*self._last)

    @property
    def trouble(self) -> str | None:
        """Reason why writing fails at present; else None.

        No shots should be taken meanwhile.
        """
        since = self._busy_since
        if self._trouble is None and self._held is not None:
            return self._held
        if self._trouble is None and since is not None and time.monotonic() - since > self._settings.patience:
            return f"journal {self.place}: no answer for {time.monotonic() - since:.0f} s"
        return self._trouble

    @property
    def address(self) -> JournalAddress:
        """Present location of the journal."""
        return self._where

    def hold(self, why: str | None) -> None:
        """Ask for no more measurements, with the reason, or for more again (None).

        Entries received are still written.
        """
        self._held = why

    def append(self, *items: Item) -> "Future[int]":
        """Queue entries, in order; the future has the last one's seq once durable.

        items   none: done when all before are durable

        Any thread; never waits. The future fails with InputError if the entries are refused (a duplicate shot), and
        with NotDurable if trouble lasts: then they stay queued.

        Raises InputError: not an entry, a full queue, a closed journal; then nothing was queued.
        """
        sets = [rows_of(item, self._settings.keep_buffers) for item in items]
        rows = [row for rows in sets for row in rows]
        size = sum(samples.nbytes for _, row in rows if isinstance(samples := row.get("samples"), np.ndarray))
        batch = Batch(rows, size)
        batch.future.set_running_or_notify_cancel()  # no longer cancellable
        with self._wake:
            if self._closing:
                raise InputError(f"journal {self.place}: is closed")
            if self._waiting + len(rows) > MOST_WAITING or self._bytes + size > MOST_BYTES:
                why = self._trouble or "it cannot keep up"
                raise InputError(
                    f"{self._waiting} rows are queued for the journal (expected at most {MOST_WAITING}): {why}"
                )
            for seq, entry in enumerate(sets, start=self._seq + 1):
                for _, row in entry:
                    row["run"], row["seq"] = self.run, seq
            self._seq += len(sets)
            batch.last = self._seq
            self._waiting += len(rows)
            self._bytes += size
            self._queue.append(batch)
            if len(self._queue) == 1 or self._waiting >= MOST_ROWS:
                self._wake.notify()
        return batch.future

    async def durable(self, *items: Item) -> None:
        """Append and wait until it is durable; InputError after 10 s."""
        try:
            await asyncio.wait_for(asyncio.wrap_future(self.append(*items)), LONGEST_DURABLE)
        except TimeoutError:
            raise InputError(f"journal {self.place}: not durable after {LONGEST_DURABLE:g} s") from None

    def close(self, timeout: float = 5.0) -> None:
        """Write the queue, end the run, release the lock.

        Entries not written within the time are given up.

        Raises InputError if entries were given up.
        """
        with self._wake:
            self._closing = True
            self._give_up = min(self._give_up, time.monotonic() + timeout)
            self._wake.notify()
        self._thread.join(timeout + 2.0 * LONGEST_WAIT)
        if not self._thread.is_alive():
            self._lock.release()
        if self._waiting:
            raise InputError(f"journal {self.place}: closed with {self._waiting} rows not written: {self.trouble}")

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _work(self) -> None:
        """Thread: write groups until closed; all futures end."""
        try:
            while batches := self._next_group():
                self._persist(batches)
                self._rotate()
                with self._wake:
                    self._busy_since = None
            self._end()
        finally:
            with self._wake:
                self._closing = True
                remaining = list(self._queue)
            for batch in remaining:
                batch.fail(InputError(f"journal {self.place}: ended before this was durable"))
            self._disconnect()

    def _next_group(self) -> list[Batch]:
        """Next group, still counted as queued; empty when closed and done."""
        with self._wake:
            while not self._queue and not self._closing:
                self._wake.wait()
            if not self._queue:
                return []
            full_at = self._queue[0].since + self._settings.group
            while not self._closing and self._waiting < MOST_ROWS and (timeout_s := full_at - time.monotonic()) > 0.0:
                self._wake.wait(timeout_s)
            batches: list[Batch] = []
            rows = 0
            while self._queue and (not batches or rows + len(self._queue[0].rows) <= MOST_ROWS):
                batches.append(self._queue.popleft())
                rows += len(batches[-1].rows)
            self._busy_since = time.monotonic()
            return batches

    def _persist(self, batches: list[Batch]) -> None:
        """Write until it succeeds: one alarm, retries with back-off."""
        wait, start = FIRST_WAIT, time.monotonic()
        while True:
            try:
                self._store(batches)
            except (IntegrityError, DataError) as problem:
                self._disconnect()
                self._sift(batches, problem)
                return
            except (SQLAlchemyError, InputError) as problem:
                self._disconnect()
                why = problem if isinstance(problem, InputError) else refused(self._where, problem)
                self._in_trouble(str(why))
            else:
                break
            if time.monotonic() - start >= self._settings.patience or self._closing:
                self._fail_waiting(batches)
            if not self._paused(wait):
                return
            wait = min(2.0 * wait, LONGEST_WAIT)
        self._acknowledge(batches)

    def _store(self, batches: Sequence[Batch]) -> None:
        """Write some entries in one transaction."""
        rows: dict[str, list[Row]] = defaultdict(list)
        linked, link = self._last
        for batch in batches:
            events: dict[int, list[tuple[JournalTable, Row]]] = defaultdict(list)
            for table, row in batch.rows:
                samples, lag = row.get("samples"), row.pop("lag", None)
                if isinstance(samples, np.ndarray) and isinstance(lag, int):
                    row |= pack(samples, max(1, lag), self._packing)
                if batch.refused is None:
                    rows[table].append(row)
                events[int(str(row["seq"]))].append((METADATA.tables[table], row))
            kind = LinkKind.EVENT if batch.refused is None else LinkKind.REFUSED
            for linked, stored in events.items():
                link = link_of(link, kind, linked, event_cells(stored) if batch.refused is None else ())
                rows[CHAIN.name].append({"run": self.run, "seq": linked, "kind": kind.value, "link": link})
        if self._connection is None:
            self._connection = self._engine.connect()
        with self._connection.begin():
            for table in sorted(rows, reverse=True):  # in any fixed order
                self._connection.execute(self._inserts[table], rows[table])
        if identity(self._where) != self._file:
            raise InputError(f"journal {self.place}: the file was moved or removed (restore it, or restart)")
        self._last = linked, link

    def _current_night(self) -> int:
        """Number of the night, which changes at noon UTC."""
        return int(ticks_now(self._clock) / TICKS_PER_DAY + 0.5)

    def _rotate(self) -> None:
        """Continue in another file if due; stay, with an alarm, if impossible."""
        rules, time_s = self._settings, time.monotonic()
        if not (rules.rotate_bytes or rules.rotate_nightly) or time_s < self._look_at or self._connection is None:
            return
        self._look_at = time_s + LOOK
        night = self._current_night()
        full = rules.rotate_bytes and bytes_of(self._where) >= rules.rotate_bytes
        if not full and not (rules.rotate_nightly and night != self._night):
            return
        old = self._where
        assert old.path is not None
        try:
            new = next_place(old)
            lock = WriterLock(new)
            try:
                with self._connection.begin():
                    linked, link = self._last
                    go_on(self._connection, new, self.run, seq=linked, link=link, follows=old.path.name)
                    row = {"run": self.run, "follows": None, "followed_by": Path(str(new.path)).name}
                    updated = self._connection.execute(
                        update(PARTS).where(PARTS.c.run == self.run).values(followed_by=row["followed_by"])
                    )
                    if not updated.rowcount:
                        self._connection.execute(insert(PARTS).values(row))
                engine = writing_engine(new)
            except (SQLAlchemyError, InputError):
                lock.release()
                raise
        except (SQLAlchemyError, InputError) as problem:
            self._look_at = time_s + RETRY_ROTATION
            if self._on_alarm is not None:
                why = problem if isinstance(problem, InputError) else refused(old, problem)
                self._on_alarm(f"{why}: the journal continues in {old.shown} (retry in {RETRY_ROTATION / 60:.0f} min)")
            return
        fold(old, self._connection)
        self._disconnect()
        self._lock.release()
        self._where, self.place, self._engine, self._lock = new, new.shown, engine, lock
        self._file, self._night = identity(new), night
        if self._on_recovery is not None:
            self._on_recovery(f"the run continues in {new.shown}, head {self.head}")

    def _sift(self, batches: list[Batch], problem: IntegrityError | DataError) -> None:
        """Write a refused group one by one.

        Futures of entries refused then fail.
        """
        if len(batches) > 1:
            for batch in batches:
                self._persist([batch])
            return
        text = f"{refused(self._where, problem)}: refused (expected unique shots: ranger, time, target)"
        if batches[0].refused is not None:  # even its numbers are refused: the run's record is missing
            batches[0].fail(InputError(text))
            self._forget(batches)
            return
        batches[0].refused = InputError(text)
        self._persist(batches)

    def _acknowledge(self, batches: list[Batch]) -> None:
        self._forget(batches)
        if self._trouble is not None:
            self._trouble = None
            if self._on_recovery is not None:
                self._on_recovery(f"journal {self.place}: writing works again, the queue is written")
        for batch in batches:
            if batch.refused is not None:
                batch.fail(batch.refused)
            batch.done(batch.last if batch.rows else self._seq)
        if self._on_head is not None and any(t == SOLUTIONS.name for batch in batches for t, _ in batch.rows):
            self._on_head(self.head)

    def _forget(self, batches: list[Batch]) -> None:
        with self._wake:
            self._waiting -= sum(len(batch.rows) for batch in batches)
            self._bytes -= sum(batch.size for batch in batches)

    def _in_trouble(self, text: str) -> None:
        first, self._trouble = self._trouble is None, text
        if first and self._on_alarm is not None:
            self._on_alarm(f"{text}: writing failed, retrying; no shots are taken meanwhile")

    def _fail_waiting(self, batches: list[Batch]) -> None:
        with self._wake:
            waiting = [*batches, *self._queue]
        for batch in waiting:
            batch.fail(NotDurable(f"{self._trouble}: not durable yet; queued for retry"))

    def _paused(self, seconds: float) -> bool:
        """Wait before a retry; False if the journal is being closed."""
        until = time.monotonic() + seconds
        with self._wake:
            while (timeout_s := min(until, self._give_up) - time.monotonic()) > 0.0:
                self._wake.wait(timeout_s)
            return time.monotonic() < self._give_up

    def _end(self) -> None:
        """Write the run's end.

        A file becomes a single file again, without its log, if nobody else has it open.
        """
        with suppress(SQLAlchemyError):
            if self._connection is None:
                self._connection = self._engine.connect()
            ended_ticks, (linked, before) = ticks_now(self._clock), self._last
            seq, link = linked + 1, link_of(before, LinkKind.END, linked + 1, [ended_ticks])
            with self._connection.begin():
                self._connection.execute(update(RUNS).where(RUNS.c.run == self.run).values(ended_ticks=ended_ticks))
                row = {"run": self.run, "seq": seq, "kind": LinkKind.END.value, "link": link}
                self._connection.execute(self._inserts[CHAIN.name], row)
            self._last = seq, link
            fold(self._where, self._connection)
            if self._on_head is not None:
                self._on_head(self.head)

    def _disconnect(self) -> None:
        if self._connection is not None:
            with suppress(SQLAlchemyError):
                self._connection.invalidate()
            with suppress(SQLAlchemyError):
                self._connection.close()
            self._connection = None
