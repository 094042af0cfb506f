"""Parquet files of an archive: schema, footer, and errors that name the file."""

from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from catseye.errors import InputError
from catseye.records.archive.layout import table_layout

EXTRA = "pip install 'catseye[scale]'"
MAGIC = b"PAR1"
TAIL = 8  # bytes: length of the footer, and the magic


def scale_module(name: str) -> ModuleType:
    """Module of the extra `scale`; InputError if it is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError as problem:
        package = name.partition(".")[0]
        raise InputError(f"archive needs {package} (expected catseye installed with its extra: {EXTRA})") from problem


def schema(kind: str) -> Any:
    """Schema of a table's Parquet files, for pyarrow."""
    arrow = scale_module("pyarrow")
    types = {"text": arrow.string(), "float": arrow.float64(), "integer": arrow.int64()}
    return arrow.schema([arrow.field(field.name, types[field.kind]) for field in table_layout(kind).fields])


def footer_sha256(path: Path) -> str:
    """SHA-256 of a file's footer, which no checksum of a page covers; "" for a file without one."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        if size < 2 * TAIL:
            return ""
        stream.seek(size - TAIL)
        tail = stream.read(TAIL)
        length = int.from_bytes(tail[:4], "little")
        if tail[4:] != MAGIC or length + TAIL > size:
            return ""
        stream.seek(size - TAIL - length)
        return sha256(stream.read(length + TAIL)).hexdigest()


def package_version(name: str) -> str:
    """Version of a package of the extra; InputError if it is not installed."""
    scale_module(name)
    from importlib.metadata import version

    return version(name)
