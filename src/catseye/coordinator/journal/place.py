"""Location of a journal: file or PostgreSQL; connections, writer's lock."""

import json
import os
import socket
import sqlite3
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from sqlalchemy import Connection, Engine, NullPool, create_engine, event
from sqlalchemy.engine import URL, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError

from catseye.errors import InputError

EXPECTED = "expected a file's name, sqlite:///FILE or postgresql://USER@HOST/DATABASE"
SIGNATURE = b"SQLite format 3\0"
BUSY = 5.0  # s, timeout of a statement for another process's lock
CONNECT = 5  # s
CHECKPOINT_PAGES = 512  # 4 MB: a checkpoint delays a commit by 4 ms; one of 32 MB, eight times rarer, by 25 ms


@dataclass(frozen=True)
class JournalAddress:
    """Location of a journal: `path` of a file, or `url` of a server.

    shown   for people, without a password
    """

    shown: str
    path: Path | None = None
    url: URL | None = None


def place_of(url: str | Path) -> JournalAddress:
    """Location from a URL or a file's name.

    Raises InputError for any other text.
    """
    if isinstance(url, Path) or "://" not in url:
        return JournalAddress(str(url), path=_real(Path(url)))
    try:
        parsed = make_url(url)
        backend = parsed.get_backend_name()
    except (ArgumentError, ValueError):
        raise InputError(f"journal {url.partition('://')[0]}://...: is not a URL ({EXPECTED})") from None
    if backend == "sqlite" and parsed.database and not parsed.host and parsed.database != ":memory:":
        return JournalAddress(parsed.database, path=_real(Path(parsed.database)))
    if backend in ("postgresql", "postgres") and parsed.database:
        shown = parsed.set(drivername="postgresql").render_as_string(hide_password=True)
        return JournalAddress(shown, url=parsed.set(drivername="postgresql+psycopg"))
    raise InputError(f"journal {parsed.render_as_string(hide_password=True)}: is unusable ({EXPECTED})")


def _real(path: Path) -> Path:
    """Target of a link: log, lock and other parts are beside it."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def refuse_foreign(place: JournalAddress, *, fresh: bool) -> None:
    """Refuse a file that is not SQLite.

    fresh   True if it need not exist, but its directory
    """
    if place.path is None:
        return
    try:
        if not place.path.exists():
            if fresh and place.path.absolute().parent.is_dir():
                return
            missing = f"directory {place.path.absolute().parent}" if fresh else "file"
            raise InputError(f"journal {place.shown}: {missing} is missing (expected an existing one)")
        if not place.path.is_file():
            raise InputError(f"journal {place.shown}: is not a file (expected a journal's)")
        with place.path.open("rb") as stream:
            opening = stream.read(len(SIGNATURE))
    except (OSError, ValueError) as problem:
        raise InputError(f"journal {place.shown}: is unreadable: {getattr(problem, 'strerror', problem)}") from problem
    if opening != SIGNATURE and not (fresh and not opening):
        raise InputError(
            f"journal {place.shown}: is not a journal: it starts with {opening!r} (expected a file of catseye)"
        )


def writing_engine(place: JournalAddress, *, create: bool = False) -> Engine:
    """Connections for writing, durable against power loss after each commit.

    create   True if a file may be created
    """
    if place.url is not None:
        return _server_engine(place.url)
    mode = "rwc" if create else "rw"
    engine = _file_engine(place, f"mode={mode}")

    @event.listens_for(engine, "connect")
    def durable(connection: sqlite3.Connection, _: object) -> None:
        connection.execute("PRAGMA page_size = 8192")  # of a new file
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute(f"PRAGMA wal_autocheckpoint = {CHECKPOINT_PAGES}")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        connection.exec_driver_sql("BEGIN IMMEDIATE")

    return engine


def reading_engine(place: JournalAddress) -> Engine:
    """Read-only connections, each transaction a snapshot."""
    if place.url is not None:
        return _server_engine(place.url).execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
    path = Path(str(place.path))
    immutable = not Path(f"{path}-wal").exists() and not os.access(path.absolute().parent, os.W_OK)
    engine = _file_engine(place, "mode=ro&immutable=1" if immutable else "mode=ro", text=_text_or_bytes)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        connection.exec_driver_sql("BEGIN")

    return engine


def _file_engine(place: JournalAddress, options: str, text: Callable[[bytes], str | bytes] | None = None) -> Engine:
    address = f"file:{quote(str(place.path))}?{options}"

    def connected() -> sqlite3.Connection:
        connection = sqlite3.connect(address, uri=True, timeout=BUSY, isolation_level=None, check_same_thread=False)
        if text is not None:
            connection.text_factory = text
        return connection

    return create_engine("sqlite://", creator=connected, poolclass=NullPool)


def _text_or_bytes(raw: bytes) -> str | bytes:
    """Text of a cell; its bytes if invalid UTF-8, reported by the reader."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw


