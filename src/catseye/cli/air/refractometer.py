"""The command of refractometer paths."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import AIR_MODELS, one_of

SHEET = "as in the sheet if not given"


def _within(low: float, high: float, unit: str) -> Callable[[float | None], float | None]:
    def check(value: float | None) -> float | None:
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{value} is not within {low:g} to {high:g} {unit}.")
        return value

    return check


@app.command(
    epilog="\b\nExample: catseye refractometer examples/refractometer/path-a.csv --out path-a\n"
    "         catseye refractometer NIGHT.csv --path-length-m 100.02 --u-path-length-mm 5 --json"
)
def refractometer(  # noqa: PLR0913 - its options are its command line
    readings: Annotated[
        Path, typer.Argument(metavar="FILE.csv", help="Phases with their weather: catseye help formats/refractometer.")
    ],
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", metavar="FILE.toml", help="Sheet of the path; FILE.toml beside FILE.csv if not given."),
    ] = None,
    path_length_m: Annotated[
        float | None,
        typer.Option("--path-length-m", callback=_within(1, 1e5, "m"), help=f"D - D0 of the path, m; {SHEET}."),
    ] = None,
    u_path_length_mm: Annotated[
        float | None,
        typer.Option(
            "--u-path-length-mm", callback=_within(0, 1000, "mm"), help="Standard uncertainty of the path, mm (1σ)."
        ),
    ] = None,
    model: Annotated[
        str | None, typer.Option("--model", callback=one_of(AIR_MODELS), help=f"Formula for the index of air; {SHEET}.")
    ] = None,
    wavelength_um: Annotated[
        float | None, typer.Option("--wavelength-um", callback=_within(0.3, 1.7, "µm"), help="Carrier in vacuum, µm.")
    ] = None,
    modulation_hz: Annotated[
        float | None,
        typer.Option("--modulation-hz", callback=_within(1e7, 1e11, "Hz"), help="Frequency of the modulation, Hz."),
    ] = None,
    co2_ppm: Annotated[
        float | None, typer.Option("--co2-ppm", callback=_within(0, 2000, "ppm"), help="Carbon dioxide, ppm.")
    ] = None,
    u_temperature_c: Annotated[
        float | None,
        typer.Option(
            "--u-temperature-c",
            callback=_within(0, 100, "°C"),
            help="Standard uncertainty of each thermometer's offset, °C (1σ).",
        ),
    ] = None,
    u_pressure_hpa: Annotated[
        float | None,
        typer.Option(
            "--u-pressure-hpa",
            callback=_within(0, 100, "hPa"),
            help="Standard uncertainty of the barometer's offset, hPa (1σ).",
        ),
    ] = None,
    u_humidity_percent: Annotated[
        float | None,
        typer.Option(
            "--u-humidity-percent",
            callback=_within(0, 100, "%"),
            help="Standard uncertainty of the hygrometer's offset, % (1σ).",
        ),
    ] = None,
    drift_mrad_per_root_hour: Annotated[
        float | None,
        typer.Option(
            "--drift-mrad-per-root-hour", callback=_within(0, 100, "mrad"), help="Random walk of the phase's zero."
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
    """Group index along a fixed path, from phases and weather."""
    from catseye.api.air_paths import refractometer as calibrated
    from catseye.api.result import require_writable, save

    require_writable(out, readings)
    progress = ProgressLine(quiet)
    try:
        result = calibrated(
            readings,
            sheet,
            path_length_m=path_length_m,
            u_path_length_mm=u_path_length_mm,
            model=model,
            wavelength_um=wavelength_um,
            modulation_hz=modulation_hz,
            co2_ppm=co2_ppm,
            u_temperature_c=u_temperature_c,
            u_pressure_hpa=u_pressure_hpa,
            u_humidity_percent=u_humidity_percent,
            drift_mrad_per_root_hour=drift_mrad_per_root_hour,
            progress=progress,
        )
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    files = None if out is None else f"{out}/: report.html, group_index.csv, refractometer.json, night.svg"
    tell(result, json=json, quiet=quiet, strict=strict, written=[("Written to", files)])
