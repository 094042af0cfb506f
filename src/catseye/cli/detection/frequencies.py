"""The command of the frequencies."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import AIR_MODEL, OSCILLATORS, one_of


@app.command(
    epilog="\b\nExample: catseye frequencies --disturbance 0.001 --out plan\n"
    "Example: catseye frequencies --intermediate-hz 5000 --samples-per-cycle 16 --range-rate 0.01"
)
def frequencies(  # noqa: PLR0913 - its options are its command line
    reference_hz: Annotated[float, typer.Option("--reference-hz", help="Frequency standard, Hz.")] = 100e6,
    multiple: Annotated[int, typer.Option("--multiple", help="Modulation over the reference.")] = 15,
    oscillator: Annotated[
        str,
        typer.Option(
            "--oscillator",
            metavar=OSCILLATORS,
            callback=one_of(OSCILLATORS),
            help="Local oscillator above or below the modulation.",
        ),
    ] = "above",
    intermediate_hz: Annotated[float, typer.Option("--intermediate-hz", help="Intermediate frequency, Hz.")] = 1000.0,
    samples_per_cycle: Annotated[int, typer.Option("--samples-per-cycle", help="Samples in a cycle of it.")] = 64,
    cycles: Annotated[int, typer.Option("--cycles", help="Cycles of a buffer.")] = 128,
    wavelength_um: Annotated[
        float, typer.Option("--wavelength-um", help="Wavelength of the light in vacuum, µm.")
    ] = 0.780,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Air temperature, °C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Air pressure, hPa.")] = 933.0,
    humidity_percent: Annotated[float, typer.Option("--humidity-percent", help="Relative humidity, %.")] = 50.0,
    air_model: AirModel = AIR_MODEL,
    disturbance: Annotated[
        float, typer.Option("--disturbance", help="Signal of the same frequency over the signal, 0 to 1.")
    ] = 0.001,
    excess_path: Annotated[
        float | None, typer.Option("--excess-path", help="Longer path of that signal, there and back, m.")
    ] = None,
    range_rate: Annotated[
        float | None, typer.Option("--range-rate", help="Range rate of a moving target, m/s.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: timing diagram, tables, JSON.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Frequency plan of a ranger: sidebands, sampling, timing of the converter, errors by crosstalk."""
    from catseye.api.detection.frequencies import frequencies as frequencies_of
    from catseye.api.result import require_writable, save

    require_writable(out)
    result = frequencies_of(
        reference_hz=reference_hz,
        multiple=multiple,
        oscillator=oscillator,
        intermediate_hz=intermediate_hz,
        samples_per_cycle=samples_per_cycle,
        cycles=cycles,
        wavelength_um=wavelength_um,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        air_model=air_model,
        disturbance=disturbance,
        excess_path=excess_path,
        range_rate=range_rate,
    )
    if out is not None:
        save(result, out)
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", out)])
