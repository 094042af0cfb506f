"""The command of sound."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app, uncertainty
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import SOUND_MODELS, one_of

U = {"callback": uncertainty}


@app.command(
    epilog="\b\nExample: catseye sound --temperature-c 20 --pressure-hpa 933 --humidity-percent 50\n"
    "Example: catseye sound --temperature-c=-10 --pressure-hpa 933 --humidity-percent 80 --model real_gas"
)
def sound(  # noqa: PLR0913 - its options are its command line
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Air temperature, °C.")],
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Total pressure, hPa.")],
    humidity_percent: Annotated[
        float, typer.Option("--humidity-percent", help="Relative humidity over liquid water, %.")
    ],
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
    u_pressure_hpa: Annotated[float, typer.Option(help="Of the pressure, hPa.", **U)] = 0.0,
    u_humidity_percent: Annotated[float, typer.Option(help="Of the relative humidity, %.", **U)] = 0.0,
    u_co2_ppm: Annotated[float, typer.Option(help="Of the carbon dioxide, ppm.", **U)] = 0.0,
    json: Json = False,
) -> None:
    """Speed of sound in air, its sensitivities and its uncertainty, by the notes' formula and today's."""
    from catseye.atmosphere.sound.speed import sound as sound_of
    from catseye.gateways.air.sound_objects import sound_object, sound_rows
    from catseye.gateways.writers.objects import json_line

    weather = (temperature_c, pressure_hpa, humidity_percent)
    state = sound_of(*weather, model=model, co2_ppm=co2_ppm)
    u = float(state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm))
    answer = sound_object(state, weather, co2_ppm, u=u)
    if json:
        say(json_line(answer))
        return
    for title, text in sound_rows(answer):
        say(wrapped(title, text))
