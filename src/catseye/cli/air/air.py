"""The command of the air."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app, uncertainty
from catseye.cli.results import tell
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.names import AIR_MODEL

U = {"callback": uncertainty}
Temperature = Annotated[float, typer.Option("--temperature-c", help="Air temperature, °C.")]
Model = Annotated[
    str, typer.Option("--model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula for the index of air.")
]
CarbonDioxide = Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm; only ciddor_hill1999 has it.")]


@app.command(
    epilog="\b\nExample: catseye air --temperature-c 20 --pressure-hpa 933 --humidity-percent 50\n"
    "Example: catseye air --temperature-c 20 --wet-bulb-c 14 --barometer-mmhg 700 --mercury-c 20 "
    "--latitude-deg 38.45 --elevation-m 797.3 --model rueger1990\n"
    "Example: catseye air --temperature-c=-5 --humidity-over-ice-percent 90 --pressure-hpa 929 --clear-sky --wind 0.5"
)
def air(  # noqa: PLR0913 - its options are its command line
    temperature_c: Temperature,
    pressure_hpa: Annotated[float | None, typer.Option("--pressure-hpa", help="Total pressure, hPa.")] = None,
    humidity_percent: Annotated[
        float | None,
        typer.Option("--humidity-percent", help="Relative humidity over liquid water, %, or one of the next six."),
    ] = None,
    humidity_over_ice_percent: Annotated[
        float | None,
        typer.Option("--humidity-over-ice-percent", help="Relative humidity over ice, %; air at most 0.01 °C warm."),
    ] = None,
    dew_point_c: Annotated[float | None, typer.Option("--dew-point-c", help="Dew point of a mirror, °C.")] = None,
    frost_point_c: Annotated[float | None, typer.Option("--frost-point-c", help="Frost point of a mirror, °C.")] = None,
    wet_bulb_c: Annotated[float | None, typer.Option("--wet-bulb-c", help="Wet bulb of a psychrometer, °C.")] = None,
    ice_bulb_c: Annotated[
        float | None, typer.Option("--ice-bulb-c", help="Wet bulb of a psychrometer, frozen, °C.")
    ] = None,
    vapour_pressure_hpa: Annotated[
        float | None, typer.Option("--vapour-pressure-hpa", help="Partial pressure of the vapour, hPa.")
    ] = None,
    barometer_mmhg: Annotated[
        float | None, typer.Option("--barometer-mmhg", help="Mercury column as read, mm; replaces --pressure-hpa.")
    ] = None,
    mercury_c: Annotated[float | None, typer.Option("--mercury-c", help="Temperature of the mercury, °C.")] = None,
    gravity: Annotated[float | None, typer.Option("--gravity", help="Gravity at the barometer, m/s².")] = None,
    gravity_station: Annotated[
        str | None,
        typer.Option("--gravity-station", metavar="AA|B|AB", help="Measured gravity of a station at Green Bank."),
    ] = None,
    latitude_deg: Annotated[
        float | None,
        typer.Option("--latitude-deg", help="Latitude, degrees, for gravity, or for a station's anomaly."),
    ] = None,
    elevation_m: Annotated[
        float | None,
        typer.Option("--elevation-m", help="Elevation above sea level, m, for gravity; within 50 m of a station."),
    ] = None,
    above_barometer_m: Annotated[
        float, typer.Option("--above-barometer-m", help="Height of this air above the barometer, m.")
    ] = 0.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    model: Model = AIR_MODEL,
    co2_ppm: CarbonDioxide = 450.0,
    u_temperature_c: Annotated[float, typer.Option(help="Standard uncertainty of the temperature, °C.", **U)] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(help="Standard uncertainty of the pressure, hPa.", **U)] = 0.0,
    u_barometer_mmhg: Annotated[
        float, typer.Option(help="Standard uncertainty of the mercury as read, mm.", **U)
    ] = 0.0,
    u_mercury_c: Annotated[
        float, typer.Option(help="Standard uncertainty of the mercury's temperature, °C.", **U)
    ] = 0.0,
    u_humidity_percent: Annotated[
        float, typer.Option(help="Standard uncertainty of the relative humidity, %.", **U)
    ] = 0.0,
    u_dew_point_c: Annotated[
        float, typer.Option(help="Standard uncertainty of the dew or frost point, °C.", **U)
    ] = 0.0,
    u_wet_bulb_c: Annotated[
        float, typer.Option(help="Standard uncertainty of the wet bulb, water or ice, °C.", **U)
    ] = 0.0,
    u_vapour_pressure_hpa: Annotated[
        float, typer.Option(help="Standard uncertainty of the vapour pressure, hPa.", **U)
    ] = 0.0,
    u_co2_ppm: Annotated[float, typer.Option(help="Standard uncertainty of the carbon dioxide, ppm.", **U)] = 0.0,
    surface_c: Annotated[
        float | None,
        typer.Option("--surface-c", help="Temperature of a retroreflector, °C, to test for dew or frost."),
    ] = None,
    u_surface_c: Annotated[
        float, typer.Option(help="Standard uncertainty of the surface's temperature, °C.", **U)
    ] = 0.0,
    clear_sky: Annotated[
        bool,
        typer.Option("--clear-sky", help="Test a surface cooled by a clear night sky, in place of --surface-c."),
    ] = False,
    wind: Annotated[float | None, typer.Option("--wind", help="Wind along that surface, m/s; 1 if not given.")] = None,
    emissivity: Annotated[
        float | None,
        typer.Option("--emissivity", help="Emissivity of that surface; 0.9 (glass) if not given, bare gold 0.03."),
    ] = None,
    sky_view: Annotated[
        float | None, typer.Option("--sky-view", help="Share of the hemisphere that is sky; 1 if not given.")
    ] = None,
    json: Json = False,
) -> None:
    """Index of air from any instruments, with sensitivities and uncertainty."""
    from catseye.api.weather import air as air_of

    result = air_of(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        humidity_over_ice_percent=humidity_over_ice_percent,
        dew_point_c=dew_point_c,
        frost_point_c=frost_point_c,
        wet_bulb_c=wet_bulb_c,
        ice_bulb_c=ice_bulb_c,
        vapour_pressure_hpa=vapour_pressure_hpa,
        barometer_mmhg=barometer_mmhg,
        mercury_c=mercury_c,
        gravity=gravity,
        gravity_station=gravity_station,
        latitude_deg=latitude_deg,
        elevation_m=elevation_m,
        above_barometer_m=above_barometer_m,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=u_pressure_hpa,
        u_barometer_mmhg=u_barometer_mmhg,
        u_mercury_c=u_mercury_c,
        u_humidity_percent=u_humidity_percent,
        u_dew_point_c=u_dew_point_c,
        u_wet_bulb_c=u_wet_bulb_c,
        u_vapour_pressure_hpa=u_vapour_pressure_hpa,
        u_co2_ppm=u_co2_ppm,
        surface_c=surface_c,
        u_surface_c=u_surface_c,
        clear_sky=clear_sky,
        wind=wind,
        emissivity=emissivity,
        sky_view=sky_view,
    )
    tell(result, json=json)
