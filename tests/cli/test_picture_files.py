"""A suffix says the format: figures are SVG, PDF or PNG, pages HTML, and nothing is written under another name."""

import struct

import pytest

from command_scene import command_line

MAGIC = {".svg": b"<?xml", ".pdf": b"%PDF-", ".png": b"\x89PNG\r\n\x1a\n"}


@pytest.fixture
def catseye(capsys):
    return command_line(capsys)


def test_each_format_is_written_and_written_again(catseye, tmp_path):
    for suffix, magic in MAGIC.items():
        path = tmp_path / f"air{suffix}"
        for _ in range(2):  # the second replaces what is ours
            assert catseye("plot", "air", "--out", path, "--quiet") == (0, "", "")
        assert path.read_bytes().startswith(magic)
    wide, high = struct.unpack(">II", (tmp_path / "air.png").read_bytes()[16:24])  # the image header's first fields
    assert wide > 1000
    assert high > 600
    assert (tmp_path / "air.pdf").read_bytes().rstrip().endswith(b"%%EOF")


def test_another_suffix_and_anothers_file_are_refused(catseye, tmp_path):
    for name in ("air.jpg", "air", "air.html"):
        status, _, complaint = catseye("plot", "air", "--out", tmp_path / name)
        assert status == 1
        assert ".svg, .pdf or .png" in complaint
        assert not (tmp_path / name).exists()
    mine = tmp_path / "mine.png"
    mine.write_bytes(MAGIC[".png"] + b"a photograph")
    assert catseye("plot", "air", "--out", mine)[0] == 1
    assert mine.read_bytes().endswith(b"a photograph")


@pytest.mark.parametrize(
    "command",
    [
        ("certificate", "mirror", "--out"),
        ("triplet", "--blank"),
    ],
)
def test_a_page_is_html_and_says_how_it_becomes_pdf(catseye, tmp_path, command):
    status, _, complaint = catseye(*command, tmp_path / "page.pdf")
    assert status == 1
    assert "a page is HTML" in complaint
    assert "prints a page as PDF" in complaint
    assert not (tmp_path / "page.pdf").exists()
