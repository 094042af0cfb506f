"""The command of design studies."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.networks import Out
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import DESIGN_CRITERIA, one_of

FILES = "report.html, design.json, moves.csv, points.csv, provenance.json, figures and maps"


def _postures(texts: list[str] | None) -> list[str] | None:
    for text in texts or ():
        _pair(text)
    return texts


def _pair(text: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not azimuth,elevation in degrees.") from None
    return azimuth, elevation


class _Aim(NamedTuple):
    """Criterion, points of interest and postures."""

    criterion: Annotated[
        str,
        typer.Option(
            "--criterion",
            metavar=DESIGN_CRITERIA,
            callback=one_of(DESIGN_CRITERIA),
            help="Criterion: mean variance, worst axis, pose of a body, or gain at a frequency.",
        ),
    ] = "worst"
    interest: Annotated[
        list[str] | None,
        typer.Option(
            "--interest",
            metavar="NAME",
            help="Point of interest, or pattern such as 'ZEG*'; repeats. The feed arm's if not given.",
        ),
    ] = None
    frequency_ghz: Annotated[
        float | None, typer.Option("--frequency-ghz", help="Frequency of the gain, for --criterion gain.")
    ] = None
    posture_deg: Annotated[
        list[str] | None,
        typer.Option(
            "--posture",
            metavar="AZ,EL",
            callback=_postures,
            help="Posture of the telescope, degrees; repeats, and the mean counts. The site's own if not given.",
        ),
    ] = None


class _Constraints(NamedTuple):
    """Obstacles, clearances and the claim of a range."""

    solids: Annotated[
        Path | None,
        typer.Option("--solids", metavar="SOLIDS.toml", help="Solids that obstruct beams, beside the site's dish."),
    ] = None
    keep_out: Annotated[
        Path | None,
        typer.Option("--keep-out", metavar="KEEP-OUT.toml", help="Boxes closed to beams and rangers."),
    ] = None
    apart_m: Annotated[
        float, typer.Option("--apart-m", help="Least distance between two rangers on the ground, m.")
    ] = 5.0
    clearance_m: Annotated[
        float, typer.Option("--clearance-m", help="Least distance of a ranger from solids and boxes, m.")
    ] = 1.0
    sigma_mm: Annotated[
        float | None,
        typer.Option("--sigma-mm", help="Standard uncertainty of a range, constant part, mm; 0.03 or the file's."),
    ] = None
    sigma_ppm: Annotated[
        float | None,
        typer.Option("--sigma-ppm", help="Standard uncertainty of a range by its length, ppm; the site's."),
    ] = None


class _Search(NamedTuple):
    """Extent of search, maps and scatter."""

    limit_mm: Annotated[
        float | None, typer.Option("--limit-mm", help="Uncertainty to reach: the smallest number that does is chosen.")
    ] = None
    steps: Annotated[int, typer.Option("--steps", min=1, help="Steps of each descent, at most.")] = 60
    exchanges: Annotated[int, typer.Option("--exchanges", min=0, help="Rounds of exchange among candidates.")] = 2
    map_side: Annotated[int, typer.Option("--map-side", min=0, help="Places along each side of a map; 0: no map.")] = 15
    runs: Annotated[int, typer.Option("--runs", min=0, help="Simulated measurements before and after; 0: none.")] = 4000
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the runs.")] = 1


@app.command(
    epilog="\b\nExample: catseye design gbt --vary 'rangers within 20 m' --out moved\n"
    "         catseye design gbt --vary 'rangers from 10 to 16 between 60 and 160 m' --limit-mm 0.05\n"
    "         catseye design designs/structure-500m.toml --vary 'rangers within 15 m' --exchanges 0"
)
@grouped
def design(  # noqa: PLR0913 - its options are its command line
    *,
    site: Annotated[
        Path, typer.Argument(metavar="SITE", help="Folder of a site, or a layout such as designs/structure-500m.toml.")
    ],
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary",
            metavar="WORDS",
            help="Variation: rangers, targets, ranger NAME or target NAME, then from A to B, within L m, "
            "between A and B m; repeats.",
        ),
    ],
    aim: _Aim,
    constraints: _Constraints,
    search: _Search,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Number and place of rangers and targets, by predicted uncertainty, confirmed by scatter."""
    from catseye.api.result import require_writable, save
    from catseye.api.scale.design import design as designed

    require_writable(out, site, constraints.solids, constraints.keep_out)
    progress = ProgressLine(quiet)
    try:
        options: dict[str, Any] = {
            **aim._asdict(),
            **constraints._asdict(),
            **search._asdict(),
            "interest": aim.interest or (),
            "posture_deg": [_pair(text) for text in aim.posture_deg or ()] or None,
        }
        result = designed(site, vary=vary, progress=progress, **options)
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    written = [("Written to", None if out is None else f"{out}/: {FILES}")]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)
