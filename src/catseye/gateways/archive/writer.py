"""A night into an archive: its files, and then its entry in the index."""

from functools import partial
from pathlib import Path

import numpy as np

from catseye.errors import InputError
from catseye.gateways.archive.content import Columns, NightContent
from catseye.gateways.archive.files import write_file, write_text
from catseye.gateways.archive.inputs import input_file, write_inputs
from catseye.gateways.archive.samples import write_samples
from catseye.gateways.archive.tables import write_table
from catseye.gateways.writers.objects import plain, versions
from catseye.records.archive.index import ArchivedFile, ArchivedNight, entry_text, night_path
from catseye.records.archive.layout import INPUTS, PROVENANCE, SAMPLES, TABLES, year_folder, year_of
from catseye.records.archive.parquet import package_version
from catseye.records.archive.provenance import InputFile, NightProvenance, provenance_text

PACKAGES = ("pyarrow", "blosc2")


def write_night(directory: Path, content: NightContent) -> ArchivedNight:
    """Write a night's files and, last, its entry in the index.

    Raises InputError: a full disk, an unknown table or column, an input that changed meanwhile.
    """
    year = year_of(content.first)
    files = [
        _table(directory, year, content.night, kind, content.tables[kind]) for kind in TABLES if kind in content.tables
    ]
    inputs, header = ((), b"") if content.directory is None else _inputs(directory, year, content, files)
    provenance = NightProvenance(
        night=content.night,
        inputs=inputs,
        samples=content.samples,
        header=header.hex(),
        versions={**versions(), **{name: package_version(name) for name in PACKAGES}},
        details=plain(content.provenance),
    )
    path = year_folder(PROVENANCE, year) / f"{content.night}.json"
    files.append(write_text(directory, path, provenance_text(provenance), kind=PROVENANCE))
    entry = ArchivedNight(
        night=content.night,
        year=year,
        first=content.first,
        last=content.last,
        source=content.source,
        inputs_sha256=content.inputs_sha256,
        origin=content.origin,
        files=tuple(files),
    )
    write_text(directory, night_path(entry.night), entry_text(entry))
    return entry


def _table(directory: Path, year: int, night: str, kind: str, columns: Columns) -> ArchivedFile:
    rows = len(next(iter(columns.values()), ()))
    path = year_folder(kind, year) / f"{night}.parquet"
    return write_file(directory, path, lambda fresh: write_table(fresh, kind, columns), kind=kind, rows=rows)


def _inputs(
    directory: Path, year: int, content: NightContent, files: list[ArchivedFile]
) -> tuple[tuple[InputFile, ...], bytes]:
    """Write samples and all other inputs; the inputs' hashes, and the header of the samples' file."""
    source, header = content.directory, b""
    assert source is not None
    before = [input_file(source, name) for name in content.inputs]
    if content.samples:
        assert content.periods is not None
        assert content.cycles is not None
        samples = np.load(source / content.samples, mmap_mode="r", allow_pickle=False)
        with (source / content.samples).open("rb") as stream:
            header = stream.read(samples.offset)
        path = year_folder(SAMPLES, year) / f"{content.night}.b2frame"
        write = partial(write_samples, samples=samples, periods=content.periods, cycles=content.cycles)
        files.append(write_file(directory, path, write, kind=SAMPLES, rows=len(samples)))
    others = [name for name in content.inputs if name != content.samples]
    path = year_folder(INPUTS, year) / f"{content.night}.tar.zst"
    files.append(write_file(directory, path, lambda f: write_inputs(f, source, others), kind=INPUTS, rows=len(others)))
    for file in before:
        if input_file(source, file.path) != file:
            raise InputError(f"{source / file.path}: was written to meanwhile (expected a campaign that is complete)")
    return tuple(before), header
