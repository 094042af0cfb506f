"""`catseye archive` and `catseye restore`: statuses, streams and files."""

import json

import pytest

from archive_scene import flip, written_year
from command_scene import command_line
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture
def catseye(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("catseye.cli.terminal.FIRST_LINE", float("inf"))
    return command_line(capsys)


def test_a_night_is_added_told_and_restored(catseye, tmp_path):
    status, said, complaint = catseye("archive", "years", NIGHT, "--json")
    assert (status, complaint) == (0, "")
    answer = json.loads(said)
    [night] = answer["nights"]
    assert answer["sources"][0]["night"] == night
    status, said, complaint = catseye("restore", "years", "night-01", "again")
    assert (status, complaint) == (0, "")
    assert "every file equals what was archived" in said
    assert (tmp_path / "again/frames.npy").read_bytes() == (NIGHT / "frames.npy").read_bytes()


def test_an_archive_is_told_joined_and_checked(catseye, tmp_path):
    night = written_year(tmp_path / "years", 4, 5, seed=1).nights[2]
    status, said, complaint = catseye("archive", "years", "--compact", "--check", "--remove", night)
    assert (status, complaint) == (0, "")
    for text in ("3 nights of 2026 in years/", "Removed", "Joined", "tables of 2026", "as the index has them"):
        assert text in said


def test_damage_is_status_1_with_the_file_s_name(catseye, tmp_path):
    written_year(tmp_path / "years", 2, 5, seed=1)
    path = next((tmp_path / "years/zeros/year=2026").iterdir())
    flip(path, 50)
    status, said, complaint = catseye("archive", "years", "--check")
    assert status == 1
    assert path.name in complaint
    assert len(complaint.strip().splitlines()) == 1
    assert "Damaged" in said
    assert json.loads(catseye("archive", "years", "--check", "--json")[1])["verdict"]["word"] == "failed"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("archive", "none"), "none: is not a directory (expected an archive"),
        (("archive", "years", "missing"), "missing: missing (expected a folder with shots.csv, or a journal)"),
        (("restore", "none", "x", "y"), "none: is not a directory (expected an archive"),
    ],
)
def test_what_cannot_be_done_is_status_1_in_one_line(catseye, tmp_path, words, complaint):
    status, said, told = catseye(*words)
    assert (status, said) == (1, "")
    assert complaint in told
    assert len(told.strip().splitlines()) == 1
    assert not (tmp_path / "years").exists()
