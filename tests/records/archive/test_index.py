"""Entries of the index: what was written comes back, any change is seen, and identifiers are names of files."""

import numpy as np
import pytest

from archive_scene import flip
from catseye.errors import InputError
from catseye.records.archive.index import (
    ArchivedFile,
    ArchivedNight,
    JoinedYear,
    entry_text,
    inputs_hash,
    joined_path,
    night_identifier,
    night_path,
    read_entry,
    read_sealed,
    sealed,
)

FILE = ArchivedFile("points/year=2026/n.parquet", "points", 10, "ab" * 32, "cd" * 32, 3)
NIGHT = ArchivedNight(
    night="n-01234567",
    year=2026,
    first=61041.0000001,
    last=61041.3,
    source="campaign",
    inputs_sha256="ef" * 32,
    origin="",
    files=(FILE,),
)


@pytest.mark.parametrize("entry", [NIGHT, JoinedYear(2026, {NIGHT.night: NIGHT}, (FILE,))], ids=["night", "year"])
def test_an_entry_comes_back(tmp_path, entry):
    path = night_path(NIGHT.night) if entry is NIGHT else joined_path(2026)
    (tmp_path / path).parent.mkdir()
    (tmp_path / path).write_text(entry_text(entry), encoding="utf-8")
    assert read_entry(tmp_path, path) == entry


def test_any_flipped_bit_of_an_entry_is_seen(tmp_path):
    path = tmp_path / "x.json"
    path.write_text(sealed({"format": "x", "µ": [1.5, None, "text"]}), encoding="utf-8")
    good = path.read_bytes()
    assert read_sealed(path, "x") == {"format": "x", "µ": [1.5, None, "text"]}
    rng = np.random.default_rng(1)
    for where in range(len(good)):
        flip(path, where, int(rng.integers(8)))
        with pytest.raises(InputError, match=r"x.json: differs from its SHA-256: damaged \(restore it from a copy"):
            read_sealed(path, "x")
        path.write_bytes(good)
    for end in (0, 10, len(good) - 1):
        path.write_bytes(good[:end])
        with pytest.raises(InputError, match="differs from its SHA-256"):
            read_sealed(path, "x")


def test_an_entry_of_a_newer_catseye_is_refused_as_such(tmp_path):
    path = tmp_path / "x.json"
    path.write_text(sealed({"format": "x-9"}), encoding="utf-8")
    with pytest.raises(InputError, match=r"format = 'x-9' \(expected 'x-1' or 'y-1'; use a newer catseye\)"):
        read_sealed(path, "x-1", "y-1")
    with pytest.raises(InputError, match=r"none\.json: missing: damaged"):
        read_sealed(tmp_path / "none.json", "x-1")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("night-01", "night-01-01234567"),
        ("../x y/\u00e9t\u00e9", "x-y-t-01234567"),
        ("...", "night-01234567"),
        ("a" * 300, "a" * 80 + "-01234567"),
    ],
)
def test_identifiers_are_names_of_files(name, expected):
    assert night_identifier(name, "0123456789" + "0" * 54) == expected


def test_the_hash_of_inputs_knows_their_names_but_not_their_order():
    hashes = {"site.toml": "1", "shots.csv": "2"}
    assert inputs_hash(hashes) == inputs_hash(dict(reversed(hashes.items())))
    assert inputs_hash(hashes) != inputs_hash({"site.toml": "2", "shots.csv": "1"})
