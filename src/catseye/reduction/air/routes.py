"""Air and index from instrument readings.

A barometer's mercury to pressure, a hygrometer to vapour, both to the index.

Each route of the notes ends in the same answer, with the uncertainty of its instruments.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.atmosphere.index import hygrometer
from catseye.atmosphere.index.air import MODELS, AirState, air, air_of_vapour, group_partials
from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather import barometer, humidity
from catseye.atmosphere.weather.condensation import Condensation, CondensationSpread, condensation
from catseye.errors import ArgumentError
from catseye.names import AIR_MODEL

Hygrometer = Literal[
    "humidity_percent",
    "humidity_over_ice_percent",
    "dew_point_c",
    "frost_point_c",
    "wet_bulb_c",
    "ice_bulb_c",
    "vapour_pressure_hpa",
]
HYGROMETERS: tuple[Hygrometer, ...] = (
    "humidity_percent",
    "humidity_over_ice_percent",
    "dew_point_c",
    "frost_point_c",
    "wet_bulb_c",
    "ice_bulb_c",
    "vapour_pressure_hpa",
)
PRESSURES = ("pressure_hpa", "barometer_mmhg")
ABOVE = ValidInterval("height above the barometer", "m", -1000.0, 1000.0, "air of one temperature")
UNCERTAINTY_OF: Mapping[str, tuple[Hygrometer, ...]] = {  # argument -> readings whose uncertainty it is
    "u_humidity_percent": ("humidity_percent", "humidity_over_ice_percent"),
    "u_dew_point_c": ("dew_point_c", "frost_point_c"),
    "u_wet_bulb_c": ("wet_bulb_c", "ice_bulb_c"),
    "u_vapour_pressure_hpa": ("vapour_pressure_hpa",),
}
U_STANDARD_GRAVITY = 0.02  # m/s²: gravity at stations from 9.78 to 9.83, instead of 9.80665
U_LAPSE = 0.0065  # °C/m, of air taken as isothermal: the standard air's lapse


@dataclass(frozen=True)
class Moisture:
    """Reading of an instrument of humidity.

    kind    relative humidity over liquid water or over ice (%), dew or frost point of a mirror (°C), wet bulb over
            water or over ice (°C), or the vapour pressure itself (hPa)
    value   in that unit
    u       its standard uncertainty, the same unit
    """

    kind: Hygrometer
    value: ArrayLike
    u: ArrayLike = 0.0


def moisture_of(readings: Mapping[Hygrometer, ArrayLike | None], uncertainties: Mapping[str, ArrayLike]) -> Moisture:
    """The one reading of humidity among several arguments, with its uncertainty.

    readings        value by kind, None where there is none
    uncertainties   by the names in `UNCERTAINTY_OF`; 0 where there is none

    Raises ArgumentError: no reading, several, or an uncertainty of another.

    >>> moisture_of({"dew_point_c": 9.3}, {"u_dew_point_c": 0.2})
    Moisture(kind='dew_point_c', value=9.3, u=0.2)
    """
    kinds = [kind for kind in HYGROMETERS if readings.get(kind) is not None]
    if len(kinds) != 1:
        several = ", not several" if kinds else ""
        raise ArgumentError(f"humidity: give one of {', '.join(HYGROMETERS)}{several}", *HYGROMETERS)
    kind = kinds[0]
    value = readings[kind]
    assert value is not None  # of the one kind that has a reading
    for name, u in uncertainties.items():
        if kind not in UNCERTAINTY_OF[name] and np.any(np.asarray(u, dtype=float) > 0.0):
            raise ArgumentError(f"{name} does not belong to {kind}", name, kind)
    own = next(name for name, of in UNCERTAINTY_OF.items() if kind in of)
    return Moisture(kind, value, uncertainties.get(own, 0.0))


@dataclass(frozen=True)
class MercuryColumn:
    """Reading of a mercury barometer with its corrections.

    corrected_mmhg   reading reduced to 0 °C, [PARKER04] eq. 1.8
    gravity          at the barometer, m/s²
    u_gravity        its standard uncertainty; 0 where it was measured
    of               origin of the gravity, as text
    anomaly          measured gravity less that of the formula at this latitude, m/s²; None: no station, or no latitude
    """

    corrected_mmhg: ArrayLike
    gravity: ArrayLike
    u_gravity: float
    of: str
    anomaly: ArrayLike | None = None


@dataclass(frozen=True)
class Pressure:
    """Pressure at the barometer, hPa.

    value       total pressure
    u           its standard uncertainty
    u_formula   part of it that exact readings leave
    stated      True: the uncertainty of a reading is known
    doubts      on what it was computed from, a sentence each
    mercury     corrections of a mercury barometer; None: another instrument
    """

    value: ArrayLike
    u: ArrayLike = 0.0
    u_formula: ArrayLike = 0.0
    stated: bool = False
    doubts: tuple[str, ...] = ()
    mercury: MercuryColumn | None = None


def pressure_of(  # noqa: PLR0913 - an instrument with all that corrects it
    pressure_hpa: ArrayLike | None,
    barometer_mmhg: ArrayLike | None,
    *,
    mercury_c: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    gravity_station: str | None = None,
    latitude_deg: ArrayLike | None = None,
    elevation_m: ArrayLike | None = None,
    u_pressure_hpa: ArrayLike = 0.0,
    u_barometer_mmhg: ArrayLike = 0.0,
    u_mercury_c: ArrayLike = 0.0,
) -> Pressure:
    """The pressure, as read or by a mercury barometer with everything that turns it into one.

    pressure_hpa                 total pressure, hPa; or None and
    barometer_mmhg, mercury_c    mercury as read, mm, and its temperature, °C, with
    gravity                      m/s², or
    gravity_station              name of a station with measured gravity; elevation_m carries it there through free air,
                                 within 50 m, and latitude_deg gives its anomaly; or both of
    latitude_deg, elevation_m    degrees, m above the sea
    u_...                        standard uncertainties

    Raises ArgumentError: arguments that do not fit together; ValidityError: a station that is unknown or too far.
    """
    if (pressure_hpa is None) == (barometer_mmhg is None):
        excess = "" if pressure_hpa is None else ", not both"
        raise ArgumentError(f"pressure: give pressure_hpa or barometer_mmhg{excess}", "pressure_hpa", "barometer_mmhg")
    uncertainties = (u_pressure_hpa, u_barometer_mmhg, u_mercury_c)
    stated = any(np.any(np.asarray(u, dtype=float) > 0.0) for u in uncertainties)
    of_mercury = {
        "mercury_c": mercury_c,
        "gravity": gravity,
        "gravity_station": gravity_station,
        "latitude_deg": latitude_deg,
        "elevation_m": elevation_m,
    }
    if barometer_mmhg is None:
        for name, value in of_mercury.items():
            if value is not None:
                raise ArgumentError(f"{name} belongs to barometer_mmhg, not to pressure_hpa", name, *PRESSURES)
        for name, u in (("u_barometer_mmhg", u_barometer_mmhg), ("u_mercury_c", u_mercury_c)):
            if np.any(np.asarray(u, dtype=float) > 0.0):
                raise ArgumentError(f"{name} belongs to barometer_mmhg, not to pressure_hpa", name, *PRESSURES)
        assert pressure_hpa is not None
        return Pressure(pressure_hpa, u_pressure_hpa, stated=stated)
    if mercury_c is None or not _gravity_is_one(gravity, gravity_station, latitude_deg, elevation_m):
        raise ArgumentError(
            "barometer_mmhg needs mercury_c, and one of gravity, gravity_station, or both latitude_deg and elevation_m",
            *of_mercury,
            *PRESSURES,
        )
    latitude = None if latitude_deg is None else np.radians(latitude_deg)
    corrections = _corrections(barometer_mmhg, mercury_c, gravity, gravity_station, latitude, elevation_m)
    where: dict[str, Any] = {"gravity": corrections.gravity}
    if gravity is None and gravity_station is None:
        where = {"latitude": latitude, "elevation": elevation_m}
    read_so = {"u_reading_mmhg": u_barometer_mmhg, "u_mercury_c": u_mercury_c}
    value, u = station_pressure(barometer_mmhg, mercury_c, **where, **read_so)
    u_formula = station_pressure(barometer_mmhg, mercury_c, **where)[1]
    return Pressure(
        value=value,
        u=np.hypot(u_pressure_hpa, u),
        u_formula=u_formula,
        stated=stated,
        doubts=latitude_doubts(latitude_deg),
        mercury=corrections,
    )


def _gravity_is_one(
    gravity: ArrayLike | None, station: str | None, latitude_deg: ArrayLike | None, elevation_m: ArrayLike | None
) -> bool:
    """True if exactly one source of the gravity is complete."""
    place = [latitude_deg is not None, elevation_m is not None]
    if gravity is not None:
        return station is None and not any(place)
    return station is not None or all(place)


def _corrections(
    reading_mmhg: ArrayLike,
    mercury_c: ArrayLike,
    gravity: ArrayLike | None,
    station_name: str | None,
    latitude: ArrayLike | None,
    elevation: ArrayLike | None,
) -> MercuryColumn:
    corrected = barometer.temperature_corrected_mmhg(reading_mmhg, mercury_c)
    if gravity is not None:
        return MercuryColumn(corrected, gravity, 0.0, "as given")
    if station_name is None:
        normal = barometer.normal_gravity(latitude, elevation)
        return MercuryColumn(corrected, normal, barometer.U_NORMAL_GRAVITY, "latitude and elevation")
    station = barometer.gravity_station(station_name)
    there = station.gravity if elevation is None else station.gravity_at(elevation)
    anomaly = None if latitude is None else station.anomaly(latitude)
    return MercuryColumn(corrected, there, 0.0, f"station {station.name}, {station.where}", anomaly)


def latitude_doubts(latitude_deg: ArrayLike | None) -> tuple[str, ...]:
    """Doubt on a latitude that is likely in radians; empty if not.

    latitude_deg   degrees; None: none

    >>> latitude_doubts(38.43), latitude_doubts(None)
    ((), ())
    >>> latitude_doubts(0.6708)[0][48:82]
    'as radians it is 38.43 degrees; at'
    """
    values = np.ravel(np.asarray(0.0 if latitude_deg is None else latitude_deg, dtype=float))
    if not np.any(values) or np.any(np.abs(values) > np.pi / 2.0):
        return ()
    first = float(values[np.flatnonzero(values)[0]])
    return (
        f"a latitude of {first:g} degrees is at the equator; as radians it is {np.degrees(first):.4g} degrees; at the "
        "equator give the gravity instead",
    )


@dataclass(frozen=True)
class IndexFormula:
    """Formula of the index of air, and its light.

    As `atmosphere.index.air.air` takes them.

    wavelength_um   of the light, in vacuum
    model           a name in `atmosphere.index.air.MODELS`
    co2_ppm         carbon dioxide
    modulation_hz   of the light, Hz
    """

    wavelength_um: float = 0.780
    model: str = AIR_MODEL
    co2_ppm: float = 450.0
    modulation_hz: float = 1500e6


def station_pressure(
    reading_mmhg: ArrayLike,
    mercury_c: ArrayLike,
    *,
    gravity: ArrayLike | None = None,
    latitude: ArrayLike | None = None,
    elevation: ArrayLike | None = None,
    u_reading_mmhg: ArrayLike = 0.0,
    u_mercury_c: ArrayLike = 0.0,
) -> tuple[float | NDArray[np.float64], float | NDArray[np.float64]]:
    """Station pressure from a mercury barometer, and its u, hPa.

    reading_mmhg     uncorrected height of the mercury on a brass scale, mm
    mercury_c        temperature of barometer and mercury, °C
    gravity          local, m/s², measured; None: by the two below, accurate to 3e-4 m/s²
    latitude         rad
    elevation        m above the sea
    u_reading_mmhg   standard uncertainty of the reading, mm
    u_mercury_c      of the mercury's temperature, °C

    Source: [PARKER04] eqs. 1.8 to 1.20.
    """
    u_gravity = 0.0
    if gravity is None:
        gravity, u_gravity = barometer.normal_gravity(latitude, elevation), barometer.U_NORMAL_GRAVITY
    u = barometer.station_pressure_uncertainty_hpa(
        reading_mmhg,
        mercury_c,
        gravity,
        u_reading_mmhg=u_reading_mmhg,
        u_mercury_c=u_mercury_c,
        u_gravity=u_gravity,
    )
    return barometer.station_pressure_hpa(reading_mmhg, mercury_c, gravity), u


def air_by(
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    moisture: Moisture,
    *,
    above_barometer: ArrayLike = 0.0,
    u_temperature_c: ArrayLike = 0.0,
    u_pressure_hpa: ArrayLike = 0.0,
    u_co2_ppm: ArrayLike = 0.0,
    formula: IndexFormula | None = None,
) -> tuple[AirState, float | NDArray[np.float64]]:
    """State of the air, and the standard uncertainty of its group index.

    Of formula and instruments.

    temperature_c     of the air, °C
    pressure_hpa      at the barometer, hPa
    moisture          the reading
    above_barometer   height of the air above the barometer, m, within 1 km: at rest and of one temperature between;
                      the resulting error of the pressure (a lapse of 6.5 °C/km: 0.012 hPa over 100 m, 1.1 hPa over
                      1 km) and the effect of gravity enter the uncertainty
    u_temperature_c   standard uncertainty of the temperature, °C; it reaches the index by the density and by the vapour
    u_pressure_hpa    of the pressure, hPa
    u_co2_ppm         of the carbon dioxide, ppm
    formula           of the index, with its light; None: the defaults

    Raises ValidityError for impossible values.
    Source: [JCGM100] eq. 10; the instruments' equations are in `atmosphere.index.hygrometer`.

    >>> state, u = air_by(20.0, 933.0, Moisture("dew_point_c", 9.267, 0.2), formula=IndexFormula(model="rueger1990"))
    >>> round(float(state.humidity_percent), 2), round(float(u) * 1e6, 4)
    (50.0, 0.0791)
    """
    of = formula or IndexFormula()
    light = {"wavelength_um": of.wavelength_um, "model": of.model, "co2_ppm": of.co2_ppm}
    u = {"u_temperature_c": u_temperature_c, "u_pressure_hpa": u_pressure_hpa}
    at, u["u_pressure_hpa"], at_per_c = _reduced_pressure(
        temperature_c, pressure_hpa, above_barometer, moisture, of.model, u_pressure_hpa
    )
    if moisture.kind == "humidity_percent":
        state = air(temperature_c, at, moisture.value, modulation_hz=of.modulation_hz, **light)
        slope = state.sensitivity
        # a thermometer's error also affects the reduced pressure
        by_c = slope._replace(temperature_c=slope.temperature_c + slope.pressure_hpa * at_per_c)
        combined = replace(state, sensitivity=by_c)
        return state, combined.combined_uncertainty(**u, u_humidity_percent=moisture.u, u_co2_ppm=u_co2_ppm)
    vapour = read(temperature_c, at, moisture, model=of.model)
    state = air_of_vapour(temperature_c, at, vapour.vapour_pressure_hpa, modulation_hz=of.modulation_hz, **light)
    partials = group_partials(temperature_c, at, vapour.vapour_pressure_hpa, **light)
    by_p = partials.pressure_hpa + partials.vapour_pressure_hpa * vapour.per_pressure_hpa
    partials = partials._replace(temperature_c=partials.temperature_c + by_p * at_per_c)
    u_formula = np.hypot(state.standard_uncertainty, partials.co2_ppm * np.asarray(u_co2_ppm, float))
    return state, vapour.index_uncertainty(partials, moisture.u, **u, u_model=u_formula)


def formula_uncertainty(
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    moisture: Moisture,
    *,
    above_barometer: ArrayLike = 0.0,
    u_pressure_hpa: ArrayLike = 0.0,
    formula: IndexFormula | None = None,
) -> float | NDArray[np.float64]:
    """Standard uncertainty of the group index by the formulas alone.

    With exact readings.

    u_pressure_hpa   of the pressure, hPa, by the barometer's own formulas
    others           as of `air_by`: saturation, psychrometer, and the air between, taken at rest, count

    >>> float(formula_uncertainty(20.0, 933.0, Moisture("humidity_percent", 50.0, 2.0)))
    5e-08
    """
    exact = replace(moisture, u=0.0)
    return air_by(
        temperature_c,
        pressure_hpa,
        exact,
        above_barometer=above_barometer,
        u_pressure_hpa=u_pressure_hpa,
        formula=formula,
    )[1]


def surface_of(
    state: AirState,
    moisture: Moisture,
    surface_c: ArrayLike,
    *,
    u_surface_c: ArrayLike = 0.0,
    u_temperature_c: ArrayLike = 0.0,
    u_pressure_hpa: ArrayLike = 0.0,
) -> Condensation:
    """Condensation of dew or frost on a surface in this air.

    state             from `air_by`
    moisture          the reading: its uncertainty is the dew point's, and the air's temperature counts only where the
                      instrument needs it (a mirror reads the dew point itself)
    surface_c         temperature of the surface, °C
    u_surface_c       its standard uncertainty, °C; uncorrelated with the air's
    u_temperature_c   that of the air's temperature, °C
    u_pressure_hpa    that of the pressure, hPa

    >>> read_so = Moisture("humidity_percent", 75.0, 3.0)
    >>> state, _ = air_by(10.0, 933.0, read_so)
    >>> surface = surface_of(state, read_so, 5.0)
    >>> str(surface.deposit), round(float(surface.u_margin_k), 2)
    ('dew', 0.58)
    """
    reading = read(state.temperature_c, state.pressure_hpa, moisture, model=state.model)
    u_vapour = reading.standard_uncertainty_hpa(
        moisture.u, u_temperature_c=u_temperature_c, u_pressure_hpa=u_pressure_hpa
    )
    # by rounding and the formulas' 0.2 % air may be a little oversaturated; the surface's result is the same
    relative = np.minimum(state.humidity_percent, 100.0)
    # the threshold depends on the vapour alone: its uncertainty, as humidity at an exact temperature
    u_humidity = 100.0 * u_vapour / humidity.saturation(state.temperature_c, state.pressure_hpa).pressure_hpa
    u = CondensationSpread(surface_c=u_surface_c, humidity_percent=u_humidity)
    return condensation(surface_c, state.temperature_c, state.pressure_hpa, humidity_percent=relative, u=u)


def read(
    temperature_c: ArrayLike, pressure_hpa: ArrayLike, moisture: Moisture, *, model: str
) -> hygrometer.VapourReading:
    """Vapour pressure from an instrument.

    By the model's saturation formula where it has one.

    Over ice and in a psychrometer the formula is the notes', Buck's.
    """
    formula = MODELS[model].vapour_formula if model in MODELS else "buck"
    if moisture.kind == "humidity_percent":
        return hygrometer.of_relative_humidity(temperature_c, pressure_hpa, moisture.value, formula=formula)
    if moisture.kind == "humidity_over_ice_percent":
        return hygrometer.of_relative_humidity(temperature_c, pressure_hpa, moisture.value, over_ice=True)
    if moisture.kind == "dew_point_c":
        return hygrometer.of_mirror(moisture.value, pressure_hpa, formula, deposit="dew")
    if moisture.kind == "frost_point_c":
        return hygrometer.of_mirror(moisture.value, pressure_hpa, deposit="frost")
    if moisture.kind == "vapour_pressure_hpa":
        e = np.asarray(moisture.value, float)
        return hygrometer.VapourReading(e, np.zeros_like(e), np.zeros_like(e), np.ones_like(e), np.zeros_like(e))
    over_ice = moisture.kind == "ice_bulb_c"
    return hygrometer.of_wet_bulb(temperature_c, moisture.value, pressure_hpa, over_ice=over_ice)


def _reduced_pressure(
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    above: ArrayLike,
    moisture: Moisture,
    model: str,
    u_pressure_hpa: ArrayLike,
) -> tuple[ArrayLike, ArrayLike, float | NDArray[np.float64]]:
    """Pressure at the air's height, its u, and its slope by temperature.

    u without the temperature's; slope in hPa/°C.

    The air between has the vapour measured at the barometer.
    """
    ABOVE.check(above)
    if np.all(np.asarray(above) == 0.0):
        return pressure_hpa, u_pressure_hpa, 0.0
    e = read(temperature_c, pressure_hpa, moisture, model=model).vapour_pressure_hpa
    reduced = barometer.carried_pressure(
        pressure_hpa, temperature_c, 0.0, z_to=above, lapse_c_per_m=0.0, vapour_pressure_hpa=e
    )
    u = reduced.standard_uncertainty_hpa(u_pressure_hpa, u_lapse=U_LAPSE, u_gravity=U_STANDARD_GRAVITY)
    return reduced.pressure_hpa, u, reduced.per_temperature_c
