"""Index of an archive: a file a night, written last, and a file a year whose tables are joined.

A night is in the archive when its entry is in the index. An entry holds the SHA-256 of each file of the night and its
own.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

from catseye.errors import InputError
from catseye.records.archive.layout import INDEX, JOINED, TABLES
from catseye.records.files.refusal import refusal, unreadable

NIGHT_FORMAT = "catseye-archive-night-1"
YEAR_FORMAT = "catseye-archive-year-1"
SEAL, DOCUMENT, END = '{"sha256": "', '",\n"document": ', "}\n"  # around digest and document
HASH_DIGITS, LONGEST_NAME = 8, 80  # characters of an identifier


@dataclass(frozen=True)
class ArchivedFile:
    """File of an archive.

    path     relative to the archive
    kind     name of its table, `samples` or `inputs`
    size     bytes
    sha256   of the content
    footer   SHA-256 of a Parquet file's footer; "" for other files
    rows     of a table, shots of samples, files of inputs
    """

    path: str
    kind: str
    size: int
    sha256: str
    footer: str = ""
    rows: int = 0


@dataclass(frozen=True)
class ArchivedNight:
    """Entry of the index.

    night           identifier
    year            of its folders
    first, last     MJD of its earliest and latest row
    source          `campaign` or `journal`
    inputs_sha256   over names and SHA-256 of the inputs
    origin          of a journal's run its uuid: of several nights with one origin only the latest counts; else ""
    files           of the archive; no tables where the year's tables are joined
    """

    night: str
    year: int
    first: float
    last: float
    source: str
    inputs_sha256: str
    origin: str
    files: tuple[ArchivedFile, ...]

    @property
    def tables(self) -> "tuple[ArchivedFile, ...]":
        """Its Parquet files; none where the year's tables are joined."""
        return tuple(file for file in self.files if file.kind in TABLES)

    def file(self, kind: str) -> ArchivedFile | None:
        """File of a kind; None without one."""
        return next((file for file in self.files if file.kind == kind), None)


@dataclass(frozen=True)
class JoinedYear:
    """Entry of a year whose nights' tables are joined.

    nights   their entries, by identifier
    files    joined tables, one a kind
    """

    year: int
    nights: Mapping[str, ArchivedNight]
    files: tuple[ArchivedFile, ...]


def night_identifier(name: str, inputs_sha256: str) -> str:
    """Identifier of a night, which is the name of its files.

    name            of the campaign, or of a journal's site and run
    inputs_sha256   over names and SHA-256 of the inputs

    >>> night_identifier("night 01/b", "0123456789abcdef")
    'night-01-b-01234567'
    """
    plain = re.sub(r"[^A-Za-z0-9_.]+", "-", name).strip("-.")[:LONGEST_NAME] or "night"
    return f"{plain}-{inputs_sha256[:HASH_DIGITS]}"


def inputs_hash(hashes: Mapping[str, str]) -> str:
    """SHA-256 over the names and SHA-256 of files, hexadecimal."""
    return sha256("".join(f"{name}\0{hashes[name]}\n" for name in sorted(hashes)).encode()).hexdigest()


def night_path(night: str) -> PurePosixPath:
    """Path of a night's entry, relative to the archive."""
    return PurePosixPath(INDEX) / f"{night}.json"


def joined_path(year: int) -> PurePosixPath:
    """Path of a joined year's entry, relative to the archive."""
    return PurePosixPath(INDEX) / f"{JOINED}-{year:04d}.json"


def entry_text(entry: ArchivedNight | JoinedYear) -> str:
    """Content of an entry's file."""
    return sealed({"format": NIGHT_FORMAT if isinstance(entry, ArchivedNight) else YEAR_FORMAT, **asdict(entry)})


def read_entry(directory: Path, path: PurePath) -> ArchivedNight | JoinedYear:
    """Entry of the index; InputError, naming the file, if it is damaged.

    path   relative to the archive
    """
    document = read_sealed(directory / path, NIGHT_FORMAT, YEAR_FORMAT)
    if document.pop("format") == NIGHT_FORMAT:
        return _night(document)
    nights = {name: _night(entry) for name, entry in document["nights"].items()}
    return JoinedYear(document["year"], nights, _files(document["files"]))


def sealed(document: Mapping[str, Any]) -> str:
    """JSON of a document within an object that holds its SHA-256."""
    text = json.dumps(document, indent=1, allow_nan=False)
    return f"{SEAL}{sha256(text.encode()).hexdigest()}{DOCUMENT}{text}{END}"


def read_sealed(path: Path, *formats: str) -> dict[str, Any]:
    """Document of a sealed file; InputError, naming it, if it is damaged or of another format."""
    try:
        raw = path.read_bytes()
    except FileNotFoundError as problem:
        raise damaged(path, "missing") from problem
    except OSError as problem:
        raise unreadable(str(path), problem) from problem
    text = raw[len(SEAL) + 64 + len(DOCUMENT) : -len(END)]
    if raw != f"{SEAL}{sha256(text).hexdigest()}{DOCUMENT}".encode() + text + END.encode():
        raise damaged(path, "differs from its SHA-256")
    document: dict[str, Any] = json.loads(text)
    if document.get("format") not in formats:
        expected = " or ".join(map(repr, formats))
        raise refusal(str(path), f"format = {document.get('format')!r} (expected {expected}; use a newer catseye)")
    return document


def damaged(path: Path, problem: str) -> InputError:
    """Error that names a damaged file of an archive."""
    return refusal(str(path), f"{problem}: damaged (restore it from a copy, or archive its source again)")


def _night(document: Mapping[str, Any]) -> ArchivedNight:
    return ArchivedNight(**{**document, "files": _files(document["files"])})


def _files(documents: list[dict[str, Any]]) -> tuple[ArchivedFile, ...]:
    return tuple(ArchivedFile(**document) for document in documents)
