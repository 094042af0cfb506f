"""A suffix says the format: figures are SVG, PDF or PNG, pages HTML, and nothing is written under another name."""

import struct
import subprocess
import sys

import pytest

MAGIC = {".svg": b"<?xml", ".pdf": b"%PDF-", ".png": b"\x89PNG\r\n\x1a\n"}


def catseye(*arguments):
    return subprocess.run([sys.executable, "-m", "catseye", *map(str, arguments)], capture_output=True, check=False)


def test_each_format_is_written_and_written_again(tmp_path):
    for suffix, magic in MAGIC.items():
        path = tmp_path / f"air{suffix}"
        for _ in range(2):  # the second replaces what is ours
            done = catseye("plot", "air", "--out", path, "--quiet")
            assert done.returncode == 0, done.stderr
        assert path.read_bytes().startswith(magic)
    wide, high = struct.unpack(">II", (tmp_path / "air.png").read_bytes()[16:24])  # the image header's first fields
    assert wide > 1000
    assert high > 600
    assert (tmp_path / "air.pdf").read_bytes().rstrip().endswith(b"%%EOF")


def test_another_suffix_and_anothers_file_are_refused(tmp_path):
    for name in ("air.jpg", "air", "air.html"):
        done = catseye("plot", "air", "--out", tmp_path / name)
        assert done.returncode == 1
        assert b".svg, .pdf or .png" in done.stderr
        assert not (tmp_path / name).exists()
    mine = tmp_path / "mine.png"
    mine.write_bytes(MAGIC[".png"] + b"a photograph")
    assert catseye("plot", "air", "--out", mine).returncode == 1
    assert mine.read_bytes().endswith(b"a photograph")


@pytest.mark.parametrize(
    "command",
    [
        ("certificate", "mirror", "--out"),
        ("triplet", "--blank"),
        ("calibrate", "linearity", "calibrations/linearity.csv", "--certificate"),
    ],
)
def test_a_page_is_html_and_says_how_it_becomes_pdf(tmp_path, command):
    done = catseye(*command, tmp_path / "page.pdf")
    assert done.returncode == 1, done.stdout
    assert b"a page is HTML" in done.stderr
    assert b"prints a page as PDF" in done.stderr
    assert not (tmp_path / "page.pdf").exists()
