"""The command of a weather logger's table."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.air.air import CarbonDioxide, Model
from catseye.cli.commands import Json, Quiet, app, uncertainty
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import PRESSURES_AT, one_of
from catseye.names import AIR_MODEL

SHEET = "as in the sheet if not given"


def uncertainty_or_none(value: float | None) -> float | None:
    """A standard uncertainty, or the sheet's."""
    return None if value is None else uncertainty(value)


@app.command(
    epilog="\b\nExample: catseye weather examples/weather/tower.dat --out tower-weather --write tower-weather.csv\n"
    "Example: catseye weather examples/weather/valley.csv --time-zone Europe/Berlin --json\n"
    "Layout of SHEET: catseye help formats/weather"
)
def weather(  # noqa: PLR0913 - its options are its command line
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="Table of a logger, CSV with any separator.")],
    sheet: Annotated[
        Path | None,
        typer.Option(
            "--sheet", metavar="SHEET.toml", help="Columns, units, clock; TABLE.toml, if there, if not given."
        ),
    ] = None,
    station: Annotated[
        str | None, typer.Option("--station", help=f"Name of the station, where no column has it; {SHEET}.")
    ] = None,
    time_zone: Annotated[
        str | None,
        typer.Option("--time-zone", metavar="UTC|+hh:mm|NAME", help=f"Of times without an offset; {SHEET}."),
    ] = None,
    pressure_at: Annotated[
        str | None,
        typer.Option(
            "--pressure-at",
            metavar=PRESSURES_AT,
            callback=one_of(PRESSURES_AT),
            help=f"What the pressure is reduced to; {SHEET}.",
        ),
    ] = None,
    elevation_m: Annotated[
        float | None, typer.Option("--elevation-m", help=f"Elevation of the barometer, m; {SHEET}.")
    ] = None,
    u_temperature_c: Annotated[
        float | None,
        typer.Option("--u-temperature-c", callback=uncertainty_or_none, help="Standard uncertainty, °C."),
    ] = None,
    u_pressure_hpa: Annotated[
        float | None, typer.Option("--u-pressure-hpa", callback=uncertainty_or_none, help="Standard uncertainty, hPa.")
    ] = None,
    u_humidity_percent: Annotated[
        float | None,
        typer.Option("--u-humidity-percent", callback=uncertainty_or_none, help="Standard uncertainty, %."),
    ] = None,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    model: Model = AIR_MODEL,
    co2_ppm: CarbonDioxide = 450.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: table, figure, JSON.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="weather.csv", help="Weather of a campaign, for its directory.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Index of air over time, from a weather logger's table."""
    from catseye.api.atmosphere.logger import weather as series_of
    from catseye.api.result import require_writable, save

    require_writable(out, table, sheet, table=write)
    result = series_of(
        table,
        sheet,
        station=station,
        time_zone=time_zone,
        pressure_at=pressure_at,
        elevation_m=elevation_m,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=u_pressure_hpa,
        u_humidity_percent=u_humidity_percent,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
    )
    if out is not None:
        save(result, out, table=write)
    else:
        result.save_pages(table=write)
    tell(result, json=json, quiet=quiet, strict=strict, written=[("Written to", out), ("Written to", write)])
