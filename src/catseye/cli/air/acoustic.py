"""The command of temperatures measured by sound."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.air.weather import uncertainty_or_none
from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import THERMOMETRY_MODELS, one_of
from catseye.names import AIR_MODEL


@app.command(
    epilog="\b\nExample: catseye acoustic examples/acoustic/evening-1.wav --sheet examples/acoustic/evening.toml\n"
    "Example: catseye acoustic examples/acoustic/night.csv --weather examples/acoustic/station.csv\n"
    "Layouts of FILE and SHEET: catseye help formats/acoustic"
)
def acoustic(  # noqa: PLR0913 - its options are its command line
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Recordings .wav or .csv, or travel times .csv.")
    ],
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", metavar="SHEET.toml", help="Path, signal, weather; FILE.toml if not given."),
    ] = None,
    weather: Annotated[
        Path | None,
        typer.Option("--weather", metavar="TABLE", help="Weather logger's table, as catseye weather reads it."),
    ] = None,
    station: Annotated[str | None, typer.Option("--station", help="Name of the station in that table.")] = None,
    temperature_c: Annotated[
        float | None, typer.Option("--temperature-c", help="Temperature of the air for all shots, °C.")
    ] = None,
    pressure_hpa: Annotated[float | None, typer.Option("--pressure-hpa", help="Pressure for all shots, hPa.")] = None,
    humidity_percent: Annotated[
        float | None, typer.Option("--humidity-percent", help="Relative humidity for all shots, %.")
    ] = None,
    u_pressure_hpa: Annotated[
        float | None, typer.Option("--u-pressure-hpa", callback=uncertainty_or_none, help="Standard uncertainty, hPa.")
    ] = None,
    u_humidity_percent: Annotated[
        float | None,
        typer.Option("--u-humidity-percent", callback=uncertainty_or_none, help="Standard uncertainty, %."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: report, tables, figures.")
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="path_temperatures.csv", help="Table of path temperatures for a campaign."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar=THERMOMETRY_MODELS,
            callback=one_of(THERMOMETRY_MODELS),
            help="Formula for the speed of sound.",
        ),
    ] = "real_gas",
    air_model: AirModel = AIR_MODEL,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Temperature of the air along a path from the travel time of sound."""
    from catseye.api.air_paths import acoustic as measured
    from catseye.api.result import require_writable, save

    sheets = [file.with_suffix(".toml") for file in files] if sheet is None else [sheet]
    require_writable(out, *files, *sheets, weather, table=write)
    progress = ProgressLine(quiet)
    try:
        result = measured(
            *files, sheet=sheet, weather=weather, station=station, temperature_c=temperature_c,
            pressure_hpa=pressure_hpa, humidity_percent=humidity_percent, u_pressure_hpa=u_pressure_hpa,
            u_humidity_percent=u_humidity_percent, model=model, air_model=air_model, progress=progress,
        )  # fmt: skip
        if out is not None:
            save(result, out, progress=progress, table=write)
        else:
            result.save_pages(table=write)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet, strict=strict, written=[("Written to", out), ("Written to", write)])
