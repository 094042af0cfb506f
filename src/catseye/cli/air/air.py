"""The command of the air."""

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catseye.cli.commands import Json, app, uncertainty
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.constants import DEGREE

if TYPE_CHECKING:
    from catseye.reduction.air.routes import Moisture


U = {"callback": uncertainty}
Temperature = Annotated[float, typer.Option("--temperature-c", help="Air temperature, °C.")]
Model = Annotated[
    str, typer.Option("--model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula for the index of air.")
]
CarbonDioxide = Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm; only ciddor_hill1999 has it.")]


@app.command(
    epilog="\b\nExample: catseye air --temperature-c 20 --pressure-hpa 933 --humidity-percent 50\n"
    "Example: catseye air --temperature-c 20 --wet-bulb-c 14 --barometer-mmhg 700 --mercury-c 20 "
    "--latitude-deg 38.45 --elevation-m 797.3 --model rueger1990"
)
def air(  # noqa: PLR0913 - its options are its command line
    temperature_c: Temperature,
    pressure_hpa: Annotated[float | None, typer.Option("--pressure-hpa", help="Total pressure, hPa.")] = None,
    humidity_percent: Annotated[
        float | None, typer.Option("--humidity-percent", help="Relative humidity over liquid water, %; or:")
    ] = None,
    dew_point_c: Annotated[float | None, typer.Option("--dew-point-c", help="dew point of a mirror, °C;")] = None,
    frost_point_c: Annotated[float | None, typer.Option("--frost-point-c", help="its frost point, °C;")] = None,
    wet_bulb_c: Annotated[float | None, typer.Option("--wet-bulb-c", help="wet bulb of a psychrometer, °C;")] = None,
    ice_bulb_c: Annotated[float | None, typer.Option("--ice-bulb-c", help="the same, the bulb frozen, °C;")] = None,
    vapour_pressure_hpa: Annotated[
        float | None, typer.Option("--vapour-pressure-hpa", help="partial pressure of the vapour, hPa.")
    ] = None,
    barometer_mmhg: Annotated[
        float | None, typer.Option("--barometer-mmhg", help="Mercury as read, mm, instead of --pressure-hpa;")
    ] = None,
    mercury_c: Annotated[float | None, typer.Option("--mercury-c", help="temperature of the mercury, °C;")] = None,
    gravity: Annotated[float | None, typer.Option("--gravity", help="gravity there, m/s²; or by")] = None,
    latitude_deg: Annotated[float | None, typer.Option("--latitude-deg", help="latitude, degrees, and")] = None,
    elevation_m: Annotated[float | None, typer.Option("--elevation-m", help="elevation above the sea, m.")] = None,
    above_barometer_m: Annotated[
        float, typer.Option("--above-barometer-m", help="Height of this air above the barometer, m.")
    ] = 0.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    model: Model = "ciddor_hill1999",
    co2_ppm: CarbonDioxide = 450.0,
    u_temperature_c: Annotated[float, typer.Option(help="Standard uncertainty of the temperature, °C.", **U)] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(help="Of the pressure, hPa.", **U)] = 0.0,
    u_barometer_mmhg: Annotated[float, typer.Option(help="Of the mercury as read, mm.", **U)] = 0.0,
    u_mercury_c: Annotated[float, typer.Option(help="Of the mercury's temperature, °C.", **U)] = 0.0,
    u_humidity_percent: Annotated[float, typer.Option(help="Of the relative humidity, %.", **U)] = 0.0,
    u_dew_point_c: Annotated[float, typer.Option(help="Of the dew or frost point, °C.", **U)] = 0.0,
    u_wet_bulb_c: Annotated[float, typer.Option(help="Of the wet bulb, water or ice, °C.", **U)] = 0.0,
    u_vapour_pressure_hpa: Annotated[float, typer.Option(help="Of the vapour pressure, hPa.", **U)] = 0.0,
    u_co2_ppm: Annotated[float, typer.Option(help="Of the carbon dioxide, ppm.", **U)] = 0.0,
    surface_c: Annotated[
        float | None, typer.Option("--surface-c", help="A retroreflector's temperature, °C: will it dew or frost over?")
    ] = None,
    u_surface_c: Annotated[float, typer.Option(help="Of the surface's temperature, °C.", **U)] = 0.0,
    json: Json = False,
) -> None:
    """Index of air, its sensitivities and its uncertainty, from whatever instruments stand there."""
    from catseye.gateways.air.objects import air_object, air_passages, air_verdict, stated_inputs
    from catseye.gateways.writers.objects import json_line
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.routes import IndexFormula, air_by, formula_uncertainty, station_pressure, surface_of

    u_of = {
        "u-humidity-percent": (u_humidity_percent, ("humidity_percent",)),
        "u-dew-point-c": (u_dew_point_c, ("dew_point_c", "frost_point_c")),
        "u-wet-bulb-c": (u_wet_bulb_c, ("wet_bulb_c", "ice_bulb_c")),
        "u-vapour-pressure-hpa": (u_vapour_pressure_hpa, ("vapour_pressure_hpa",)),
    }
    given = {
        "humidity_percent": humidity_percent,
        "dew_point_c": dew_point_c,
        "frost_point_c": frost_point_c,
        "wet_bulb_c": wet_bulb_c,
        "ice_bulb_c": ice_bulb_c,
        "vapour_pressure_hpa": vapour_pressure_hpa,
    }
    moisture = _moisture(given, u_of)
    if u_surface_c > 0.0 and surface_c is None:
        raise typer.BadParameter("belongs to --surface-c.", param_hint="'--u-surface-c'")
    stated = stated_inputs(
        temperature=u_temperature_c,
        pressure=max(u_pressure_hpa, u_barometer_mmhg, u_mercury_c),
        humidity=moisture.u,
        carbon_dioxide=u_co2_ppm,
    )
    u_of_formula = 0.0
    _one_pressure(pressure_hpa, barometer_mmhg, mercury_c, gravity, latitude_deg, elevation_m)
    if pressure_hpa is None:
        assert barometer_mmhg is not None  # else `_one_pressure` has refused
        assert mercury_c is not None
        latitude = None if latitude_deg is None else latitude_deg * DEGREE
        read = {"u_reading_mmhg": u_barometer_mmhg, "u_mercury_c": u_mercury_c}
        place: dict[str, Any] = {"gravity": gravity, "latitude": latitude, "elevation": elevation_m}
        found_p, u_p = station_pressure(barometer_mmhg, mercury_c, **place, **read)
        u_of_formula = float(station_pressure(barometer_mmhg, mercury_c, **place)[1])
        pressure_hpa, u_pressure_hpa = float(found_p), math.hypot(u_pressure_hpa, float(u_p))
    elif u_barometer_mmhg > 0.0 or u_mercury_c > 0.0:
        raise typer.BadParameter("belong to --barometer-mmhg.", param_hint="'--u-barometer-mmhg', '--u-mercury-c'")
    formula = IndexFormula(wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm)
    known = (temperature_c, pressure_hpa, moisture)
    state, u = air_by(
        *known,
        above_barometer=above_barometer_m,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=u_pressure_hpa,
        u_co2_ppm=u_co2_ppm,
        formula=formula,
    )
    u_formula = formula_uncertainty(
        *known, above_barometer=above_barometer_m, u_pressure_hpa=u_of_formula, formula=formula
    )
    verdict = air_verdict(state, u, stated)
    answer = air_object(state, wavelength_um, u, verdict=verdict, stated=stated, u_formula=u_formula)
    if surface_c is not None:
        u_weather = {"u_temperature_c": u_temperature_c, "u_pressure_hpa": u_pressure_hpa}
        surface = surface_of(state, moisture, surface_c, u_surface_c=u_surface_c, **u_weather)
        answer["condensation"] = surface._asdict()
    if json:
        say(json_line(answer))
        return
    for passage in [Passage("verdict", verdict.text), *air_passages(answer)]:
        say(wrapped(passage.title, passage.text))
    if surface_c is not None:
        say(wrapped("surface", surface.lines()[0]))


