"""Certificate of calibration as a document: blocks of content, with no thought of HTML or PDF."""

import hashlib
import re
from dataclasses import dataclass, fields
from datetime import date
from typing import NamedTuple

from catseye.verdict import Verdict

TITLE = "Certificate of calibration"
MARK = "catseye-certificate-1"  # identifies a file of catseye
NOT_STATED = "not stated"
BREAK = "\u200b"  # no width; a record cannot hold it
LONG_WORD, PIECE = re.compile(r"\S{23,}"), re.compile(r"([^\s\u200b]{12})")


class Facts(NamedTuple):
    """Names with what is stated of them."""

    rows: tuple[tuple[str, str], ...]


class Paragraph(NamedTuple):
    """Sentences; faint ones explain."""

    text: str
    faint: bool = False


class CellTable(NamedTuple):
    """Table whose head repeats on each page.

    columns   headings
    kinds     a letter for each column: n number, t text, w wide text, h hash
    rows      cells
    caption   above it; empty: none
    """

    columns: tuple[str, ...]
    kinds: str
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


class SvgPicture(NamedTuple):
    """Figure as SVG, its text as outlines."""

    svg: str
    caption: str


class Listing(NamedTuple):
    """Lines in a typewriter's face, to copy."""

    caption: str
    lines: tuple[str, ...]


Block = Facts | Paragraph | CellTable | SvgPicture | Listing


class Chapter(NamedTuple):
    """Blocks under a title; key identifies them in a page."""

    key: str
    title: str
    blocks: tuple[Block, ...]


class Letterhead(NamedTuple):
    """Head of the first page; logo is the bytes of a PNG or an SVG, empty without one."""

    name: str
    lines: tuple[str, ...]
    accreditation: str
    logo: bytes


@dataclass(frozen=True, eq=False)
class CertificateDocument:
    """Certificate, ready to be written.

    number       with the laboratory's prefix; None: not stated
    subject      one line: what was calibrated
    letterhead   of the laboratory
    issued_on    date of issue
    verdict      of the calibration's own tests, and no better than its statements of conformity
    facts        identity of item, customer and work
    results      chapter of the first page, above the signatures
    signatures   (role, name) in order; an empty name is a line to fill in
    chapters     on the pages after
    """

    number: str | None
    subject: str
    letterhead: Letterhead
    issued_on: date
    verdict: Verdict
    facts: Facts
    results: Chapter
    signatures: tuple[tuple[str, str], ...]
    chapters: tuple[Chapter, ...]

    @property
    def heading(self) -> str:
        """Title with the number, for the metadata and the foot of each page."""
        return TITLE if self.number is None else f"{TITLE} {self.number}"

    @property
    def number_mark(self) -> str:
        """Mark by which a file of the same number is recognised; empty without a number."""
        return "" if self.number is None else _hashed("catseye-number-", self.number)

    @property
    def content_mark(self) -> str:
        """Mark of the whole content: a PDF and a page of one certificate have the same."""
        return _hashed("catseye-content-", repr([getattr(self, each.name) for each in fields(self)]))

    @property
    def marks(self) -> tuple[str, ...]:
        """Marks that identify the file as catseye's, its number and its content."""
        return tuple(filter(None, (MARK, self.number_mark, self.content_mark)))


def breakable(text: str) -> str:
    """Text with places (U+200B) where a word beyond 22 characters may break: after _, or each 12 characters.

    >>> breakable("short_word"), breakable("x" * 24).count("\u200b")
    ('short_word', 2)
    """
    return LONG_WORD.sub(lambda word: PIECE.sub(r"\1" + BREAK, word[0].replace("_", "_" + BREAK)), text)


def cells_of(table: CellTable) -> list[list[str]]:
    """Cells with places where a long word may break; a hash has none, so that it can be copied whole."""
    return [
        [cell if kind == "h" else breakable(cell) for cell, kind in zip(row, table.kinds, strict=True)]
        for row in table.rows
    ]


def _hashed(name: str, text: str) -> str:
    return name + hashlib.sha256(text.encode()).hexdigest()[:32]
