"""Files of a night before it was archived: all but its samples in one compressed tar file."""

import os
import tarfile
from collections.abc import Iterable
from datetime import UTC, datetime
from hashlib import file_digest
from pathlib import Path
from typing import BinaryIO

from catseye.errors import InputError
from catseye.gateways.archive.content import NightInputs
from catseye.records.archive.parquet import scale_module
from catseye.records.archive.provenance import InputFile


def files_below(directory: Path) -> list[str]:
    """Paths of all files below a directory, relative to it, sorted; links are followed.

    Raises InputError: a directory or file that cannot be read.
    """
    paths: list[str] = []

    def refuse(problem: OSError) -> None:
        raise InputError(f"{problem.filename}: cannot be read: {problem.strerror}") from problem

    for folder, _, names in os.walk(directory, onerror=refuse):
        for path in (Path(folder) / name for name in names):
            if not path.is_file():
                raise InputError(f"{path}: is no file (expected files and folders in a campaign)")
            paths.append(path.relative_to(directory).as_posix())
    return sorted(paths)


def night_inputs(night: str, sha256: str, directory: Path) -> NightInputs:
    """Inputs of a night that is archived now: all files of a directory.

    night    identifier
    sha256   that identifies the inputs
    """
    files = tuple(files_below(directory))
    size = sum((directory / path).stat().st_size for path in files)
    return NightInputs(night=night, sha256=sha256, directory=directory, files=files, size=size, when=datetime.now(UTC))


def input_file(directory: Path, path: str) -> InputFile:
    """Size and SHA-256 of a file; InputError if it cannot be read."""
    try:
        with (directory / path).open("rb") as stream:
            digest = file_digest(stream, "sha256").hexdigest()
            return InputFile(path, stream.tell(), digest)
    except OSError as problem:
        raise InputError(f"{directory / path}: cannot be read: {problem.strerror or problem}") from problem


def write_inputs(path: Path, directory: Path, inputs: Iterable[str]) -> None:
    """Write files as tar, compressed by zstd; equal files give equal bytes.

    path     of the new file
    inputs   paths relative to the directory
    """
    arrow = scale_module("pyarrow")
    with (
        arrow.OSFile(str(path), "wb") as plain,
        arrow.CompressedOutputStream(plain, "zstd") as stream,
        tarfile.open(fileobj=stream, mode="w|", format=tarfile.PAX_FORMAT) as archive,
    ):
        for name in inputs:
            with (directory / name).open("rb") as source:
                archive.addfile(_member(name, source), source)


def _member(name: str, source: BinaryIO) -> tarfile.TarInfo:
    """Header of a file in the tar, without owner and time."""
    member = tarfile.TarInfo(name)
    member.size = os.fstat(source.fileno()).st_size
    member.mode = 0o644
    return member