def _moisture(given: dict[str, float | None], u_of: dict[str, tuple[float, tuple[str, ...]]]) -> "Moisture":
    """The one way in which the humidity was given, with its uncertainty."""
    from catseye.reduction.air.routes import HYGROMETERS as kinds
    from catseye.reduction.air.routes import Moisture

    given_kinds = [kind for kind in kinds if given[kind] is not None]
    if len(given_kinds) != 1:
        ways = ", ".join(f"--{kind.replace('_', '-')}" for kind in kinds)
        raise typer.BadParameter(f"give one of {ways}{', not several' if given_kinds else ''}.", param_hint="humidity")
    kind = given_kinds[0]
    for option, (u, kinds_of) in u_of.items():
        if u > 0.0 and kind not in kinds_of:
            raise typer.BadParameter(f"does not belong to --{kind.replace('_', '-')}.", param_hint=f"'--{option}'")
    u = next(u for u, kinds_of in u_of.values() if kind in kinds_of)
    value = given[kind]
    assert value is not None  # it is the one that was given
    return Moisture(kind, value, u)


def _one_pressure(
    pressure: float | None,
    mercury: float | None,
    mercury_c: float | None,
    gravity: float | None,
    latitude: float | None,
    elevation: float | None,
) -> None:
    """A pressure, or a mercury barometer with all that turns it into one."""
    if (pressure is None) == (mercury is None):
        raise typer.BadParameter("give --pressure-hpa or --barometer-mmhg, not both.", param_hint="pressure")
    rest = (mercury_c, gravity, latitude, elevation)
    if mercury is None:
        if any(value is not None for value in rest):
            raise typer.BadParameter(
                "--mercury-c, --gravity, --latitude-deg and --elevation-m belong to --barometer-mmhg.",
                param_hint="'--pressure-hpa'",
            )
        return
    place = [value is not None for value in (latitude, elevation)]
    if mercury_c is None or not (all(place) if gravity is None else not any(place)):
        raise typer.BadParameter(
            "needs --mercury-c, and --gravity or both --latitude-deg and --elevation-m.",
            param_hint="'--barometer-mmhg'",
        )
