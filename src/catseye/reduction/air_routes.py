"""The air from what instruments read: a barometer's mercury to pressure, a hygrometer to vapour, both to the index.

Each way that the notes name ends in the same answer, with the uncertainty that its instruments give it.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from catseye.atmosphere import barometer, hygrometer
from catseye.atmosphere.air import MODELS, Air, air, air_of_vapour, group_partials
from catseye.atmosphere.condensation import Condensation, condensation

Hygrometer = Literal[
    "humidity_percent", "dew_point_c", "frost_point_c", "wet_bulb_c", "ice_bulb_c", "vapour_pressure_hpa"
]
HYGROMETERS: tuple[Hygrometer, ...] = (
    "humidity_percent",
    "dew_point_c",
    "frost_point_c",
    "wet_bulb_c",
    "ice_bulb_c",
    "vapour_pressure_hpa",
)


@dataclass(frozen=True)
class Moisture:
    """What an instrument of humidity read.

    kind    relative humidity over liquid water (%), dew or frost point of a mirror (°C), wet bulb over water or over
            ice (°C), or the vapour pressure itself (hPa)
    value   in that unit
    u       its standard uncertainty, the same unit
    """

    kind: Hygrometer
    value: Any
    u: Any = 0.0


def station_pressure_hpa(reading_mmhg, mercury_c, *, gravity=None, latitude=None, elevation=None):
    """Station pressure from a mercury barometer; gravity measured, or by latitude and elevation.

    reading_mmhg   uncorrected height of the mercury on a brass scale, mm
    mercury_c      temperature of barometer and mercury, °C
    gravity        local, m/s²; None: from the two below
    latitude       rad
    elevation      m above the sea

    Source: [PARKER04] eqs. 1.8 to 1.20.
    """
    if gravity is None:
        gravity = barometer.normal_gravity(latitude, elevation)
    return barometer.station_pressure_hpa(reading_mmhg, mercury_c, gravity)


def air_by(
    temperature_c,
    pressure_hpa,
    moisture: Moisture,
    *,
    above_barometer=0.0,
    u_temperature_c=0.0,
    u_pressure_hpa=0.0,
    u_co2_ppm=0.0,
    wavelength_um=0.780,
    model="ciddor_hill1999",
    co2_ppm=450.0,
    modulation_hz=1500e6,
) -> tuple[Air, Any]:
    """The air and the standard uncertainty of its group index, formula and instruments.

    temperature_c     of the air, °C
    pressure_hpa      at the barometer, hPa
    moisture          what was read
    above_barometer   height of the air above the barometer, m, within 1 km: at rest and of one temperature between
    u_temperature_c   standard uncertainty of the temperature, °C; it reaches the index by the density and by the vapour
    u_pressure_hpa    of the pressure, hPa
    u_co2_ppm         of the carbon dioxide, ppm
    others            as of `atmosphere.air.air`

    Raises ValidityError for what cannot be.
    Source: [JCGM100] eq. 10; the instruments' equations are in `atmosphere.hygrometer`.

    >>> found, u = air_by(20.0, 933.0, Moisture("dew_point_c", 9.267, 0.2), model="rueger1990")
    >>> round(float(found.humidity_percent), 2), round(float(u) * 1e6, 4)
    (50.0, 0.1002)
    """
    light = {"wavelength_um": wavelength_um, "model": model, "co2_ppm": co2_ppm}
    u = {"u_temperature_c": u_temperature_c, "u_pressure_hpa": u_pressure_hpa}
    at = _carried(temperature_c, pressure_hpa, above_barometer, moisture, model)
    if moisture.kind == "humidity_percent":
        found = air(temperature_c, at, moisture.value, modulation_hz=modulation_hz, **light)
        return found, found.combined_uncertainty(**u, u_humidity_percent=moisture.u, u_co2_ppm=u_co2_ppm)
    vapour = read(temperature_c, at, moisture, model)
    found = air_of_vapour(temperature_c, at, vapour.vapour_pressure_hpa, modulation_hz=modulation_hz, **light)
    partials = group_partials(temperature_c, at, vapour.vapour_pressure_hpa, **light)
    formula = np.hypot(found.standard_uncertainty, partials.co2_ppm * np.asarray(u_co2_ppm, float))
    return found, vapour.index_uncertainty(partials, moisture.u, **u, u_model=formula)


def surface_of(state: Air, surface_c, u_surface_c=0.0, u_temperature_c=0.0) -> Condensation:
    """Whether a surface in this air will dew or frost over.

    state             the air
    surface_c         temperature of the surface, °C
    u_surface_c       its standard uncertainty, °C
    u_temperature_c   that of the air's temperature, °C

    >>> found, _ = air_by(10.0, 933.0, Moisture("humidity_percent", 75.0))
    >>> str(surface_of(found, 5.0).deposit)
    'dew'
    """
    # to rounding and the formulas' 0.2 % air may be a little more than saturated; the surface's answer is the same
    humidity = np.minimum(state.humidity_percent, 100.0)
    return condensation(
        surface_c,
        state.temperature_c,
        state.pressure_hpa,
        humidity,
        u_surface_c=u_surface_c,
        u_temperature_c=u_temperature_c,
    )


def read(temperature_c, pressure_hpa, moisture: Moisture, model: str) -> hygrometer.Reading:
    """Vapour pressure from an instrument, by the saturation formula that goes with the model where it has one.

    Over ice and in a psychrometer the formula is the notes', Buck's.
    """
    formula = MODELS[model].vapour_formula if model in MODELS else "buck"
    if moisture.kind == "humidity_percent":
        return hygrometer.of_relative_humidity(temperature_c, pressure_hpa, moisture.value, formula)
    if moisture.kind == "dew_point_c":
        return hygrometer.of_mirror(moisture.value, pressure_hpa, formula, deposit="dew")
    if moisture.kind == "frost_point_c":
        return hygrometer.of_mirror(moisture.value, pressure_hpa, deposit="frost")
    if moisture.kind == "vapour_pressure_hpa":
        e = np.asarray(moisture.value, float)
        return hygrometer.Reading(e, np.zeros_like(e), np.zeros_like(e), np.ones_like(e), np.zeros_like(e))
    over_ice = moisture.kind == "ice_bulb_c"
    return hygrometer.of_wet_bulb(temperature_c, moisture.value, pressure_hpa, over_ice=over_ice)


def _carried(temperature_c, pressure_hpa, above, moisture: Moisture, model: str):
    """Pressure at the air's height; the air between has the vapour that the instrument shows at the barometer."""
    if np.all(np.asarray(above) == 0.0):
        return pressure_hpa
    e = read(temperature_c, pressure_hpa, moisture, model).vapour_pressure_hpa
    carried = barometer.carried_pressure(
        pressure_hpa, temperature_c, 0.0, above, lapse_c_per_m=0.0, vapour_pressure_hpa=e
    )
    return carried.pressure_hpa
