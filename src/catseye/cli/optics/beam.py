"""The command of beams."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import tell


@app.command(
    epilog="\b\nExample: catseye beam examples/beams/head.toml --distance-m 120 --out beam\n"
    "Example: catseye beam examples/beams/train.toml --json\n"
    "Layout of FILE: catseye help formats/beam"
)
def beam(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The beam's elements, laser to detector.")],
    distance_m: Annotated[
        float | None,
        typer.Option("--distance-m", help="Distance to the reflector, m; as in FILE if not given."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Sizes, clipping and power of a beam, laser to detector."""
    from catseye.api.optics import beam as beam_of
    from catseye.api.result import require_writable, save

    require_writable(out, file)
    result = beam_of(file, distance_m=distance_m)
    written: tuple[str, ...] = ()
    if out is not None:
        save(result, out)
        written = (f"written to {out}/: beam.csv, returned.csv, beam.json, beam.svg, provenance.json",)
    tell(result, json=json, quiet=quiet, sentences=False, rows=(*result.rows(), *written))
