"""Files of a night in one tar: complete, the same bytes twice, and nothing but files."""

import os

import pytest

from catseye.errors import InputError
from catseye.gateways.archive.inputs import files_below, input_file, write_inputs


@pytest.fixture
def folder(tmp_path):
    where = tmp_path / "night"
    (where / "mirrors").mkdir(parents=True)
    (where / "site.toml").write_text("a = 1\n")
    (where / "mirrors/été.toml").write_bytes(bytes(range(256)) * 100)
    (where / ".hidden").write_bytes(b"")
    (where / "link.toml").symlink_to(where / "site.toml")
    return where


def test_all_files_are_found_in_order(folder):
    assert files_below(folder) == [".hidden", "link.toml", "mirrors/été.toml", "site.toml"]
    assert input_file(folder, "link.toml") == input_file(folder, "site.toml").__class__(
        "link.toml", 6, input_file(folder, "site.toml").sha256
    )


def test_equal_files_give_equal_bytes_whatever_their_times(folder, tmp_path):
    for name, time in (("a", 1e9), ("b", 2e9)):
        os.utime(folder / "site.toml", (time, time))
        write_inputs(tmp_path / name, folder, files_below(folder))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a").read_bytes()[:4] == b"\x28\xb5\x2f\xfd"  # zstd's


def test_what_is_no_file_is_refused(folder, tmp_path):
    (folder / "more").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"more: is no file \(expected files and folders"):
        files_below(folder)
    (folder / "more").unlink()
    os.mkfifo(folder / "pipe")
    with pytest.raises(InputError, match=r"pipe: is no file"):
        files_below(folder)
