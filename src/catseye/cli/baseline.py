"""The command of EDM baselines."""

import math
from datetime import date
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Certificate, Job, Json, Laboratory, Quiet, app, uncertainty
from catseye.cli.networks import Out, _level
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.names import AIR_MODEL

FEW = 12  # pillars whose distances a terminal is told
UNKNOWN = "unknown in the record where not given"
LARGEST = 1e4  # mm, ppm, °C, hPa, %: beyond it a unit was meant otherwise


def _above_zero(value: float | None) -> float | None:
    if value is not None and not (0.0 < value <= LARGEST):
        raise typer.BadParameter(f"{value} is not above zero and at most {LARGEST:g}.")
    return value


def _finite(value: float | None) -> float | None:
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number.")
    return value


def _height(value: float | None) -> float | None:
    if value is not None and not (-9000.0 <= value <= 9000.0):
        raise typer.BadParameter(f"{value} is not a height (expected -9000 to 9000 m).")
    return value


def _day(value: str | None) -> str | None:
    if value is not None:
        try:
            date.fromisoformat(value)
        except ValueError as problem:
            raise typer.BadParameter(f"{value!r} is not a day as 2026-11-21.") from problem
    return value


def _u(name: str, what: str):
    return typer.Option(name, callback=_modest, help=what)


def _modest(value: float) -> float:
    if uncertainty(value) > LARGEST:
        raise typer.BadParameter(f"{value} is no uncertainty of a distance meter (expected at most {LARGEST:g}).")
    return value


class _Inputs(NamedTuple):
    """The files that are read."""

    observations: Annotated[
        Path,
        typer.Argument(metavar="OBSERVATIONS.csv", help="Shots with their weather: catseye help formats/baseline."),
    ]
    heights: Annotated[
        Path | None, typer.Option("--heights", metavar="HEIGHTS.csv", help="Heights of pillars; level if not given.")
    ] = None
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            metavar="BASELINE.toml",
            help="Record of known pillars: determines the instrument's scale, too.",
        ),
    ] = None


class _Settings(NamedTuple):
    """Options of a baseline calibration; without a unit m or numbers."""

    reference_index: Annotated[
        float, typer.Option("--reference-index", help="Group index for which the instrument shows lengths.")
    ] = 1.000286338
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Carrier in vacuum, µm.")] = 0.658
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm.")] = 420.0
    model: Annotated[
        str,
        typer.Option("--model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula for the index of air."),
    ] = AIR_MODEL
    corrected: Annotated[
        bool, typer.Option("--corrected", help="Lengths contain the first velocity correction already.")
    ] = False
    refraction: Annotated[
        float, typer.Option("--refraction-k", callback=_finite, help="Coefficient of refraction.")
    ] = 0.13
    reference_height_m: Annotated[
        float | None,
        typer.Option(
            "--reference-height-m",
            callback=_height,
            help="Height to which distances are reduced; the first pillar's if not given.",
        ),
    ] = None
    u_temperature_c: Annotated[
        float, _u("--u-temperature-c", "Standard uncertainty of the temperatures, common to all shots, °C (1σ).")
    ] = 0.5
    u_pressure_hpa: Annotated[
        float, _u("--u-pressure-hpa", "Standard uncertainty of the pressures, common to all shots, hPa (1σ).")
    ] = 0.3
    u_humidity_percent: Annotated[
        float, _u("--u-humidity-percent", "Standard uncertainty of the humidities, common to all shots, % (1σ).")
    ] = 5.0
    u_scale_ppm: Annotated[
        float, _u("--u-scale-ppm", "Standard uncertainty of the instrument's frequency, without --against, ppm (1σ).")
    ] = 1.0
    u_direction_arcsec: Annotated[
        float,
        typer.Option(
            "--u-direction-arcsec", callback=_above_zero, help="Standard uncertainty of a set's direction, arcsec (1σ)."
        ),
    ] = 0.6
    u_centring_mm: Annotated[
        float, _u("--u-centring-mm", "Standard uncertainty of centring across the line, for directions, mm (1σ).")
    ] = 0.2
    unit_length_m: Annotated[
        float | None,
        typer.Option(
            "--unit-length-m",
            callback=_above_zero,
            help="Unit length of cyclic terms: half a modulation wavelength, m; none if not given.",
        ),
    ] = None
    cyclic_orders: Annotated[int, typer.Option("--cyclic-orders", min=1, max=4, help="Orders of cyclic terms.")] = 1
    specified_mm: Annotated[
        float, typer.Option("--specified-mm", callback=_above_zero, help="Maker's claim a + b D: a, mm (1σ).")
    ] = 0.6
    specified_ppm: Annotated[float, _u("--specified-ppm", "Maker's claim a + b D: b, ppm (1σ).")] = 1.0
    level: Annotated[float, typer.Option("--level", callback=_level, help="Level of each test.")] = 0.05
    reject: Annotated[bool, typer.Option("--reject", help="Reject shots that fail the tests, one at a time.")] = False


class _Provenance(NamedTuple):
    """Provenance of the baseline: person, date, instrument."""

    serial: Annotated[str | None, typer.Option("--serial", help=f"Serial number of the instrument; {UNKNOWN}.")] = None
    measured_on: Annotated[
        str | None,
        typer.Option("--measured-on", callback=_day, metavar="YYYY-MM-DD", help=f"Day of the shots; {UNKNOWN}."),
    ] = None
    by: Annotated[str | None, typer.Option("--by", help=f"Person who measured; {UNKNOWN}.")] = None
    report: Annotated[str | None, typer.Option("--report", help=f"Reference to the report; {UNKNOWN}.")] = None


@app.command(
    epilog="\b\nExample: catseye baseline ts30-baseline-observations.csv --heights pillar-heights.csv --write B.toml\n"
    "         catseye baseline ts16-calibration-observations.csv --heights pillar-heights.csv --against B.toml\n"
    "These files: examples/baselines/busselton"
)
@grouped
def baseline(  # noqa: PLR0913 - its options are its command line
    *,
    read: _Inputs,
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="BASELINE.toml", help="Record of the pillars with full covariance to write."),
    ] = None,
    certificate: Certificate = None,
    laboratory: Laboratory = None,
    job: Job = None,
    asked: _Settings,
    origin: _Provenance,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Pillars of an EDM baseline, and the instrument's errors, with tests of ISO 17123-4."""
    from catseye.api.baseline import baseline as calibrated
    from catseye.api.result import require_writable, save

    require_writable(out, *read, laboratory, job, record=write, certificate=certificate)
    progress = ProgressLine(quiet)
    try:
        result = calibrated(
            **read._asdict(), **asked._asdict(), **origin._asdict(), laboratory=laboratory, job=job, progress=progress
        )
        if out is not None:
            save(result, out, progress=progress, record=write, certificate=certificate)
        else:
            result.save_pages(record=write, certificate=certificate)
    finally:
        progress.clear()
    rows = result.rows() if len(result.pillars) <= FEW else ()
    files = None if out is None else f"{out}/: report.html, pillars.csv, distances.csv, observations.csv, baseline.json"
    record = None if write is None else f"{write}: the pillars with their full covariance"
    written = [("Written to", files), ("Written to", record), ("Certificate", certificate)]
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, written=written)
