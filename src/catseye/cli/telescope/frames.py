"""The command of frames: points of one frame of a telescope in another."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.results import Strict, tell
from catseye.cli.telescope.ranger import points_of
from catseye.cli.vocabularies import TELESCOPE_FRAMES, one_of


@app.command(
    epilog="\b\nExample: catseye convert --point 0,0,60 --from-frame reflector --to-frame ground --posture 90,45\n"
    "         catseye convert --file night --from-frame ground --to-frame reflector --site night-01 --out dish\n"
    "night: catseye reduce night-01 --out night"
)
def convert(  # noqa: PLR0913 - its options are its command line
    *,
    point: Annotated[
        list[str] | None,
        typer.Option("--point", metavar="X,Y,Z", callback=points_of, help="Point, m, in --from-frame; may repeat."),
    ] = None,
    file: Annotated[
        Path | None,
        typer.Option(
            "--file", metavar="POINTS", help="coord.dat (mm), a CSV table of points, or a directory of `reduce`."
        ),
    ] = None,
    from_frame: Annotated[
        str,
        typer.Option(
            "--from-frame", metavar=TELESCOPE_FRAMES, callback=one_of(TELESCOPE_FRAMES), help="Frame of the points."
        ),
    ],
    to_frame: Annotated[
        str,
        typer.Option(
            "--to-frame", metavar=TELESCOPE_FRAMES, callback=one_of(TELESCOPE_FRAMES), help="Frame of the answer."
        ),
    ],
    posture_deg: Annotated[
        str | None,
        typer.Option(
            "--posture",
            metavar="AZ,EL",
            callback=row_of(2, "AZ,EL in degrees"),
            help="Posture of the telescope, deg; that of the reduction or the site if not given.",
        ),
    ] = None,
    site: Annotated[
        Path | None,
        typer.Option("--site", metavar="SITE", help="Site whose lengths count; the notes' lengths if not given."),
    ] = None,
    u_mm: Annotated[
        str | None,
        typer.Option(
            "--u-mm",
            metavar="UX,UY,UZ",
            callback=row_of(3, "UX,UY,UZ in millimetres"),
            help="Standard uncertainty of each coordinate, mm, in --from-frame.",
        ),
    ] = None,
    u_posture_arcsec: Annotated[
        str | None,
        typer.Option(
            "--u-posture-arcsec",
            metavar="UAZ,UEL",
            callback=row_of(2, "UAZ,UEL in arcseconds"),
            help="Standard uncertainty of azimuth and elevation, arcsec.",
        ),
    ] = None,
    subreflector_shift_mm: Annotated[
        str | None,
        typer.Option(
            "--subreflector-shift-mm",
            metavar="X,Y,Z",
            callback=row_of(3, "X,Y,Z in millimetres"),
            help="Shift of the subreflector from rest, mm, prime-focus axes.",
        ),
    ] = None,
    subreflector_turn_deg: Annotated[
        str | None,
        typer.Option(
            "--subreflector-turn-deg",
            metavar="X,Y,Z",
            callback=row_of(3, "X,Y,Z in degrees"),
            help="Turn of the subreflector about x, then y, then z of the prime-focus frame, deg.",
        ),
    ] = None,
    subreflector_pivot_mm: Annotated[
        str | None,
        typer.Option(
            "--subreflector-pivot-mm",
            metavar="X,Y,Z",
            callback=row_of(3, "X,Y,Z in millimetres"),
            help="Pivot of these turns, mm, prime-focus frame; its origin if not given.",
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
    """Points of one frame of the telescope in another: ground, reflector, feed arm, prime focus and so on."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.frames import convert as converted

    if bool(point) == (file is not None):
        raise typer.BadParameter("give points by --point or by --file, one of the two.", param_hint="'--point'")
    require_writable(out, *(path for path in (file, site) if path is not None))
    result = converted(
        point if file is None else file,
        from_frame=from_frame,
        to_frame=to_frame,
        posture_deg=posture_deg,
        site=site,
        u_mm=u_mm,
        u_posture_arcsec=u_posture_arcsec,
        subreflector_shift_mm=subreflector_shift_mm,
        subreflector_turn_deg=subreflector_turn_deg,
        subreflector_pivot_mm=subreflector_pivot_mm,
    )
    if out is not None:
        save(result, out)
    files = None if out is None else f"{out}/: points.csv, frames.svg, result.json, provenance.json"
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", files)])
