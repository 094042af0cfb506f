"""An output directory appears whole or not at all, and nothing of anybody else's is replaced."""

import errno
import json

import pytest

from catseye.errors import InputError
from catseye.gateways.writers.output import FORMAT, atomic_directory


@pytest.fixture
def campaign(tmp_path):
    place = tmp_path / "input" / "campaign"
    place.mkdir(parents=True)
    return place


def write(out, campaign, text, *, fail=None):
    with atomic_directory(out, campaign) as directory:
        (directory / "table.csv").write_text(text)
        if fail is not None:
            raise fail
        (directory / "provenance.json").write_text(json.dumps({"format": FORMAT, "outputs": {"table.csv": ""}}))


def neighbours(out):
    return sorted(path.name for path in out.parent.iterdir())


def test_output_appears_complete(tmp_path, campaign):
    write(tmp_path / "out", campaign, "a")
    assert (tmp_path / "out" / "table.csv").read_text() == "a"
    assert neighbours(tmp_path / "out") == ["input", "out"]


@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_no_output_appears_after_a_failure(tmp_path, campaign, failure):
    with pytest.raises((InputError, KeyboardInterrupt)):
        write(tmp_path / "out", campaign, "a", fail=failure)
    assert neighbours(tmp_path / "out") == ["input"]


def test_a_full_disk_is_named(tmp_path, campaign):
    with pytest.raises(InputError, match=r"--out .*out: cannot be written: No space left on device"):
        write(tmp_path / "out", campaign, "a", fail=OSError(errno.ENOSPC, "No space left on device"))


def test_an_empty_directory_and_an_earlier_output_are_replaced(tmp_path, campaign):
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", campaign, "a")
    write(tmp_path / "out", campaign, "b")
    assert (tmp_path / "out" / "table.csv").read_text() == "b"
    assert neighbours(tmp_path / "out") == ["input", "out"]


def test_the_earlier_output_stays_when_the_new_one_fails(tmp_path, campaign):
    write(tmp_path / "out", campaign, "a")
    with pytest.raises(InputError):
        write(tmp_path / "out", campaign, "b", fail=OSError(errno.EIO, "Input/output error"))
    assert (tmp_path / "out" / "table.csv").read_text() == "a"
    assert neighbours(tmp_path / "out") == ["input", "out"]


def test_a_link_is_followed(tmp_path, campaign):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "elsewhere")
    write(tmp_path / "out", campaign, "a")
    assert (tmp_path / "out").is_symlink()
    assert (tmp_path / "elsewhere" / "table.csv").read_text() == "a"


def test_foreign_files_are_not_replaced(tmp_path, campaign):
    write(tmp_path / "out", campaign, "a")
    (tmp_path / "out" / "my-notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds 'my-notes\.txt', which catseye did not write"):
        write(tmp_path / "out", campaign, "b")
    assert (tmp_path / "out" / "my-notes.txt").read_text() == "mine"


@pytest.mark.parametrize("provenance", ["{", "[]", '{"format": "other"}', '{"format": "catseye-reduction-1"}'])
def test_a_stranger_with_our_file_name_is_not_replaced(tmp_path, campaign, provenance):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "provenance.json").write_text(provenance)
    with pytest.raises(InputError, match="which catseye did not write"):
        write(tmp_path / "out", campaign, "a")


@pytest.mark.parametrize("where", ["input/campaign", "input/campaign/report", "input", "."])
def test_neither_in_nor_around_nor_the_campaign(tmp_path, campaign, where):
    with pytest.raises(InputError, match="is, holds or lies in the input"):
        write(tmp_path / where, campaign, "a")


def test_a_missing_parent_and_a_file_in_the_way_are_refused(tmp_path, campaign):
    with pytest.raises(InputError, match="not a directory"):
        write(tmp_path / "no" / "out", campaign, "a")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="exists and is not a directory"):
        write(tmp_path / "file", campaign, "a")


def test_the_current_directory_is_refused(tmp_path, campaign, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(InputError, match="is the current directory"):
        write(tmp_path / "here", campaign, "a")
