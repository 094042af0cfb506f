"""Air of a laboratory or a rail: indices and their effects.

Group index of the ranger, phase index of the interferometer.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from catseye.atmosphere.index.air import air
from catseye.constants import PPM, SPEED_OF_LIGHT
from catseye.names import AIR_MODEL, AirModelName
from catseye.records.files.readings import Sheet, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.fit import Effect

WEATHER = {
    "temperature_c": Within(-40, 60),
    "pressure_hpa": Within(300, 1200),
    "humidity_percent": Within(0, 100),
}
SENSORS = {  # key of the sheet -> name and unit
    "temperature_c": ("temperature", "°C"),
    "pressure_hpa": ("pressure", "hPa"),
    "humidity_percent": ("humidity", "%"),
}
Spread = Annotated[float, Within(0, 100)]


class AirSheet(Sheet):
    """Sheet of readings taken through air.

    modulation_hz, u_modulation_ppm        frequency of the modulation, and its standard uncertainty
    wavelength_um                          wavelength of the ranger's light in vacuum
    air_model                              formula for the index
    temperature_c, pressure_hpa, humidity_percent   air of all readings; columns where it changed
    u_temperature_c, ...                   of the sensor: an offset that all readings share
    """

    modulation_hz: Annotated[float, Within(1e7, 1e11)]
    u_modulation_ppm: Annotated[float, Within(0, 1000)]
    wavelength_um: Annotated[float, Within(0.3, 1.7)] = 0.780
    air_model: AirModelName = AIR_MODEL
    temperature_c: Annotated[float, WEATHER["temperature_c"]] | None = None
    pressure_hpa: Annotated[float, WEATHER["pressure_hpa"]] | None = None
    humidity_percent: Annotated[float, WEATHER["humidity_percent"]] | None = None
    u_temperature_c: Spread
    u_pressure_hpa: Spread
    u_humidity_percent: Spread


@dataclass(frozen=True, eq=False)
class CalibrationAir:
    """Index along each path, and its change by a sensor's offset.

    index    (m,)
    slopes   (3, m) per °C, hPa, %
    u_model  standard uncertainty of the formula
    """

    index: np.ndarray
    slopes: np.ndarray
    u_model: float


def group_air(readings: SheetReadings) -> CalibrationAir:
    """Group index of the ranger's light for every reading."""
    sheet = readings.sheet
    state = air(
        *(readings.get(name) for name in SENSORS),
        wavelength_um=sheet.wavelength_um,
        model=sheet.air_model,
        modulation_hz=sheet.modulation_hz,
    )
    return CalibrationAir(
        np.asarray(state.group_index),
        np.array([*state.sensitivity[: len(SENSORS)]]),
        float(np.max(state.standard_uncertainty)),
    )


def phase_air(readings: SheetReadings, wavelength_um: float) -> CalibrationAir:
    """Phase index of an interferometer's light in the same air."""
    sheet = readings.sheet
    state = air(*(readings.get(name) for name in SENSORS), wavelength_um=wavelength_um, model=sheet.air_model)
    slopes = np.array([*state.phase_sensitivity[: len(SENSORS)]])
    return CalibrationAir(np.asarray(state.phase_index), slopes, float(np.max(state.standard_uncertainty)))


def half_wavelength(readings: SheetReadings, state: CalibrationAir) -> np.ndarray:
    """Half the modulation's group wavelength per reading, (m,) m.

    Source: [PARKER04] eq. 5.16.
    """
    return 0.5 * SPEED_OF_LIGHT / (state.index * readings.sheet.modulation_hz)


def sensor_effects(readings: SheetReadings, columns: np.ndarray) -> list[Effect]:
    """Effects of the three sensors' offsets.

    `columns` (3, m): change of the observed values per °C, hPa, %.
    """
    sheet = readings.sheet
    return [
        Effect(f"offset of the sensor of {name}", column, getattr(sheet, f"u_{key}"), unit)
        for (key, (name, unit)), column in zip(SENSORS.items(), columns, strict=True)
    ]


def formula_effect(state: CalibrationAir, path: np.ndarray) -> Effect:
    """Effect of the formula for the group index on the path (m,) m."""
    return Effect("formula for the group index", path / state.index, state.u_model, "1")


def ranger_effects(readings: SheetReadings, state: CalibrationAir, path: np.ndarray) -> list[Effect]:
    """Effects of frequency, formula and sensors on the path (m,) m.

    A reading too long for each unit.

    A true index above the one computed with shortens the true path against the computed one, so the computed is too
    long by path / n for each unit of index; likewise a true frequency above the nominal one, by path for each unit.
    """
    stretch = path / state.index
    return [
        Effect("frequency of the modulation", path * PPM, readings.sheet.u_modulation_ppm, "ppm"),
        formula_effect(state, path),
        *sensor_effects(readings, state.slopes * stretch),
    ]
