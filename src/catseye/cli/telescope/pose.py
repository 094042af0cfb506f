"""The command of poses."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.numbers import row_of
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import OPTICS, POSE_FRAMES, POSE_GROUPS, POSE_WEIGHTS, one_of

POSTURE = row_of(2, "AZ,EL in degrees")


@app.command(
    epilog="\b\nExample: catseye pose night-01-report --site examples/night-01 --group dish --frame reflector\n"
    "         catseye pose late-report early-report --site examples/night-01 --pointing prime --out pose-report\n"
    "         catseye pose later.csv earlier.csv --pivot 0,0,9"
)
def pose(  # noqa: PLR0913 - its options are its command line
    epoch: Annotated[
        Path, typer.Argument(metavar="EPOCH", help="Output of catseye reduce --out, or a table of points.")
    ],
    earlier: Annotated[
        Path | None,
        typer.Argument(metavar="[EARLIER]", help="Earlier epoch to compare with; the site's design if not given."),
    ] = None,
    *,
    site: Annotated[
        Path | None,
        typer.Option(
            "--site", metavar="DIR", help="Site or campaign whose records say what stands where; not for two tables."
        ),
    ] = None,
    group: Annotated[
        str | None,
        typer.Option(
            "--group",
            metavar=POSE_GROUPS,
            callback=one_of(POSE_GROUPS),
            help="Part that moves as one.  [default: dish]",
        ),
    ] = None,
    points: Annotated[
        str | None, typer.Option("--points", metavar="A,B,C,...", help="Points that move as one, instead of a group.")
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            "--frame", metavar=POSE_FRAMES, callback=one_of(POSE_FRAMES), help="Axes of the answer.  [default: ground]"
        ),
    ] = None,
    pivot: Annotated[
        str | None,
        typer.Option(
            "--pivot",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z in metres"),
            help="Centre of rotation, m, in the frame; vertex, focus or mean of the points if not given.",
        ),
    ] = None,
    robust: Annotated[
        str | None,
        typer.Option(
            "--robust",
            metavar=POSE_WEIGHTS,
            callback=one_of(POSE_WEIGHTS),
            help="Robust weights, which leave out points that moved on their own.",
        ),
    ] = None,
    pointing: Annotated[
        str | None,
        typer.Option(
            "--pointing",
            metavar=OPTICS,
            callback=one_of(OPTICS),
            help="Beam and focus too, from the dish and feed arm (prime) or subreflector (gregorian).",
        ),
    ] = None,
    tilt_arcsec: Annotated[
        str | None,
        typer.Option(
            "--tilt",
            metavar="X,Y,U",
            callback=row_of(3, "X,Y,U in arc seconds"),
            help="Inclinometer on the alidade, arcsec, with its zero removed.",
        ),
    ] = None,
    posture_deg: Annotated[
        str | None,
        typer.Option(
            "--posture", metavar="AZ,EL", callback=POSTURE, help="Posture of EPOCH; from its pose.json if not given."
        ),
    ] = None,
    earlier_posture_deg: Annotated[
        str | None,
        typer.Option(
            "--earlier-posture",
            metavar="AZ,EL",
            callback=POSTURE,
            help="Posture of EARLIER; from its pose.json if not given.",
        ),
    ] = None,
    u_mm: Annotated[
        float | None,
        typer.Option("--u-mm", min=1e-6, max=100.0, help="u of each coordinate of EPOCH, a table without u, mm."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Pose of a part of the antenna, six degrees of freedom, between two epochs or against design; beam and focus."""
    from catseye.api.pose import pose as posed
    from catseye.api.result import require_writable, save

    require_writable(out, *(p for p in (epoch, earlier, site) if p is not None))
    progress = ProgressLine(quiet)
    try:
        progress("fitting", 0, 1)
        result = posed(
            epoch,
            earlier,
            site=site,
            group=group,
            points=None if points is None else [p.strip() for p in points.split(",")],
            frame=frame,
            pivot=pivot,
            robust=robust,
            pointing=pointing,
            tilt_arcsec=tilt_arcsec,
            posture_deg=posture_deg,
            earlier_posture_deg=earlier_posture_deg,
            u_mm=u_mm,
        )
        if out is not None:
            save(result, out)
    finally:
        progress.clear()
    written = [] if out is None else [("Written to", f"{out}/: report.html, points.csv, pose.json")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)