def _server_engine(url: URL) -> Engine:
    options = {
        "connect_timeout": CONNECT,
        "application_name": "catseye journal",
        "keepalives_idle": 5,
        "tcp_user_timeout": 10_000,
    }
    try:
        engine = create_engine(url, poolclass=NullPool, connect_args=options)
    except ModuleNotFoundError:
        raise InputError(
            "journal postgresql://...: psycopg is not installed (expected the extra catseye[postgresql])"
        ) from None

    @event.listens_for(engine, "connect")
    def durable(connection: DBAPIConnection, _: object) -> None:
        with closing(connection.cursor()) as cursor:
            if cursor.execute("SHOW synchronous_commit").fetchone()[0] == "off":
                cursor.execute("SET synchronous_commit TO on")
        connection.commit()

    return engine


def identity(place: JournalAddress) -> tuple[int, int] | None:
    """Device and inode of a file; (0, 0) if missing, None for a server."""
    if place.path is None:
        return None
    try:
        status = os.stat(place.path)
    except OSError:
        return (0, 0)
    return status.st_dev, status.st_ino


def fold(place: JournalAddress, connection: Connection) -> None:
    """Checkpoint a file's log into it, if nobody else has it open.

    A closed journal is one file.
    """
    raw = connection.connection.driver_connection
    if place.path is not None and raw is not None:
        with suppress(sqlite3.Error):
            raw.execute("PRAGMA busy_timeout = 200")
            raw.execute("PRAGMA journal_mode = DELETE")


def refused(place: JournalAddress, problem: SQLAlchemyError) -> InputError:
    """Error of a database in one line."""
    why = str(problem.orig if isinstance(problem, DBAPIError) and problem.orig else problem).strip()
    return InputError(f"journal {place.shown}: {' '.join(why.split())[:300]}")


class WriterLock:
    """Lock of a file's only writer, released by the system if it dies.

    Raises InputError, naming the writer that has it.
    """

    def __init__(self, place: JournalAddress):
        self._file: int | None = None
        if place.path is None:
            return
        import fcntl

        names = place.path.stat().st_nlink if place.path.exists() else 1
        if names > 1:
            raise InputError(
                f"journal {place.shown}: its file has {names} names (hard links), whose writers do not see each "
                "other (expected one name: write to a copy, or to another file)"
            )
        self._path = Path(f"{place.path}.writer")
        while self._file is None:
            try:
                file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            except OSError as problem:
                raise InputError(f"journal {place.shown}: cannot be written: {problem.strerror}") from problem
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as problem:
                holder = _holder(os.read(file, 1000))
                os.close(file)
                real = "" if str(place.path) == place.shown else f", which is {place.path}"
                raise InputError(
                    f"journal {place.shown}{real}: {holder} is writing to it (expected one writer: stop it, or another "
                    "file)"
                ) from problem
            if _same_file(file, self._path):
                self._file = file
            else:  # removed by the last writer between opening and locking
                os.close(file)
        os.ftruncate(self._file, 0)
        os.write(self._file, json.dumps({"host": socket.gethostname(), "pid": os.getpid()}).encode())

    def release(self) -> None:
        """Release the lock for other writers."""
        if self._file is not None:
            self._path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = None


def _holder(raw: bytes) -> str:
    try:
        holder = json.loads(raw)
        return f"process {holder['pid']} on {holder['host']}"
    except (ValueError, KeyError, TypeError):
        return "another process"


def _same_file(file: int, path: Path) -> bool:
    try:
        current = os.stat(path)
    except FileNotFoundError:
        return False
    ours = os.fstat(file)
    return (ours.st_dev, ours.st_ino) == (current.st_dev, current.st_ino)


def bytes_of(place: JournalAddress) -> int:
    """Size of a journal's file with its log; 0 for a server."""
    if place.path is None:
        return 0
    size = 0
    for path in (place.path, Path(f"{place.path}-wal")):
        with suppress(OSError):
            size += path.stat().st_size
    return size


def next_place(place: JournalAddress) -> JournalAddress:
    """First free name beside a file: site.db, site-2.db, site-3.db ...

    Raises InputError for a server.
    """
    if place.path is None:
        raise InputError(f"journal {place.shown}: is on a server (expected a file for rotation)")
    stem, suffix = place.path.stem, place.path.suffix
    base, _, number = stem.rpartition("-")
    first = 2
    if base and number.isdecimal():
        stem, first = base, int(number) + 1
    for k in range(first, first + 100_000):
        path = place.path.with_name(f"{stem}-{k}{suffix}")
        if not path.exists():
            return JournalAddress(str(path), path=path)
    raise InputError(f"journal {place.shown}: no free name beside it (expected fewer files)")
