"""Verdicts of written results, for results based on them."""

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
    """Verdict in a written result; None for older ones without.

    file       file name, for messages
    document   object in the file

    Raises InputError for a verdict with an unknown word or without reason.
    """
    stored = document.get("verdict")
    if stored is None:
        return None
    word, why = (stored.get("word"), stored.get("why")) if isinstance(stored, Mapping) else (None, None)
    if word not in ORDER or not isinstance(why, str):
        raise refusal(file, f"verdict = {shown(stored)} (expected word, one of {', '.join(ORDER)}, and why)")
    return Verdict(cast(Word, word), why)


def verdict_of_table(path: Path) -> Verdict | None:
    """Verdict of the reduction that wrote a table; None for other tables.

    path   CSV, unchanged, with coordinates.json and provenance.json of the same `catseye reduce`
    """
    folder = Folder(path.parent)
    if not all((path.parent / name).is_file() for name in (PROVENANCE, RESULT)):
        return None
    try:
        outputs = json.loads(folder.text(PROVENANCE)).get("outputs", {})
        unchanged = outputs.get(path.name) == hashlib.sha256(path.read_bytes()).hexdigest()
        document = json.loads(folder.text(RESULT)) if unchanged else {}
    except (ValueError, RecursionError, AttributeError):  # foreign files of these names
        return None
    return stored_verdict(str(path.parent / RESULT), document) if isinstance(document, dict) else None


def verdict_of_export(folder: Folder) -> Verdict | None:
    """Verdict of the export that wrote a campaign; None for other campaigns.

    folder   of the campaign
    """
    if not (folder.directory / PROVENANCE).is_file():
        return None
    try:
        document = json.loads(folder.text(PROVENANCE))
    except (ValueError, RecursionError):  # a foreign file of this name
        return None
    if not isinstance(document, dict) or document.get("format") != EXPORT:
        return None
    return stored_verdict(PROVENANCE, document)
