"""Hash chain that makes a journal tamper-evident.

Each event has a link, a SHA-256 over all that is stored of it and the link before, so that a copy of a late link (a
head, logged at each epoch) authenticates everything before it.

    link = SHA-256(link before | kind | seq | cells)

Seq 0 is the run's own record, with its files' hashes and the first link of the run before in the journal; a number that
was refused has a link of that kind; the end's link has the time and the number after the last event's. A run that
continues in another file takes its last link with it. Cells are separated by type and length, numbers by their bits;
nothing of what SQLite or PostgreSQL makes of a row is in it.
"""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from hashlib import sha256

from sqlalchemy import Connection, select

from catseye.coordinator.journal.tables import CHAIN, RUN_FILES, RUNS, JournalTable
from catseye.errors import InputError

ZERO_LINK = bytes(32)  # before the first link
HEAD_DIGITS = 16  # hexadecimal digits of a head, as published
FEWEST_DIGITS = 8


class LinkKind(Enum):
    """Meaning of a link of the chain."""

    RUN = "run"
    EVENT = "event"
    REFUSED = "refused"
    PART = "part"  # the last link of the previous file, with which the next one begins
    END = "end"


@dataclass(frozen=True)
class Head:
    """A published link: the event's seq, and the hash in hexadecimal digits.

    The first 8 digits or more.

    >>> str(Head.parse("120:5f0c3b1e9a7d2c44"))
    '120:5f0c3b1e9a7d2c44'
    """

    seq: int
    digits: str

    @staticmethod
    def of(seq: int, link: bytes) -> "Head":
        """Head of a chain that ends at a link."""
        return Head(seq, link.hex()[:HEAD_DIGITS])

    @staticmethod
    def parse(text: str) -> "Head":
        """Head from text.

        Raises InputError: not SEQ:HASH.
        """
        seq, _, digits = text.strip().lower().partition(":")
        if not seq.isdecimal() or len(digits) < FEWEST_DIGITS or set(digits) - set("0123456789abcdef"):
            raise InputError(f"head {text[:40]!r} (expected EVENT:HASH, such as 120:5f0c3b1e9a7d2c44)")
        return Head(int(seq), digits[:64])

    def __str__(self) -> str:
        return f"{self.seq}:{self.digits}"

    def fits(self, link: bytes) -> bool:
        """True if a link is the published one."""
        return link.hex().startswith(self.digits)


def link_of(before: bytes, kind: LinkKind, seq: int, cells: Iterable[object] = ()) -> bytes:
    """Link (32 bytes) after another one.

    cells   its content, in order

    Raises TypeError: a cell of a type that no column has.
    """
    link = sha256(before)
    link.update(_cell(kind.value))
    link.update(_cell(seq))
    for cell in cells:
        link.update(_cell(cell))
    return link.digest()


def event_cells(rows: Iterable[tuple[JournalTable, Mapping[str, object]]]) -> list[object]:
    """Cells of an event: each row's table and columns, by table name.

    The run's number is left out, so that a run can be copied to another journal.
    """
    cells: list[object] = []
    for table, row in sorted(rows, key=lambda pair: pair[0].name):
        cells.append(table.name)
        cells += [row[column.name] for column in table.columns if column.name not in ("run", "seq")]
    return cells


def run_link(connection: Connection, run: int) -> bytes:
    """First link of a run, computed from its stored record.

    Raises InputError: no such run.
    """
    row = connection.execute(select(RUNS).where(RUNS.c.run == run)).mappings().first()
    if row is None:
        raise InputError(f"run {run} is not in the journal")
    before = connection.scalar(
        select(CHAIN.c.link).where(CHAIN.c.run < run, CHAIN.c.seq == 0).order_by(CHAIN.c.run.desc()).limit(1)
    )
    files = select(RUN_FILES.c.path, RUN_FILES.c.sha256).where(RUN_FILES.c.run == run)
    cells: list[object] = [row[column.name] for column in RUNS.columns if column.name not in ("run", "ended_ticks")]
    for path, digest in sorted((file.path, file.sha256) for file in connection.execute(files)):
        cells += [path, digest]
    return link_of(before if isinstance(before, bytes) else ZERO_LINK, LinkKind.RUN, 0, cells)


def _cell(value: object) -> bytes:
    if value is None:
        return b"n"
    if isinstance(value, int):  # includes bool
        text = str(int(value)).encode()
        return b"i%d:%s" % (len(text), text)
    if isinstance(value, float):
        return b"f" + struct.pack("<d", value)
    if isinstance(value, str):
        text = value.encode("utf-8", "surrogatepass")
        return b"t%d:%s" % (len(text), text)
    if isinstance(value, bytes | bytearray | memoryview):
        return b"b%d:%s" % (len(value), bytes(value))
    raise TypeError(f"a {type(value).__name__} is in no column")
