"""The command of sound."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app, uncertainty
from catseye.cli.results import tell
from catseye.cli.vocabularies import SOUND_MODELS, one_of

U = {"callback": uncertainty}


@app.command(
    epilog="\b\nExample: catseye sound --temperature-c 20 --pressure-hpa 933 --humidity-percent 50\n"
    "Example: catseye sound --temperature-c=-10 --pressure-hpa 933 --humidity-percent 80 --model real_gas\n"
    "Example: catseye sound --speed 343.81 --pressure-hpa 933 --humidity-percent 50 --model real_gas"
)
def sound(  # noqa: PLR0913 - its options are its command line
    temperature_c: Annotated[
        float | None, typer.Option("--temperature-c", help="Air temperature, °C; or --speed, which gives it.")
    ] = None,
    pressure_hpa: Annotated[float | None, typer.Option("--pressure-hpa", help="Total pressure, hPa; needed.")] = None,
    humidity_percent: Annotated[
        float | None, typer.Option("--humidity-percent", help="Relative humidity over liquid water, %.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option("--speed", help="Speed of sound, m/s: the air's temperature is the answer.")
    ] = None,
    frequency_hz: Annotated[
        float, typer.Option("--frequency-hz", help="Frequency of that sound, Hz; 0: dispersion is corrected already.")
    ] = 0.0,
    vapour_pressure_hpa: Annotated[
        float | None,
        typer.Option("--vapour-pressure-hpa", help="Partial pressure of the vapour, hPa, with --speed."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar=SOUND_MODELS,
            callback=one_of(SOUND_MODELS),
            help="Formula; parker2004 is the notes' as printed, real_gas measures temperature.",
        ),
    ] = "parker2004",
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm; parker2004 has none.")] = 450.0,
    u_temperature_c: Annotated[float, typer.Option(help="Standard uncertainty of the temperature, °C.", **U)] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(help="Standard uncertainty of the pressure, hPa.", **U)] = 0.0,
    u_humidity_percent: Annotated[
        float, typer.Option(help="Standard uncertainty of the relative humidity, %.", **U)
    ] = 0.0,
    u_co2_ppm: Annotated[float, typer.Option(help="Standard uncertainty of the carbon dioxide, ppm.", **U)] = 0.0,
    u_speed: Annotated[float, typer.Option(help="Standard uncertainty of the speed, m/s.", **U)] = 0.0,
    u_vapour_pressure_hpa: Annotated[
        float, typer.Option(help="Standard uncertainty of the vapour pressure, hPa.", **U)
    ] = 0.0,
    json: Json = False,
) -> None:
    """Speed of sound in air, or temperature by it, with sensitivities and uncertainty."""
    from catseye.api.weather import sound as sound_of

    result = sound_of(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        speed=speed,
        frequency_hz=frequency_hz,
        vapour_pressure_hpa=vapour_pressure_hpa,
        model=model,
        co2_ppm=co2_ppm,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=u_pressure_hpa,
        u_humidity_percent=u_humidity_percent,
        u_co2_ppm=u_co2_ppm,
        u_speed=u_speed,
        u_vapour_pressure_hpa=u_vapour_pressure_hpa,
    )
    tell(result, json=json)
