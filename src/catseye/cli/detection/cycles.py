"""The command of whole cycles."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell


@app.command(
    epilog="\b\nExample: catseye cycles examples/cycles/three-frequencies.csv --group-index 1.000253 --out lengths\n"
    "Layout of TABLE: catseye help formats/cycles"
)
def cycles(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE.csv", help="Phases of shots at two or more modulation frequencies each.")
    ],
    shortest: Annotated[float, typer.Option("--shortest", help="Smallest possible length, m.")] = 5.0,
    longest: Annotated[float, typer.Option("--longest", help="Largest possible length, m.")] = 200.0,
    group_index: Annotated[
        float, typer.Option("--group-index", help="Group index of the air; 1 gives optical lengths.")
    ] = 1.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: figure, table, JSON.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Whole cycles and lengths from phases at several modulation frequencies, without approximate lengths."""
    from catseye.api.detection.cycles import cycles as cycles_of
    from catseye.api.result import require_writable, save

    require_writable(out, table)
    result = cycles_of(table, shortest=shortest, longest=longest, group_index=group_index)
    if out is not None:
        save(result, out)
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", out)])
