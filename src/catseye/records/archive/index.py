"""Index of an archive: a file a night, written last, and a file a year whose tables are joined.

A night is in the archive when its entry is in the index. An entry holds the SHA-256 of each file of the night and its
own.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any

from catseye.errors import InputError
from catseye.records.archive.layout import INDEX, JOINED
from catseye.records.files.refusal import refusal, unreadable

NIGHT_FORMAT = "catseye-archive-night-1"
YEAR_FORMAT = "catseye-archive-year-1"
OWN_HASH = "sha256"
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
class InputFile:
    """File of a night before it was archived.

    path        relative to the campaign
    size        bytes
    sha256      of the content
    """

    path: str
    size: int
    sha256: str


@dataclass(frozen=True)
class ArchivedNight:
    """Entry of the index.

    night           identifier
    year            of its folders
    first, last     MJD of its earliest and latest row
    source          `campaign` or `journal`
    inputs_sha256   over names and SHA-256 of the inputs
    inputs          files that come back when the night is restored
    samples         path of the one of them that holds the samples; "" without samples
    header          its bytes before the samples, hexadecimal
    versions        of catseye and its libraries that made the results
    provenance      settings, certificates and, of a journal, run and head of the chain
    files           of the archive; no tables where the year's tables are joined
    """

    night: str
    year: int
    first: float
    last: float
    source: str
    inputs_sha256: str
    inputs: tuple[InputFile, ...]
    samples: str
    header: str
    versions: Mapping[str, str]
    provenance: Mapping[str, Any]
    files: tuple[ArchivedFile, ...]

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
    document = {"format": NIGHT_FORMAT if isinstance(entry, ArchivedNight) else YEAR_FORMAT, **asdict(entry)}
    return json.dumps({**document, OWN_HASH: _own_hash(document)}, indent=1, allow_nan=False) + "\n"


def read_entry(directory: Path, path: Path) -> ArchivedNight | JoinedYear:
    """Entry of the index; InputError, naming the file, if it is damaged.

    path   relative to the archive
    """
    try:
        document = json.loads((directory / path).read_text(encoding="utf-8"))
    except OSError as problem:
        raise unreadable(str(directory / path), problem) from problem
    except (ValueError, RecursionError) as problem:
        raise damaged(directory / path, "is not JSON") from problem
    if not isinstance(document, dict) or document.pop(OWN_HASH, None) != _own_hash(document):
        raise damaged(directory / path, "differs from its SHA-256")
    form = document.pop("format", None)
    if form == NIGHT_FORMAT:
        return _night(document)
    if form == YEAR_FORMAT:
        nights = {name: _night(entry) for name, entry in document["nights"].items()}
        return JoinedYear(document["year"], nights, _files(document["files"]))
    newer = "use a newer catseye"
    raise refusal(
        str(directory / path), f"format = {form!r} (expected {NIGHT_FORMAT!r} or {YEAR_FORMAT!r}; otherwise {newer})"
    )


def damaged(path: Path, problem: str) -> InputError:
    """Error that names a damaged file of an archive."""
    return refusal(str(path), f"{problem}: damaged (restore it from a copy, or archive its source again)")


def _night(document: Mapping[str, Any]) -> ArchivedNight:
    inputs = tuple(InputFile(**file) for file in document["inputs"])
    return ArchivedNight(**{**document, "inputs": inputs, "files": _files(document["files"])})


def _files(documents: list[dict[str, Any]]) -> tuple[ArchivedFile, ...]:
    return tuple(ArchivedFile(**document) for document in documents)


def _own_hash(document: Mapping[str, Any]) -> str:
    return sha256(json.dumps(document, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
