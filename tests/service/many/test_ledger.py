"""The ledger gives back what is right, and nothing that is damaged, foreign or out of date."""

import json
import os
import shutil

import pytest

from catseye.errors import InputError
from catseye.service.many import ledger as book
from catseye.service.many.unit import Unit
from service.many.many_scene import square


@pytest.fixture
def scene(tmp_path):
    """A ledger with the entry of a unit that reads a folder and writes one."""
    (tmp_path / "in" / "deep").mkdir(parents=True)
    (tmp_path / "in" / "deep" / "a.csv").write_text("1,2\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "b.json").write_text("{}")
    unit = Unit("u", square, (1,), key="k", inputs=(tmp_path / "in",), output=tmp_path / "out")
    with book.opened(tmp_path / "ledger"):
        pass
    files = book.content_of(unit.inputs)
    book.write_entry(tmp_path / "ledger", unit, {"x": 0.1}, seconds=2.0, files=files, hashed=book.now())
    return tmp_path, unit


def entry(scene):
    return book.read_entry(scene[0] / "ledger", scene[1])


def test_an_entry_comes_back(scene):
    assert entry(scene).value == {"x": 0.1}
    assert (entry(scene).state, entry(scene).seconds) == ("resumed", 2.0)


def test_every_flipped_byte_is_noticed(scene):
    file = scene[0] / "ledger" / "u.json"
    raw = file.read_bytes()
    for k in range(len(raw)):
        file.write_bytes(raw[:k] + bytes([raw[k] ^ 1]) + raw[k + 1 :])
        assert entry(scene) is None, k


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"entry": 1, "sha256": 2}', "[" * 100_000])
def test_what_is_no_entry_is_none(scene, text):
    (scene[0] / "ledger" / "u.json").write_text(text)
    assert entry(scene) is None


def test_another_key_is_another_unit(scene):
    folder, unit = scene
    other = Unit("u", square, (1,), key="other", inputs=unit.inputs, output=unit.output)
    assert book.read_entry(folder / "ledger", other) is None


def test_an_entry_under_anothers_name_is_none(scene):
    folder, unit = scene
    shutil.copy(folder / "ledger" / "u.json", folder / "ledger" / "v.json")
    other = Unit("v", square, (1,), key="k", inputs=unit.inputs, output=unit.output)
    assert book.read_entry(folder / "ledger", other) is None


def test_changed_input_of_the_same_size_is_noticed_at_once(scene):
    (scene[0] / "in" / "deep" / "a.csv").write_text("1,3\n")
    assert entry(scene) is None


def test_a_new_or_missing_input_is_noticed(scene):
    (scene[0] / "in" / "new.csv").touch()
    assert entry(scene) is None
    (scene[0] / "in" / "new.csv").unlink()
    assert entry(scene) is not None
    (scene[0] / "in" / "deep" / "a.csv").unlink()
    assert entry(scene) is None


def test_touched_input_of_the_same_content_is_the_same(scene):
    os.utime(scene[0] / "in" / "deep" / "a.csv", (1.0e9, 1.0e9))
    assert entry(scene) is not None


def test_an_old_file_of_the_same_size_and_time_is_not_read_again(scene, monkeypatch):
    folder, unit = scene
    os.utime(folder / "in" / "deep" / "a.csv", (1.0e9, 1.0e9))
    files = book.content_of(unit.inputs)
    book.write_entry(folder / "ledger", unit, {"x": 1}, seconds=0.0, files=files, hashed=book.now())
    monkeypatch.setattr(book, "_digest", lambda file: pytest.fail(f"{file} is read"))
    assert entry(scene).value == {"x": 1}


@pytest.mark.parametrize("change", ["missing", "shorter", "more"])
def test_output_that_is_not_what_was_written_is_made_again(scene, change):
    out = scene[0] / "out"
    if change == "missing":
        shutil.rmtree(out)
    elif change == "shorter":
        (out / "b.json").write_text("")
    else:
        (out / "c.json").touch()
    assert entry(scene) is None


def test_a_write_that_fails_leaves_the_old_file_and_no_neighbour(scene, monkeypatch):
    folder, unit = scene

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    before = (folder / "ledger" / "u.json").read_bytes()
    with pytest.raises(OSError, match="No space"):
        book.write_entry(folder / "ledger", unit, {"x": 2}, seconds=0.0, files={}, hashed=0.0)
    assert (folder / "ledger" / "u.json").read_bytes() == before
    assert sorted(path.name for path in (folder / "ledger").iterdir()) == ["ledger.json", "u.json"]


def test_a_ledger_in_a_file_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"), book.opened(tmp_path / "file" / "ledger"):
        pytest.fail("it was opened")


def test_a_folder_is_a_ledger_by_its_mark(tmp_path, scene):
    assert book.is_ledger(scene[0] / "ledger")
    assert not book.is_ledger(tmp_path / "in")
    (tmp_path / "in" / "ledger.json").write_text(json.dumps({"format": "other"}))
    assert not book.is_ledger(tmp_path / "in")
