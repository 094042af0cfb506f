"""The command of refractometer paths."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import ProgressLine, say, wrapped
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
        Path, typer.Argument(metavar="FILE.csv", help="Phases with their weather: docs/formats/refractometer.md.")
    ],
    sheet: Annotated[
        Path | None, typer.Option("--sheet", metavar="FILE.toml", help="What is known of the path; FILE.toml beside.")
    ] = None,
    path_length_m: Annotated[
        float | None,
        typer.Option("--path-length-m", callback=_within(1, 1e5, "m"), help=f"D - D0 of the path, m; {SHEET}."),
    ] = None,
    u_path_length_mm: Annotated[
        float | None, typer.Option("--u-path-length-mm", callback=_within(0, 1000, "mm"), help="Of it, mm (1σ).")
    ] = None,
    model: Annotated[
        str | None, typer.Option("--model", callback=one_of(AIR_MODELS), help=f"Formula for the index of air; {SHEET}.")
    ] = None,
    wavelength_um: Annotated[
        float | None, typer.Option("--wavelength-um", callback=_within(0.3, 1.7, "µm"), help="Carrier in vacuum, µm.")
    ] = None,
    modulation_hz: Annotated[
        float | None, typer.Option("--modulation-hz", callback=_within(1e7, 1e11, "Hz"), help="Of the modulation.")
    ] = None,
    co2_ppm: Annotated[
        float | None, typer.Option("--co2-ppm", callback=_within(0, 2000, "ppm"), help="Carbon dioxide, ppm.")
    ] = None,
    u_temperature_c: Annotated[
        float | None,
        typer.Option("--u-temperature-c", callback=_within(0, 100, "°C"), help="Of each thermometer's offset (1σ)."),
    ] = None,
    u_pressure_hpa: Annotated[
        float | None,
        typer.Option("--u-pressure-hpa", callback=_within(0, 100, "hPa"), help="Of the barometer's offset (1σ)."),
    ] = None,
    u_humidity_percent: Annotated[
        float | None,
        typer.Option("--u-humidity-percent", callback=_within(0, 100, "%"), help="Of the hygrometer's offset (1σ)."),
    ] = None,
    drift: Annotated[
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
    """The group index along a fixed path: calibrated by a night of phases and weather, then from each phase."""
    from catseye.gateways.writers.output import atomic_directory, refuse_output

    given = {
        "path_length_m": path_length_m,
        "u_path_length_mm": u_path_length_mm,
        "air_model": model,
        "wavelength_um": wavelength_um,
        "modulation_hz": modulation_hz,
        "co2_ppm": co2_ppm,
        "u_temperature_c": u_temperature_c,
        "u_pressure_hpa": u_pressure_hpa,
        "u_humidity_percent": u_humidity_percent,
        "drift_mrad_per_root_hour": drift,
    }
    if out is not None:
        refuse_output(out, readings)
    progress = ProgressLine(quiet)
    try:
        from catseye.reduction.air.refractometer_calibration import calibrate_path
        from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet

        changes = {key: value for key, value in given.items() if value is not None}
        progress("calibration", 0, 1)
        known, hashes = read_path_sheet(sheet or readings.with_suffix(".toml"), changes, needed=sheet is not None)
        calibration = calibrate_path(read_path_readings(readings, known, hashes))
        if out is not None:
            from catseye.gateways.air.refractometer_report import write_refractometer

            with atomic_directory(out, readings) as directory:
                write_refractometer(calibration, directory, progress)
    finally:
        progress.clear()
    from catseye.gateways.air.refractometer_report import passages, refractometer_object, refractometer_verdict

    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(refractometer_object(calibration)))
    elif not quiet:
        say(wrapped("Verdict", refractometer_verdict(calibration).text))
        for passage in passages(calibration):
            say(wrapped(passage.title, passage.text))
        if out is not None:
            say(wrapped("Written to", f"{out}/: report.html, group_index.csv, refractometer.json, night.svg"))
    judge(refractometer_verdict(calibration), strict=strict)
