"""The command of the arm's vibration: followed, and predicted."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell


class _Sensor(NamedTuple):
    """Samples: what they are worth."""

    slope_mm: Annotated[
        float | None,
        typer.Option(
            "--slope-mm", help="Slope of a quadrant detector: displacement over (difference of halves / sum), mm."
        ),
    ] = None
    u_signal: Annotated[
        float | None, typer.Option("--u-signal", help="Noise of each quadrant, unit of the signals.")
    ] = None
    u_mm: Annotated[
        float | None, typer.Option("--u-mm", help="White noise of each displacement, range or coordinate, mm.")
    ] = None
    window_s: Annotated[
        float, typer.Option("--window-s", help="Time over which each sample is a mean, s: 0.128 of a buffer.")
    ] = 0.0


class _Arm(NamedTuple):
    """The arm: its structural model, and what stands on it."""

    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="TELESCOPE.toml", help="Structural model whose vibrations are the modes."),
    ] = None
    target: Annotated[
        str | None, typer.Option("--target", metavar="NAME", help="Target of the model whose coordinates SERIES has.")
    ] = None
    posture_deg: Annotated[
        str | None,
        typer.Option(
            "--posture", metavar="AZ,EL", callback=row_of(2, "AZ,EL in degrees"), help="Posture of the telescope, deg."
        ),
    ] = None
    temperature_c: Annotated[
        float | None,
        typer.Option("--temperature-c", help="Temperature of the structure; the model's reference if not given."),
    ] = None
    site: Annotated[Path | None, typer.Option("--site", metavar="SITE", help="Site of --ranger.")] = None
    ranger: Annotated[
        str | None, typer.Option("--ranger", metavar="NAME", help="Ranger of the feed arm whose place is predicted.")
    ] = None


@app.command(
    epilog="\b\nExample: catseye follow vibration/quadrant.csv --slope-mm 10 --u-signal 0.002 --modes 2 --out arm\n"
    "         catseye follow vibration/quadrant.csv --slope-mm 10 --u-signal 0.002 "
    "--model structural-model/telescope.toml --site gbt --ranger ZY115 --posture 145.3,30\n"
    "Layout of SERIES: catseye help formats/vibration"
)
@grouped
def follow(  # noqa: PLR0913 - its options are its command line
    *,
    series: Annotated[
        Path, typer.Argument(metavar="SERIES.csv", help="Quadrant signals, displacements, ranges or coordinates.")
    ],
    sensor: _Sensor,
    modes: Annotated[int, typer.Option("--modes", min=1, max=6, help="Number of modes to find.")] = 1,
    near_hz: Annotated[
        list[float] | None,
        typer.Option("--near-hz", metavar="F", help="First guess of a frequency, Hz; one each."),
    ] = None,
    ahead_s: Annotated[float, typer.Option("--ahead-s", help="Time over which the check predicts, s.")] = 0.128,
    leads_s: Annotated[
        list[float] | None,
        typer.Option(
            "--lead-s",
            metavar="T",
            help="Time after the last sample to predict, s; repeats.  [default: 0.128, 0.5, 1, 2]",
        ),
    ] = None,
    arm: _Arm,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The feed arm's vibration followed by a phase-locked filter: amplitude, frequency, phase, and what comes next."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.vibration import LEADS
    from catseye.api.telescope.vibration import follow as followed

    require_writable(out, *(path for path in (series, arm.model, arm.site) if path is not None))
    result = followed(
        series,
        modes=modes,
        near_hz=tuple(near_hz) if near_hz else None,
        ahead_s=ahead_s,
        leads_s=tuple(leads_s) if leads_s else LEADS,
        **sensor._asdict(),
        **arm._asdict(),
    )
    if out is not None:
        save(result, out)
    files = "modes.csv, predicted.csv, residuals.csv, following.svg, result.json, provenance.json"
    written = [("Written to", None if out is None else f"{out}/: {files}")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=written)
