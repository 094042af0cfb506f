"""The files of a result, written one by one, and last the provenance with the hashes of all."""

import csv
import hashlib
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.output import PROVENANCE

Files = Mapping[str, Callable[[], str | Iterable[str] | Iterable[bytes]]]
Progress = Callable[[str, int, int], None]


def origin(when: datetime, inputs: Mapping[str, str]) -> dict[str, Any]:
    """When and by what a result was made, and from which files.

    when     UTC
    inputs   SHA-256 of each file read, by its name
    """
    return {"when_utc": when.isoformat(timespec="seconds"), "versions": versions(), "inputs_sha256": dict(inputs)}


def write_files(
    files: Files, directory: Path, provenance: Mapping[str, Any], *, progress: Progress | None = None
) -> None:
    """Each file as text or piece by piece, text or bytes, so that a large one needs no more memory than its columns.

    files        name -> what gives its text, in the order of writing
    directory    exists, and is ours to fill: see `output.whole_directory`
    provenance   what is said of them: at least `format`; their hashes are added
    progress     told of each file
    """
    outputs: dict[str, str] = {}
    for done, (name, page) in enumerate(files.items()):
        if progress is not None:
            progress(f"writing {name}", done, len(files))
        digest = hashlib.sha256()
        text = page()
        with (directory / name).open("wb") as stream:
            for piece in (text,) if isinstance(text, str) else text:
                raw = piece if isinstance(piece, bytes) else piece.encode("utf-8")
                digest.update(raw)
                stream.write(raw)
        outputs[name] = digest.hexdigest()
    (directory / PROVENANCE).write_bytes(json_page({**provenance, "outputs": outputs}).encode("utf-8"))
    if progress is not None:
        progress("writing", len(files), len(files))


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table's text; a number that is none is an empty cell."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow(["" if isinstance(each, float) and math.isnan(each) else each for each in row])
    return stream.getvalue()


def cell(value: Any, form: str) -> str:
    """A number as a cell; empty where there is none."""
    return "" if value is None or not math.isfinite(value) else format(float(value), form)
