"""Verdicts of written results, for what rests on them."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.verdict import ORDER, Verdict, Word

PROVENANCE, RESULT = "provenance.json", "coordinates.json"
EXPORT = "catseye-journal-export-1"  # format of the provenance of an exported campaign


def stored_verdict(file: str, document: Mapping[str, Any]) -> Verdict | None:
    """The verdict that a written result carries; None of an older one that has none.

    file       for messages
    document   the object in the file

    Raises InputError for a verdict with another word or without its reason.
    """
    stored = document.get("verdict")
    if stored is None:
        return None
    word, why = (stored.get("word"), stored.get("why")) if isinstance(stored, Mapping) else (None, None)
    if word not in ORDER or not isinstance(why, str):
        raise refusal(file, f"verdict = {shown(stored)} (expected word, one of {', '.join(ORDER)}, and why)")
    return Verdict(cast(Word, word), why)


def verdict_of_table(path: Path) -> Verdict | None:
    """The verdict of the reduction that wrote a table; None of a table that no reduction beside it wrote so.

    path   CSV that stands, unchanged, beside coordinates.json and provenance.json of the same `catseye reduce`
    """
    folder = Folder(path.parent)
    if not all((path.parent / name).is_file() for name in (PROVENANCE, RESULT)):
        return None
    try:
        outputs = json.loads(folder.text(PROVENANCE)).get("outputs", {})
        same = outputs.get(path.name) == hashlib.sha256(path.read_bytes()).hexdigest()
        document = json.loads(folder.text(RESULT)) if same else {}
    except (ValueError, RecursionError, AttributeError):  # other people's files of these names say nothing
        return None
    return stored_verdict(str(path.parent / RESULT), document) if isinstance(document, dict) else None


def verdict_of_export(folder: Folder) -> Verdict | None:
    """The verdict of the export that wrote a campaign; None where another hand wrote it.

    folder   the campaign's
    """
    if not (folder.directory / PROVENANCE).is_file():
        return None
    try:
        document = json.loads(folder.text(PROVENANCE))
    except (ValueError, RecursionError):  # other people's file of this name says nothing
        return None
    if not isinstance(document, dict) or document.get("format") != EXPORT:
        return None
    return stored_verdict(PROVENANCE, document)
