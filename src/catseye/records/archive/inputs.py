"""Files of an archived night as they were before: samples with their header, and the others from one tar file."""

import io
import tarfile
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO

import numpy as np

from catseye.errors import InputError
from catseye.records.archive.index import damaged
from catseye.records.archive.layout import INPUTS, SAMPLES
from catseye.records.archive.parquet import scale_module
from catseye.records.archive.provenance import NightProvenance, read_provenance
from catseye.records.archive.reading import ArchiveFolder, refuse_damaged
from catseye.records.archive.samples import sample_frame
from catseye.records.files.refusal import refusal
from catseye.records.night.shot import checked_header, header_of

PIECE = 2**20  # bytes read at once

Sink = Callable[[str, Iterator[bytes]], None]


def restore_inputs(archive: ArchiveFolder, night: str, sink: Sink) -> NightProvenance:
    """Hand each input file of a night on, and return the night's provenance.

    night   identifier, or a beginning that only one has
    sink    called with a file's path, relative to the campaign, and its content in pieces, which it must use up

    Raises InputError: an unknown night, one without inputs, a damaged file, content that differs from its SHA-256.
    """
    entry, provenance = archive.entry(night), read_provenance(archive, night)
    packed = entry.file(INPUTS)
    if packed is None:
        raise refusal(str(archive.directory), f"night {entry.night} has no inputs in the archive")
    hashes = {file.path: file.sha256 for file in provenance.inputs}
    for file in entry.files:
        if file.kind in (INPUTS, SAMPLES):
            refuse_damaged(archive.directory, file)
    path = archive.directory / packed.path
    missing = set(hashes)

    def hand_on(name: str, pieces: Iterator[bytes]) -> None:
        if name not in missing:
            raise damaged(path, f"holds {name!r}, which its entry does not name")
        missing.discard(name)
        sink(name, _verified(path, name, pieces, hashes[name]))

    try:
        for name, stream in _members(path):
            hand_on(name, iter(lambda stream=stream: stream.read(PIECE), b""))  # type: ignore[misc]
    except (tarfile.TarError, EOFError) as problem:
        raise damaged(path, "is no complete tar file") from problem
    if provenance.samples:
        hand_on(provenance.samples, _sample_bytes(archive, provenance))
    if missing:
        raise damaged(path, f"lacks {min(missing)!r}")
    return provenance


def _members(path: Path) -> Iterator[tuple[str, BinaryIO]]:
    """Name and content of each file in a compressed tar."""
    arrow = scale_module("pyarrow")
    try:
        with (
            arrow.OSFile(str(path), "rb") as plain,
            arrow.CompressedInputStream(plain, "zstd") as stream,
            tarfile.open(fileobj=stream, mode="r|") as packed,
        ):
            for member in packed:
                content = packed.extractfile(member)
                if content is not None:
                    yield member.name, content  # type: ignore[misc]
    except arrow.ArrowException as problem:
        raise damaged(path, "is not as zstd wrote it") from problem


def _sample_bytes(archive: ArchiveFolder, provenance: NightProvenance) -> Iterator[bytes]:
    """Content of the file of samples: its header, and the samples in its own order."""
    header, frame = bytes.fromhex(provenance.header), sample_frame(archive, provenance.night)
    yield header
    name = provenance.samples
    _, by_columns = checked_header(header_of(io.BytesIO(header), name), name)
    if by_columns:
        yield np.concatenate(list(frame.blocks())).T.astype("<i2", copy=False).tobytes()
        return
    for block in frame.blocks():
        yield block.astype("<i2", copy=False).tobytes()


def _verified(path: Path, name: str, pieces: Iterator[bytes], expected: str) -> Iterator[bytes]:
    """The same pieces; InputError after the last if they differ from a SHA-256."""
    digest = sha256()
    for piece in pieces:
        digest.update(piece)
        yield piece
    if digest.hexdigest() != expected:
        raise InputError(f"{path}: {name} differs from its SHA-256 when it was archived: damaged")
