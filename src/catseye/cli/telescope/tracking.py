"""The command of tracks: counts at t0 and t1 while the telescope moves."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.telescope.ranger import RangerOptions, points_of
from catseye.cli.vocabularies import TELESCOPE_FRAMES, one_of


class _Motion(NamedTuple):
    """Motion of the telescope: a slew from posture to posture, or a star."""

    start_deg: Annotated[
        str | None,
        typer.Option(
            "--start", metavar="AZ,EL", callback=row_of(2, "AZ,EL in degrees"), help="Posture at rest before, deg."
        ),
    ] = None
    end_deg: Annotated[
        str | None,
        typer.Option(
            "--end", metavar="AZ,EL", callback=row_of(2, "AZ,EL in degrees"), help="Posture at rest after, deg."
        ),
    ] = None
    azimuth_rate_deg_per_s: Annotated[
        float | None,
        typer.Option("--azimuth-rate-deg-per-s", help="Fastest rate of the azimuth drive.  [default: 35.2/60]"),
    ] = None
    elevation_rate_deg_per_s: Annotated[
        float | None,
        typer.Option("--elevation-rate-deg-per-s", help="Fastest rate of the elevation drive.  [default: 17.6/60]"),
    ] = None
    star_deg: Annotated[
        str | None,
        typer.Option(
            "--star",
            metavar="RA,DEC",
            callback=row_of(2, "RA,DEC in degrees"),
            help="Star to track instead: right ascension, declination, ICRS J2000, deg.",
        ),
    ] = None
    duration_s: Annotated[float | None, typer.Option("--duration-s", help="Length of the star's track, s.")] = None
    start_mjd: Annotated[
        str | None, typer.Option("--start-at", metavar="TIME", help="Time of the first t0, UTC or MJD.")
    ] = None


@app.command(
    epilog="\b\nExample: catseye track --site gbt --ranger ZY103 --to=0,54,12.2 --start 145,30 --end 146,31 "
    "--out slew\n"
    "         catseye track --monument monuments/ZY103.toml --mirror mirrors/ZP103.toml --to=0,54,12.2 "
    "--start 145,30 --end 146,31 --out offsets\n"
    "         catseye track --site gbt --ranger ZY115 --to=0,54,12.2 --to=20,60,18 --start 145,30 --end 146,31\n"
    "         catseye track --site gbt --ranger ZY103 --to=0,54,12.2 --star 83.63,22.01 --duration-s 60 "
    "--start-at 2003-09-07T09:00:00Z"
)
@grouped
def track(  # noqa: PLR0913 - its options are its command line
    *,
    mounted: RangerOptions,
    to: Annotated[
        list[str] | None,
        typer.Option("--to", metavar="X,Y,Z", callback=points_of, help="Point, m, fixed in --frame; may repeat."),
    ] = None,
    file: Annotated[
        Path | None, typer.Option("--file", metavar="coord.dat", help="Points, a line each: x y z in mm, # comments.")
    ] = None,
    frame: Annotated[
        str,
        typer.Option(
            "--frame",
            metavar=TELESCOPE_FRAMES,
            callback=one_of(TELESCOPE_FRAMES),
            help="Frame that carries the points.",
        ),
    ] = "reflector",
    motion: _Motion,
    interval_s: Annotated[float, typer.Option("--interval-s", help="Time from t0 to t1, s: a buffer's.")] = 0.128,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Counts at t0 and t1 for points that move with the telescope, and the error of linear counts between."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.tracking import track as tracked

    if bool(to) == (file is not None):
        raise typer.BadParameter("give points by --to or by --file, one of the two.", param_hint="'--to'")
    require_writable(out, *(path for path in (*mounted[:3], file) if path is not None))
    result = tracked(
        points=to if file is None else file,
        frame=frame,
        interval_s=interval_s,
        **mounted._asdict(),
        **motion._asdict(),
    )
    if out is not None:
        save(result, out)
    files = None if out is None else f"{out}/: {', '.join(sorted(path.name for path in out.iterdir()))}"
    written = [("Written to", files)]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=written)
