"""Certificates as PDF: the same bytes twice, their metadata, and no text that is taken for markup."""

import dataclasses
import json
import re
import sys
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest

import catseye
from catseye.errors import InputError
from catseye.gateways.certificates.document import CellTable
from catseye.gateways.certificates.pdf import certificate_pdf, typeset

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def typst():
    return pytest.importorskip("typst", reason="typst is not installed: the extra catseye[pdf]")


def texts(document, element):
    """Every text of an element of the typeset document, without the places where a word may break."""
    found = []

    def walk(node):
        if isinstance(node, dict):
            if node.get("func") == "text":
                found.append(node["text"].replace("\u200b", ""))
            for value in node.values():
                walk(value)
        elif isinstance(node, list):
            for value in node:
                walk(value)

    walk(json.loads(typeset(document).query(element)))
    return found


def test_without_typst_one_line_says_what_to_install(monkeypatch, document):
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(InputError, match=r'needs typst, which is missing \(expected: pip install "catseye\[pdf\]"'):
        certificate_pdf(document)


def test_a_certificate_has_the_same_bytes_twice_with_its_title_author_and_day(typst, document):
    content = certificate_pdf(document)
    assert content == certificate_pdf(document)
    assert content.startswith(b"%PDF")
    metadata = content[content.index(b"<?xpacket begin") :].decode("utf-8", "replace")
    assert "Certificate of calibration EX-2026-0143: Zero and linearity of ZP103" in metadata
    assert re.search(r"<dc:creator>.*Example Length Laboratory.*</dc:creator>", metadata)
    assert set(re.findall(r"<xmp:(?:Create|Modify)Date>([^<]*)<", metadata)) == {"2026-09-04T00:00:00Z"}
    for mark in document.marks:
        assert mark in metadata
    assert int(re.search(rb"/Type/Pages/Count (\d+)", content)[1]) >= 4


def test_hostile_texts_come_out_as_texts(hostile, hostile_texts):
    certificate_pdf(hostile)
    assert f"Certificate of calibration {hostile.number}" in texts(hostile, "heading.where(level: 1)")
    cells = texts(hostile, "table")
    for text in hostile_texts:
        assert text in cells


def test_every_cell_of_every_table_is_set(typst, document):
    cells = set(texts(document, "table"))
    for chapter in (document.results, *document.chapters):
        for block in chapter.blocks:
            for row in block.rows if isinstance(block, CellTable) else ():
                for cell, kind in zip(row, block.kinds, strict=True):
                    minus = kind == "n" and cell.startswith("-")
                    assert not cell or ("−" + cell[1:] if minus else cell) in cells


@pytest.mark.parametrize("kind", ["inclinometer", "search-results"])  # the widest tables: 11 columns, 13 correlations
def test_nothing_stands_beyond_the_margins(typst, document_of, kind):
    document = document_of(catseye.calibrate(kind, f"calibrations/{kind}.csv"))
    pages = typeset(document).compile(format="png", ppi=40.0)
    assert len(pages) > 3
    for page in pages:
        grey = matplotlib.image.imread(BytesIO(page), format="png")[..., :3].mean(axis=2)
        margin = int(grey.shape[1] * 17 / 210)  # mm; the margin is 18
        assert grey[:, :margin].min() == grey[:, -margin:].min() == 1.0


def test_a_logo_of_either_kind_is_drawn_and_a_broken_one_is_one_line(typst, document):
    stream = BytesIO()
    matplotlib.image.imsave(stream, np.full((20, 40), 0.3), format="png")
    for logo in (stream.getvalue(), document.letterhead.logo):
        drawn = dataclasses.replace(document, letterhead=document.letterhead._replace(logo=logo))
        assert len(certificate_pdf(drawn)) > 10_000
    broken = dataclasses.replace(document, letterhead=document.letterhead._replace(logo=PNG + b"nothing"))
    with pytest.raises(InputError, match=r"the PDF cannot be made: .*expected another logo") as problem:
        certificate_pdf(broken)
    assert len(str(problem.value).splitlines()) == 1
