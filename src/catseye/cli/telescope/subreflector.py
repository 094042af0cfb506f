"""The command of a subreflector: six degrees of freedom and the lengths of six actuators."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.results import Strict, tell


@app.command(
    epilog="\b\nExample: catseye subreflector subreflector/hexapod.toml --shift-mm 0,0,10 --turn-deg 0.2,0,0\n"
    "         catseye subreflector subreflector/hexapod.toml --lengths-mm 2345,2345,2344,2344,2346,2346 --out moved\n"
    "         catseye subreflector subreflector/hexapod.toml --pose pose-report/pose.json"
)
def subreflector(  # noqa: PLR0913 - its options are its command line
    mount: Annotated[Path, typer.Argument(metavar="SUB.toml", help="Actuators of the subreflector.")],
    *,
    shift_mm: Annotated[
        str | None,
        typer.Option(
            "--shift-mm",
            metavar="X,Y,Z",
            callback=row_of(3, "X,Y,Z in millimetres"),
            help="Wanted shift of the pivot from rest, mm, prime-focus axes; 0 if not given.",
        ),
    ] = None,
    turn_deg: Annotated[
        str | None,
        typer.Option(
            "--turn-deg",
            metavar="X,Y,Z",
            callback=row_of(3, "X,Y,Z in degrees"),
            help="Wanted turn about x, then y, then z, deg; 0 if not given.",
        ),
    ] = None,
    lengths_mm: Annotated[
        str | None,
        typer.Option(
            "--lengths-mm",
            metavar="L1,...,L6",
            callback=row_of(6, "six lengths in millimetres"),
            help="Lengths of the actuators between their joints, mm, instead.",
        ),
    ] = None,
    pose: Annotated[
        Path | None,
        typer.Option(
            "--pose", metavar="POSE.json", help="Measured pose of the subreflector, reflector frame, instead."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Six degrees of freedom of a subreflector from the lengths of its actuators, and the other way."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.subreflector import subreflector as state_of

    require_writable(out, *(path for path in (mount, pose) if path is not None))
    result = state_of(mount, shift_mm=shift_mm, turn_deg=turn_deg, lengths_mm=lengths_mm, pose=pose)
    if out is not None:
        save(result, out)
    names = "position.csv, lengths.csv, actuators.svg, result.json, provenance.json"
    files = None if out is None else f"{out}/: {names}"
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", files)])
