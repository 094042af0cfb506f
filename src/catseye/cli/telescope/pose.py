"""The command of poses."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import OPTICS, POSE_FRAMES, POSE_GROUPS, POSE_WEIGHTS, one_of
from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.gateways.pose.objects import PoseResult
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.site.folder import SiteFolder

CARRIED = {"prime": "feed-arm", "gregorian": "subreflector"}


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
    json: Json = False,
    quiet: Quiet = False,
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
    from catseye.gateways.writers.output import refuse_output, whole_directory
    from catseye.records.network.solved_points import read_solved_points
    from catseye.records.site.folder import read_site

    sources = [p for p in (epoch, earlier, site) if p is not None]
    if out is not None:
        for source in sources:
            refuse_output(out, source)
    progress = ProgressLine(quiet)
    try:
        progress("reading", 0, len(sources))
        later = _with_posture(read_solved_points(epoch), posture)
        before = None if earlier is None else _with_posture(read_solved_points(earlier), earlier_posture)
        records = read_site(site)
        inputs = {**later.hashes, **({} if before is None else before.hashes), **records.hashes}
        progress("fitting", 1, 2)
        wanted = _Wanted(
            group=None if points is not None else group or "dish",
            points=None if points is None else [p.strip() for p in points.split(",")],
            frame=frame or ("reflector" if pointing else "alidade" if tilt else "ground"),
            pivot=None if pivot is None else _numbers(pivot, 3, "x,y,z in metres"),
            robust=robust,
            pointing=pointing,
            tilt=None if tilt is None else _numbers(tilt, 3, "X,Y,U in arc seconds"),
        )
        result = _result(later, before, records, wanted)
        if out is not None:
            from catseye.gateways.pose.files import write_pose

            asked = {"group": wanted.group, "points": points, "frame": wanted.frame, "pivot": pivot, "robust": robust}
            with whole_directory(out, epoch) as directory:
                write_pose(result, directory, inputs, settings={**asked, "pointing": pointing, "tilt": tilt})
    finally:
        progress.clear()
    _tell(result, json, quiet, out)


def _tell(result: "PoseResult", json: bool, quiet: bool, out: Path | None) -> None:
    from catseye.gateways.pose.objects import beam_rows, pose_result_object, pose_rows, pose_words

    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(pose_result_object(result)))
        return
    if quiet:
        return
    for title, text in pose_words(result):
        say(wrapped(title, text))
    for name, value, u, unit in pose_rows(result):
        say(f"{'':<14}{name:<20}{value:>12} {unit:<7} u {u}")
    if result.beam is not None:
        say("\nThe beam (its correction is the opposite)")
        for name, value, u, unit in beam_rows(result.beam):
            say(f"{'':<14}{name:<20}{value:>12} {unit:<7} u {u}")
        for name, part in result.beam.terms.items():
            a, b, c = part[0] / ARCSECOND, part[1] / ARCSECOND, part[2] * 1e3
            say(f"{'':<14}{name:<36}{a:+9.3f} {b:+9.3f} arcsec {c:+9.3f} mm")
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, points.csv, pose.json"))


def _with_posture(points: "SolvedPoints", posture: str | None) -> "SolvedPoints":
    from dataclasses import replace

    if posture is None:
        return points
    azimuth, elevation = _numbers(posture, 2, "AZ,EL in degrees")
    return replace(points, posture=(azimuth * DEGREE, elevation * DEGREE))


class _Wanted(NamedTuple):
    """Which pose is asked for.

    group      what moves as one, or
    points     the points that do, by name
    frame      axes of the answer
    pivot      of the rotation, m, in the frame; None: the usual one
    robust     how points that moved alone are left out; None: none is
    pointing   optics whose beam is derived, too
    tilt       of an inclinometer, joined: x, y and their u, arc seconds
    """

    group: str | None
    points: list[str] | None
    frame: str
    pivot: list[float] | None
    robust: str | None
    pointing: str | None
    tilt: list[float] | None


def _result(
    later: "SolvedPoints", before: "SolvedPoints | None", records: "SiteFolder", wanted: _Wanted
) -> "PoseResult":
    """The pose, with an inclinometer joined or the beam derived where asked for."""
    import numpy as np

    from catseye.gateways.pose.objects import PoseResult
    from catseye.reduction.pose.pointing_offsets import cross_covariance, pointing_offset
    from catseye.reduction.pose.pose import at_posture, pose_of_group
    from catseye.reduction.pose.track_profile import pose_with_tilt

    if later.posture is None:
        raise InputError(f"{later.file}: its posture is unknown (expected pose.json beside it, or --posture AZ,EL)")
    site = at_posture(records, *later.posture)
    group_pose = pose_of_group(
        later,
        before,
        site,
        group=wanted.group,
        points=wanted.points,
        frame=wanted.frame,
        pivot=None if wanted.pivot is None else np.array(wanted.pivot),
        robust=wanted.robust,
    )
    if wanted.tilt is not None:
        x, y, u = (v * ARCSECOND for v in wanted.tilt)
        return PoseResult(pose_with_tilt(group_pose, np.array([x, y]), u), None)
    optics = wanted.pointing
    if optics is None:
        return PoseResult(group_pose, None)
    carried = pose_of_group(later, before, site, group=CARRIED[optics], frame="reflector", robust=wanted.robust)
    cross = cross_covariance(carried, group_pose, site, earlier=before)
    return PoseResult(group_pose, pointing_offset(group_pose.pose, carried.pose, site, cross=cross, optics=optics))
