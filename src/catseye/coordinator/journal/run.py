"""Start of a run in a journal: its record and files."""

import json
import os
import platform
import socket
from hashlib import sha256

import numpy as np
from sqlalchemy import Connection, insert, select

from catseye.coordinator.journal.chain import LinkKind, run_link
from catseye.coordinator.journal.entries import Run, plain
from catseye.coordinator.journal.place import JournalAddress, reading_engine, writing_engine
from catseye.coordinator.journal.tables import CHAIN, PARTS, RUN_FILES, RUNS, TEXTS, create_or_convert, version_of
from catseye.coordinator.parts import Clock, ticks_now
from catseye.errors import InputError
from catseye.version import __version__

OURS = 4_276_994  # advisory lock of the server: two hosts may start at once


def begin(place: JournalAddress, run: Run, clock: Clock, *, buffers: bool) -> tuple[int, bytes]:
    """Create tables if needed, the run's record and files; number and first link.

    In one transaction.

    buffers   True if samples will be stored
    """
    settings = json.dumps(plain(dict(run.settings), "settings"), sort_keys=True, allow_nan=False)
    files = {path: (sha256(text.encode()).hexdigest(), text) for path, text in run.files().items()}
    _look_first(place)
    engine = writing_engine(place, create=True)
    with engine.begin() as connection:
        if connection.dialect.name == "postgresql":
            connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({OURS})")
        create_or_convert(connection, place.shown)
        stored = set(
            connection.scalars(select(TEXTS.c.sha256).where(TEXTS.c.sha256.in_([f[0] for f in files.values()])))
        )
        fresh = {digest: text for digest, text in files.values() if digest not in stored}
        if fresh:
            connection.execute(insert(TEXTS), [{"sha256": digest, "text": text} for digest, text in fresh.items()])
        inserted = connection.execute(
            insert(RUNS).values(
                uuid=run.uuid,
                started_ticks=ticks_now(clock),
                site=run.site.site.campaign.name,
                seed=run.seed,
                settings=settings,
                host=socket.gethostname(),
                pid=os.getpid(),
                catseye=__version__,
                python=platform.python_version(),
                numpy=np.__version__,
                buffers=buffers,
            )
        )
        number = int(inserted.inserted_primary_key[0])  # type: ignore[index]
        rows = [{"run": number, "path": path, "sha256": digest} for path, (digest, _) in files.items()]
        connection.execute(insert(RUN_FILES), rows)
        link = run_link(connection, number)
        connection.execute(insert(CHAIN).values(run=number, seq=0, kind=LinkKind.RUN.value, link=link))
    return number, link


def _look_first(place: JournalAddress) -> None:
    """Refuse a foreign file before it is opened for writing, and one with triggers.

    A trigger could alter or drop entries that are reported as durable.
    """
    if place.path is not None and place.path.exists() and place.path.stat().st_size:
        with reading_engine(place).connect() as connection:
            version_of(connection, place.shown)
            name = connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'trigger'").scalar()
            if name is not None:
                raise InputError(
                    f"journal {place.shown}: has a trigger, {str(name)[:40]!a}, which catseye never makes (expected "
                    "another file)"
                )


def go_on(old: Connection, place: JournalAddress, run: int, *, seq: int, link: bytes, follows: str) -> None:
    """Continue a run in the next file: record and files again, and the link.

    old         connection to the file so far
    seq, link   of its last link
    follows     the file so far

    Raises SQLAlchemyError, InputError: the file cannot be created.
    """
    record = dict(old.execute(select(RUNS).where(RUNS.c.run == run)).mappings().one())
    files = [dict(row) for row in old.execute(select(RUN_FILES).where(RUN_FILES.c.run == run)).mappings()]
    digests = {file["sha256"] for file in files}
    texts = [dict(row) for row in old.execute(select(TEXTS).where(TEXTS.c.sha256.in_(digests))).mappings()]
    with writing_engine(place, create=True).begin() as connection:
        create_or_convert(connection, place.shown)
        for table, rows in ((RUNS, [record]), (TEXTS, texts), (RUN_FILES, files)):
            if rows:
                connection.execute(insert(table), rows)
        links = [(0, LinkKind.RUN, run_link(connection, run)), (seq, LinkKind.PART, link)]
        rows = [{"run": run, "seq": at, "kind": kind.value, "link": link_value} for at, kind, link_value in links]
        connection.execute(insert(CHAIN), rows)
        connection.execute(insert(PARTS).values(run=run, follows=follows))
