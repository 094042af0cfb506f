"""Write the files of a result, and last the provenance with their hashes."""

import csv
import hashlib
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.output import PROVENANCE

Files = Mapping[str, Callable[[], str | bytes | Iterable[str] | Iterable[bytes]]]


def origin(when: datetime, inputs: Mapping[str, str]) -> dict[str, Any]:
    """Provenance of a result: time, versions and input hashes.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    return {"when_utc": when.isoformat(timespec="seconds"), "versions": versions(), "inputs_sha256": dict(inputs)}


def write_files(
    files: Files, directory: Path, provenance: Mapping[str, Any], *, progress: Progress | None = None
) -> None:
    """Write each file piece by piece, so that a large one needs little memory.

    files        name -> function that returns its text or bytes, whole or in pieces, in the order of writing
    directory    existing, from `output.atomic_directory`
    provenance   at least `format`; the files' hashes are added
    progress     called for each file
    """
    outputs: dict[str, str] = {}
    for count, (name, page) in enumerate(files.items()):
        if progress is not None:
            progress(f"writing {name}", count, len(files))
        digest = hashlib.sha256()
        text = page()
        with (directory / name).open("wb") as stream:
            for piece in (text,) if isinstance(text, str | bytes) else text:
                raw = piece if isinstance(piece, bytes) else piece.encode("utf-8")
                digest.update(raw)
                stream.write(raw)
        outputs[name] = digest.hexdigest()
    (directory / PROVENANCE).write_bytes(json_page({**provenance, "outputs": outputs}).encode("utf-8"))
    if progress is not None:
        progress("writing", len(files), len(files))


def add_output(directory: Path, name: str) -> None:
    """Add a file that stands in a directory beside what `write_files` wrote to its provenance."""
    provenance = json.loads((directory / PROVENANCE).read_text(encoding="utf-8"))
    with (directory / name).open("rb") as stream:
        provenance["outputs"][name] = hashlib.file_digest(stream, "sha256").hexdigest()
    (directory / PROVENANCE).write_bytes(json_page(provenance).encode("utf-8"))


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """CSV text; NaN becomes an empty cell."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return stream.getvalue()


def cell(value: Any, form: str) -> str:
    """Number as a cell; empty if None or not finite."""
    return "" if value is None or not math.isfinite(value) else format(float(value), form)
