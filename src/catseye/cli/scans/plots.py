"""`catseye plot quadrant`, `catseye plot visibility`."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet
from catseye.cli.plot import Out, finish, plots


@plots.command(epilog="\b\nExample: catseye plot quadrant --spot-um 100 --noise-percent 0.5 --out quadrant.svg")
def quadrant(  # noqa: PLR0913 - its options are its command line
    out: Out,
    spot_um: Annotated[float, typer.Option("--spot-um", help="Radius of the spot at 1/e², µm.")] = 100.0,
    gap_um: Annotated[float, typer.Option("--gap-um", help="Dead width between the quadrants, µm.")] = 0.0,
    noise_percent: Annotated[
        float, typer.Option("--noise-percent", help="Noise of each quadrant, % of the sum of all.")
    ] = 0.5,
    gain: Annotated[float, typer.Option("--gain", help="Part of the place that a step takes away.")] = 0.3,
    offset_um: Annotated[float, typer.Option("--offset-um", help="Place of the spot at the start, µm.")] = 150.0,
    steps: Annotated[int, typer.Option("--steps", min=1, max=10_000, help="Steps of the servo.")] = 40,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the noise.")] = 1,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A quadrant detector: saturation, noise, and the servo that centres the spot."""
    from catseye.api.scans.plots import plot_quadrant

    result = plot_quadrant(
        spot_um=spot_um,
        gap_um=gap_um,
        noise_percent=noise_percent,
        gain=gain,
        offset_um=offset_um,
        steps=steps,
        seed=seed,
    )
    finish(result, out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot visibility night-01 --solids solids.toml --out visibility.svg")
def visibility(
    out: Out,
    site: Annotated[Path, typer.Argument(metavar="[SITE]", help="Directory of a campaign or a site.")] = Path(
        "night-01"
    ),
    solids: Annotated[
        Path | None, typer.Option("--solids", metavar="SOLIDS.toml", help="Solids that may obstruct the beams.")
    ] = None,
    azimuth_deg: Annotated[
        float | None, typer.Option("--azimuth-deg", help="Azimuth of the telescope; that of the site if not given.")
    ] = None,
    elevation_deg: Annotated[
        float | None, typer.Option("--elevation-deg", help="Elevation of the telescope; that of the site if not given.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Retroreflectors that each ranger sees in a posture, or why not."""
    from catseye.api.scans.plots import plot_visibility

    result = plot_visibility(site, solids=solids, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    finish(result, out, json, quiet)
