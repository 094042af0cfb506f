"""Certificate as PDF by typst: the same bytes for the same content."""

import json
from collections.abc import Sequence
from typing import Any

from catseye.errors import InputError
from catseye.gateways.certificates.document import (
    NOT_STATED,
    Block,
    CellTable,
    CertificateDocument,
    Chapter,
    Facts,
    Listing,
    Paragraph,
    SvgPicture,
    breakable,
    cells_of,
)
from catseye.gateways.certificates.layout import TEMPLATE
from catseye.version import __version__

PNG = b"\x89PNG"
INSTALL = 'pip install "catseye[pdf]"'


def certificate_pdf(document: CertificateDocument) -> bytes:
    """PDF of a certificate, dated by its issue.

    Raises InputError where typst is not installed, or a picture cannot be drawn.
    """
    compiler = typeset(document)
    try:
        return bytes(compiler.compile(format="pdf"))
    except RuntimeError as problem:  # typst's own error is one
        reason = " ".join(str(problem).split())
        raise InputError(f"the PDF cannot be made: {reason} (expected another logo, or a page .html)") from problem


def typeset(document: CertificateDocument) -> Any:
    """Compiler of typst for a document: without fonts of the system, and without a folder to read from.

    Raises InputError where typst is not installed.
    """
    try:
        from typst import Compiler
    except ImportError as problem:
        raise InputError(f"a PDF needs typst, which is missing (expected: {INSTALL}; or a page .html)") from problem
    inputs = {"certificate": json.dumps(_data(document))}
    return Compiler(TEMPLATE.encode(), ignore_system_fonts=True, sys_inputs=inputs)


def _data(document: CertificateDocument) -> dict[str, Any]:
    day, letterhead = document.issued_on, document.letterhead
    return {
        "title": f"{document.heading}: {document.subject}",
        "author": letterhead.name,
        "keywords": [*document.marks, f"catseye {__version__}"],
        "date": [day.year, day.month, day.day],
        "missing": NOT_STATED,
        "heading": breakable(document.heading),
        "subject": breakable(document.subject),
        "foot": breakable(letterhead.name),
        "logo": _picture(letterhead.logo) if letterhead.logo else None,
        "laboratory": {
            "name": breakable(letterhead.name),
            "lines": [breakable(line) for line in letterhead.lines],
            "accreditation": breakable(letterhead.accreditation),
        },
        "verdict": {"word": document.verdict.word, "why": breakable(document.verdict.why)},
        "facts": _rows(document.facts.rows),
        "signatures": _rows(document.signatures),
        "results": _chapter(document.results),
        "chapters": [_chapter(chapter) for chapter in document.chapters],
    }


def _chapter(chapter: Chapter) -> dict[str, Any]:
    return {"title": chapter.title, "blocks": [_block(block) for block in chapter.blocks]}


def _block(block: Block) -> dict[str, Any]:
    match block:
        case Facts():
            return {"kind": "facts", "rows": _rows(block.rows)}
        case Paragraph():
            return {"kind": "paragraph", "text": breakable(block.text), "faint": block.faint}
        case CellTable():
            return {"kind": "grid", "columns": block.columns, "kinds": list(block.kinds), "rows": cells_of(block),
                    "caption": breakable(block.caption)}  # fmt: skip
        case SvgPicture():
            return {"kind": "drawing", "image": _picture(block.svg.encode()), "caption": breakable(block.caption)}
        case Listing():
            return {"kind": "listing", "caption": block.caption, "lines": [breakable(line) for line in block.lines]}


def _rows(rows: Sequence[tuple[str, ...]]) -> list[list[str]]:
    return [[breakable(cell) for cell in row] for row in rows]


def _picture(content: bytes) -> dict[str, Any]:
    """Picture as JSON: typst takes its bytes as numbers."""
    return {"bytes": list(content), "format": "png" if content.startswith(PNG) else "svg"}
