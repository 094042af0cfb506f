"""Certificate as PDF by typst: the same bytes for the same content."""

import json
from typing import Any

from catseye.errors import InputError
from catseye.gateways.calibrations.certificate_typst import TEMPLATE
from catseye.gateways.calibrations.document import (
    NOT_STATED,
    Block,
    CertificateDocument,
    Chapter,
    Drawing,
    Facts,
    Grid,
    Listing,
    Paragraph,
)
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
        "heading": document.heading,
        "subject": document.subject,
        "foot": letterhead.name,
        "logo": _picture(letterhead.logo) if letterhead.logo else None,
        "laboratory": {
            "name": letterhead.name,
            "lines": list(letterhead.lines),
            "accreditation": letterhead.accreditation,
        },
        "verdict": {"word": document.verdict.word, "why": document.verdict.why},
        "facts": document.facts.rows,
        "signatures": document.signatures,
        "results": _chapter(document.results),
        "chapters": [_chapter(chapter) for chapter in document.chapters],
    }


def _chapter(chapter: Chapter) -> dict[str, Any]:
    return {"title": chapter.title, "blocks": [_block(block) for block in chapter.blocks]}


def _block(block: Block) -> dict[str, Any]:
    match block:
        case Facts():
            return {"kind": "facts", "rows": block.rows}
        case Paragraph():
            return {"kind": "paragraph", "text": block.text, "faint": block.faint}
        case Grid():
            rows = [list(row) for row in block.rows]
            return {"kind": "grid", "columns": block.columns, "kinds": list(block.kinds), "rows": rows,
                    "caption": block.caption}  # fmt: skip
        case Drawing():
            return {"kind": "drawing", "image": _picture(block.svg.encode()), "caption": block.caption}
        case Listing():
            return {"kind": "listing", "caption": block.caption, "lines": block.lines}


def _picture(content: bytes) -> dict[str, Any]:
    """Picture as JSON: typst takes its bytes as numbers."""
    return {"bytes": list(content), "format": "png" if content.startswith(PNG) else "svg"}
