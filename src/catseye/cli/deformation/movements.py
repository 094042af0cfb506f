"""The command of movements between two epochs."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell


@app.command(
    epilog="\b\nExample: catseye movements movements/before.csv movements/after.csv --points movements/points.csv "
    "--constraints movements/constraints.toml --air-ppm 0.5"
)
def movements(  # noqa: PLR0913 - its options are its command line
    *,
    before: Annotated[Path, typer.Argument(metavar="BEFORE.csv", help="Ranges of the first epoch: from,to,distance.")],
    after: Annotated[Path, typer.Argument(metavar="AFTER.csv", help="Ranges of the same lines, later.")],
    points: Annotated[
        Path, typer.Option("--points", metavar="POINTS.csv", help="Approximate coordinates: point,x,y,z,u_x,u_y,u_z.")
    ],
    constraints: Annotated[
        Path | None,
        typer.Option(
            "--constraints",
            metavar="FILE.toml",
            help="Points that move together, in a plane, on a line, or not at all.",
        ),
    ] = None,
    air_ppm: Annotated[
        float,
        typer.Option("--air-ppm", help="Standard uncertainty of the change of the air's index, common to all, ppm."),
    ] = 0.0,
    level: Annotated[
        float, typer.Option("--level", help="Significance level of the tests, for all of a kind together.")
    ] = 0.05,
    sigma_mm: Annotated[
        float | None,
        typer.Option("--sigma-mm", help="Standard uncertainty a + b D of ranges that have none: a, mm."),
    ] = None,
    sigma_ppm: Annotated[
        float | None, typer.Option("--sigma-ppm", help="Standard uncertainty a + b D of ranges that have none: b, ppm.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Movements between two epochs from changes of range, with constraints."""
    from catseye.api.deformation.movements import movements as measured
    from catseye.api.result import require_writable, save

    require_writable(out, before, after, points, constraints)
    result = measured(
        before,
        after,
        points,
        constraints=constraints,
        air_ppm=air_ppm,
        level=level,
        sigma_mm=sigma_mm,
        sigma_ppm=sigma_ppm,
    )
    if out is not None:
        save(result, out)
    files = (
        [] if out is None else [("Written to", f"{out}/: report.html, movements.json, movements.csv, changes.csv, ...")]
    )
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=files)
