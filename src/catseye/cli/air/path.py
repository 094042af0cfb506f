"""The command of the air between two points."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.air.air import CarbonDioxide, Model
from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import numbers_of
from catseye.cli.results import Strict, tell
from catseye.names import AIR_MODEL


def _point(text: str) -> list[float]:
    return numbers_of(text, 3, "x,y,z in metres")


@app.command(
    epilog="\b\nExample: catseye path examples/weather/stations.csv --start=0,0,3 --end=100,0,40 --out path\n"
    "Example: catseye path night-01 --start=0,-39,1.5 --end=10,60,90 --json\n"
    "Layout of STATIONS: catseye help formats/weather"
)
def path(  # noqa: PLR0913 - its options are its command line
    stations: Annotated[
        Path, typer.Argument(metavar="STATIONS", help="Campaign, or a table of stations at their heights.")
    ],
    start: Annotated[str, typer.Option("--start", metavar="X,Y,Z", callback=_point, help="First end, m, z up.")],
    end: Annotated[str, typer.Option("--end", metavar="X,Y,Z", callback=_point, help="Second end, m.")],
    mjd_utc: Annotated[
        float | None, typer.Option("--mjd-utc", help="Time; the middle of the readings if not given.")
    ] = None,
    ground_m: Annotated[
        float | None,
        typer.Option("--ground-m", help="Height of the ground, m; 2 m below the lowest station if not given."),
    ] = None,
    wavelength_um: Annotated[
        float | None, typer.Option("--wavelength-um", help="Vacuum wavelength, µm; 0.78, or the campaign's.")
    ] = None,
    model: Model = AIR_MODEL,
    co2_ppm: CarbonDioxide = 450.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: profile, figure, JSON.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Air between two points: profile, mean index, bent ray, with uncertainty."""
    from catseye.api.atmosphere.ray import path as air_between
    from catseye.api.result import require_writable, save

    require_writable(out, stations)
    result = air_between(
        stations,
        start,
        end,
        mjd_utc=mjd_utc,
        ground_m=ground_m,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
    )
    if out is not None:
        save(result, out)
    tell(result, json=json, quiet=quiet, strict=strict, written=[("Written to", out)])
