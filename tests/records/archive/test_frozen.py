"""An archive that an earlier release wrote always loads: tables apart and joined, samples, inputs, provenance."""

import hashlib
import shutil

import numpy as np
import pytest

from archive_scene import YearTruth, small_archive, small_samples, year_contents
from catseye.gateways.archive.restored import write_restored
from catseye.records.archive.layout import TABLES
from catseye.records.archive.provenance import read_provenance
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.samples import read_samples
from catseye.records.archive.verification import verify_archive
from repository import TESTS

FROZEN = TESTS / "vectors" / "formats" / "archive-1"
TRUTH = YearTruth(start=61041.0 + 363.15)
LATER = {("zeros", "u_adjusted")}  # columns that it did not have
CONTENT = "2768bd329d4d398f205725c744051f811c661b846810b6f6346a62f5bbc44e58"  # when it was written


@pytest.fixture
def frozen(tmp_path):
    shutil.copytree(FROZEN, tmp_path / "a")
    return open_archive(tmp_path / "a")


@pytest.fixture
def archive(tmp_path):
    return small_archive(tmp_path / "a", tmp_path / "source")


def content(archive):
    """SHA-256 over all cells of all tables, and over the samples."""
    digest = hashlib.sha256()
    for kind in TABLES:
        for name, column in read_table(archive, kind).items():
            if (kind, name) in LATER:
                continue
            cells = repr(column.tolist()) if column.dtype.kind == "U" else column.astype("<f8").tobytes().hex()
            digest.update(f"{kind} {name} {cells}\n".encode())
    digest.update(read_samples(archive, archive.nights[-1]).astype("<i2").tobytes())
    return digest.hexdigest()


def test_a_frozen_archive_holds_what_it_held(frozen):
    assert frozen.nights == ("year-000-1757d8c6", "year-001-d1c3e733", "year-002-764ae614")
    assert (frozen.years, tuple(frozen.joined)) == ((2026, 2027), (2026,))
    assert content(frozen) == CONTENT
    check = verify_archive(frozen.directory)
    assert (check.files, check.problems, check.strangers) == (19, (), ())


def test_every_table_holds_what_went_in(archive):
    nights = list(year_contents(3, 3, seed=9, truth=TRUTH, residuals=2))
    assert archive.nights == tuple(night.night for night in nights)
    for kind, layout in TABLES.items():
        table = read_table(archive, kind)
        wanted = {name: np.concatenate([night.tables[kind][name] for night in nights]) for name in table}
        order = np.lexsort((wanted["mjd"], wanted[layout.fields[0].name]))
        for name, column in table.items():
            assert np.array_equal(column, wanted[name][order], equal_nan=column.dtype.kind == "f"), (kind, name)


@pytest.mark.parametrize("which", ["frozen", "archive"])
def test_samples_and_inputs_come_back(which, request, tmp_path):
    archive = request.getfixturevalue(which)
    night = archive.nights[-1]
    provenance = write_restored(archive, night, tmp_path / "again")
    assert provenance == read_provenance(archive, night)
    assert provenance.details == {"settings": {"air_model": "ciddor"}}
    samples = np.load(tmp_path / "again/frames.npy")
    assert np.array_equal(samples, read_samples(archive, night))
    assert which == "frozen" or np.array_equal(samples, small_samples())
    assert (tmp_path / "again/mirrors/ZP101.toml").read_text() == 'zp = "ZP101"\n'
