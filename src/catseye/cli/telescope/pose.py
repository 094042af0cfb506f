"""The command of poses."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import OPTICS, POSE_FRAMES, POSE_GROUPS, POSE_WEIGHTS, one_of
from catseye.constants import ARCSECOND

if TYPE_CHECKING:
    from catseye.reduction.pose.verdicts import PoseFindings


def _numbers(text: str, count: int, what: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(math.isfinite(v) for v in numbers):
        raise typer.BadParameter(f"{text!r} is not {what}.")
    return numbers


def _pivot(text: str | None) -> str | None:
    if text is not None:
        _numbers(text, 3, "x,y,z in metres")
    return text


def _posture(text: str | None) -> str | None:
    if text is not None:
        azimuth, elevation = _numbers(text, 2, "AZ,EL in degrees")
        if not (abs(azimuth) <= 540.0 and -5.0 <= elevation <= 95.0):
            raise typer.BadParameter(f"{text!r} is not AZ,EL in degrees, elevation -5 to 95.")
    return text


def _tilt(text: str | None) -> str | None:
    if text is not None and _numbers(text, 3, "X,Y,U in arc seconds")[2] <= 0.0:
        raise typer.BadParameter(f"{text!r} has no uncertainty above 0.")
    return text


@app.command(
    epilog="\b\nExample: catseye pose night-01-report --site examples/night-01 --group dish --frame reflector\n"
    "         catseye pose late-report early-report --site examples/night-01 --pointing prime --out pose-report"
)
def pose(  # noqa: PLR0913 - its options are its command line
    epoch: Annotated[
        Path, typer.Argument(metavar="EPOCH", help="What catseye reduce --out wrote, or its coordinates.json.")
    ],
    earlier: Annotated[
        Path | None, typer.Argument(metavar="[EARLIER]", help="The epoch to count from; the site's design without.")
    ] = None,
    site: Annotated[
        Path | None, typer.Option("--site", metavar="DIR", help="Site or campaign whose records say what stands where.")
    ] = None,
    group: Annotated[
        str | None,
        typer.Option(
            "--group", metavar=POSE_GROUPS, callback=one_of(POSE_GROUPS), help="What moves as one.  [default: dish]"
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
            callback=_pivot,
            help="Of the rotation, m, in the frame; vertex, focus or mean of the points without.",
        ),
    ] = None,
    robust: Annotated[
        str | None,
        typer.Option(
            "--robust", metavar=POSE_WEIGHTS, callback=one_of(POSE_WEIGHTS), help="Leave out points that moved alone."
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
    tilt: Annotated[
        str | None,
        typer.Option(
            "--tilt", metavar="X,Y,U", callback=_tilt, help="Inclinometer on the alidade, arcsec, its zero taken out."
        ),
    ] = None,
    posture: Annotated[
        str | None,
        typer.Option("--posture", metavar="AZ,EL", callback=_posture, help="Of EPOCH; its pose.json's without."),
    ] = None,
    earlier_posture: Annotated[
        str | None,
        typer.Option("--earlier-posture", metavar="AZ,EL", callback=_posture, help="Of EARLIER; as above."),
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
    """Six degrees of freedom of a part of the antenna between two epochs or against design; beam and focus too."""
    if group is not None and points is not None:
        raise typer.BadParameter("cannot go with --group: one of the two.", param_hint="'--points'")
    if site is None:
        raise typer.BadParameter("is needed: what stands where.", param_hint="'--site'")
    if tilt is not None and (group != "alidade" or (frame or "alidade") != "alidade"):
        raise typer.BadParameter("belongs to --group alidade in the frame alidade.", param_hint="'--tilt'")
    if pointing is not None and (points is not None or frame not in (None, "reflector") or group not in (None, "dish")):
        raise typer.BadParameter("is of the dish in the frame reflector.", param_hint="'--pointing'")
    sources = [p for p in (epoch, earlier, site) if p is not None]
    if out is not None:
        from catseye.gateways.writers.output import refuse_output

        refuse_output(out, *sources)
    progress = ProgressLine(quiet)
    try:
        progress("fitting", 0, 1)
        from catseye.api.pose import pose as posed
        from catseye.api.result import save

        result = posed(
            epoch,
            earlier,
            site=site,
            group=group,
            points=None if points is None else [p.strip() for p in points.split(",")],
            frame=frame,
            pivot=None if pivot is None else _numbers(pivot, 3, "x,y,z in metres"),
            robust=robust,
            pointing=None if pointing is None else "prime" if pointing == "prime" else "gregorian",
            tilt_arcsec=None if tilt is None else _numbers(tilt, 3, "X,Y,U in arc seconds"),
            posture_deg=_angles(posture),
            earlier_posture_deg=_angles(earlier_posture),
        )
        if out is not None:
            save(result, out)
    finally:
        progress.clear()
    written = [] if out is None else [("Written to", f"{out}/: report.html, points.csv, pose.json")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=_rows(result.found), written=written)


def _angles(posture: str | None) -> list[float] | None:
    return None if posture is None else _numbers(posture, 2, "AZ,EL in degrees")


def _rows(found: "PoseFindings") -> list[str]:
    """The six numbers, and the beam's with what they are made of."""
    from catseye.gateways.pose.objects import beam_rows, pose_rows

    def lines(rows: list[tuple[str, str, str, str]]) -> list[str]:
        return [f"{'':<14}{name:<20}{value:>12} {unit:<7} u {u}" for name, value, u, unit in rows]

    rows = lines(pose_rows(found))
    if found.beam is not None:
        rows += ["", "The beam (its correction is the opposite)", *lines(beam_rows(found.beam))]
        for name, part in found.beam.terms.items():
            a, b, c = part[0] / ARCSECOND, part[1] / ARCSECOND, part[2] * 1e3
            rows.append(f"{'':<14}{name:<36}{a:+9.3f} {b:+9.3f} arcsec {c:+9.3f} mm")
    return rows
