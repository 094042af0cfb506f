"""Tables of the journal in SQLite and PostgreSQL, and conversion from older versions.

Format: docs/formats/journal.md. Every event has the primary key (run, seq); seq counts all events of a run in order,
over all tables. Times are ticks of 1e-8 day. NULL is an unknown number.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Connection,
    Executable,
    Float,
    ForeignKey,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    insert,
    inspect,
    select,
)
from sqlalchemy.engine import Dialect
from sqlalchemy.schema import SchemaItem
from sqlalchemy.types import UserDefinedType

from catseye.errors import InputError
from catseye.version import __version__

if TYPE_CHECKING:
    from sqlalchemy.sql.base import ReadOnlyColumnCollection

JournalTable: TypeAlias = "Table[ReadOnlyColumnCollection[str, Column[object]]]"
FORMAT = "catseye-journal"
VERSION = 2
FIRST_CHAINED = 2  # version with chain and parts
APPLICATION_ID = 0x43_41_54_53  # "CATS" in the header of an SQLite file

METADATA = MetaData()


class Untyped(UserDefinedType[float]):
    """A column of SQLite without a declared type.

    It keeps a double as it is: a REAL one makes -0.0 to 0.
    """

    cache_ok = True

    def get_col_spec(self, **_: object) -> str:
        return ""


def _number(name: str) -> Column[float]:
    return Column(name, Float(53).with_variant(Untyped(), "sqlite"), nullable=True)  # eight bytes, no bit lost


def _text(name: str) -> Column[str]:
    return Column(name, Text, nullable=False)


def _integer(name: str) -> Column[int]:
    return Column(name, BigInteger, nullable=False)


def _events(name: str, *columns: SchemaItem) -> "JournalTable":
    run = Column("run", Integer, ForeignKey("runs.run"), primary_key=True, autoincrement=False)
    seq = Column("seq", BigInteger, primary_key=True, autoincrement=False)
    return Table(name, METADATA, run, seq, *columns, sqlite_with_rowid=False)


JOURNAL = Table("journal", METADATA, Column("format", Text, primary_key=True), _integer("version"))
RUNS = Table(
    "runs",
    METADATA,
    Column("run", Integer, primary_key=True),
    Column("uuid", Text, nullable=False, unique=True),
    _integer("started_ticks"),
    Column("ended_ticks", BigInteger),
    _text("site"),
    Column("seed", BigInteger),
    _text("settings"),
    _text("host"),
    _integer("pid"),
    _text("catseye"),
    _text("python"),
    _text("numpy"),
    Column("buffers", Boolean, nullable=False),
)
TEXTS = Table("texts", METADATA, Column("sha256", Text, primary_key=True), _text("text"))
RUN_FILES = Table(
    "run_files",
    METADATA,
    Column("run", Integer, ForeignKey("runs.run"), primary_key=True, autoincrement=False),
    Column("path", Text, primary_key=True),
    Column("sha256", Text, ForeignKey("texts.sha256"), nullable=False),
)
SHOTS = _events(
    "shots",
    _integer("number"),
    _text("ranger"),
    _text("target"),
    _integer("ticks"),
    _integer("cycles"),
    _integer("samples_per_cycle"),
    _integer("if_hz"),
    _number("volts_per_code"),
    _number("amplitude_v"),
    _number("phase_rad"),
    _text("status"),
    _text("text"),
    _number("range_m"),
    _number("u_range_m"),
    _number("misfit_m"),
    UniqueConstraint("run", "ranger", "ticks", "target", name="shots_once"),
)
BUFFERS = _events(
    "buffers", _integer("packing"), _integer("crc32"), Column("samples", LargeBinary, nullable=False)
)  # of the shot with the same seq
WEATHER = _events(
    "weather",
    _text("station"),
    _integer("ticks"),
    _number("temperature_c"),
    _number("pressure_hpa"),
    _number("humidity_percent"),
)
POSTURES = _events(
    "postures",
    _integer("ticks"),
    _number("azimuth_rad"),
    _number("elevation_rad"),
    _number("azimuth_rate_rad_s"),
    _number("elevation_rate_rad_s"),
)
COMMANDS = _events(
    "commands",
    _integer("ticks"),
    _text("ranger"),
    _integer("tid"),
    _text("line"),
    _text("reply"),
    Column("ok", Boolean),
)
HAPPENINGS = _events(
    "happenings", _integer("ticks"), _text("who"), _text("kind"), _text("severity"), _text("text"), _text("details")
)
SOLUTIONS = _events(
    "solutions",
    _integer("ticks"),
    _text("answer"),
    _integer("size"),
    Column("covariance", LargeBinary),
)
DOCUMENTS = _events("documents", _integer("ticks"), _text("name"), _text("text"))
CHAIN = _events("chain", _text("kind"), Column("link", LargeBinary, nullable=False))  # over all rows of an event
PARTS = Table(  # continuation of a run in another file, after rotation by size or age
    "parts",
    METADATA,
    Column("run", Integer, ForeignKey("runs.run"), primary_key=True, autoincrement=False),
    Column("follows", Text),
    Column("followed_by", Text),
)
EVENTS = (SHOTS, WEATHER, POSTURES, COMMANDS, HAPPENINGS, SOLUTIONS, DOCUMENTS)

Step = Callable[[Connection], None]


def _with_chain(connection: Connection) -> None:
    """Convert to version 2: chain and parts; earlier runs stay unchained."""
    CHAIN.create(connection)
    PARTS.create(connection)


STEPS: tuple[Step, ...] = (_with_chain,)  # STEPS[n - 1] converts version n to n + 1


def create_or_convert(connection: Connection, place: str) -> None:
    """Create the tables or convert an older journal, in the caller's transaction.

    place   for messages

    Raises InputError: a foreign database, or a newer version.
    """
    version = version_of(connection, place)
    if version == 0:
        METADATA.create_all(connection)
        connection.execute(insert(JOURNAL).values(format=FORMAT, version=VERSION))
        if connection.dialect.name == "sqlite":
            connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")
        return
    for step in STEPS[version - 1 :]:
        step(connection)
    if version < VERSION:
        connection.execute(JOURNAL.update().values(version=VERSION))


def version_of(connection: Connection, place: str) -> int:
    """Version of the journal in a database; 0 if it is empty.

    Raises InputError: a foreign database, or a newer version.
    """
    tables = inspect(connection).get_table_names()
    if not tables:
        return 0
    row = None
    if JOURNAL.name in tables:
        columns = {column["name"] for column in inspect(connection).get_columns(JOURNAL.name)}
        if columns == {"format", "version"}:
            row = connection.execute(select(JOURNAL.c.version).where(JOURNAL.c.format == FORMAT)).first()
    if row is None:
        raise InputError(
            f"journal {place}: is not a journal of catseye: it has other tables, such as {min(tables)!r} "
            "(expected one, or a new name)"
        )
    version = row[0]
    if not isinstance(version, int):
        raise InputError(
            f"journal {place}: its version is {version!r} (expected a whole number): the journal is damaged; restore "
            "it from a copy"
        )
    if version > VERSION:
        raise InputError(
            f"journal {place}: version {version} is newer than {VERSION}, the newest that this catseye, {__version__}, "
            "supports (use a newer catseye)"
        )
    return version


def insertion(table: JournalTable, dialect: Dialect) -> Executable:
    """Insert that leaves existing rows alone: duplicates are stored once."""
    if dialect.name == "postgresql":
        from sqlalchemy.dialects import postgresql

        return postgresql.insert(table).on_conflict_do_nothing(index_elements=["run", "seq"])
    from sqlalchemy.dialects import sqlite

    return sqlite.insert(table).on_conflict_do_nothing(index_elements=["run", "seq"])
