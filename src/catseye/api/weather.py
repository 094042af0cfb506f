"""`air` and `sound`: the index of air and the speed of sound for one state of weather or arrays of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from catseye.api.result import Result, quantities
from catseye.atmosphere.index.model import IndexSensitivity

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.atmosphere.index.air import AirState
    from catseye.atmosphere.sound.model import SoundSensitivity
    from catseye.atmosphere.sound.speed import Sound
    from catseye.gateways.writers.passage import Passage


@dataclass(frozen=True, eq=False, repr=False)
class AirResult(Result):
    """The index of air; arrays have the shape of the inputs, broadcast together.

    temperature_c, pressure_hpa, humidity_percent, wavelength_um   the state; relative humidity over liquid water
    group_index, phase_index     n_g and n
    vapour_pressure_hpa          partial pressure of water vapour
    dew_point_c                  over liquid water; nan in perfectly dry air, which has none
    group_wavelength             of 1500 MHz in this air, m
    sensitivity                  derivatives of the group index by weather, relative humidity held
    standard_uncertainty         of the group index: the formula's, and the instruments' as far as they were given
    formula_uncertainty          the formula's own part
    model                        name of the formula
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    wavelength_um: Any
    group_index: Any
    phase_index: Any
    vapour_pressure_hpa: Any
    dew_point_c: Any
    group_wavelength: Any
    sensitivity: IndexSensitivity
    standard_uncertainty: Any
    formula_uncertainty: Any
    model: str
    state: "AirState"

    def passages(self) -> "Sequence[Passage]":
        """The index, its uncertainty and its slopes."""
        from catseye.gateways.air.objects import air_passages

        return air_passages(self.to_object())

    def to_object(self) -> dict[str, Any]:
        """As `catseye air --json`."""
        from catseye.gateways.air.objects import air_object

        return air_object(self.state, self.wavelength_um, self.standard_uncertainty, verdict=self.verdict)

    def tables(self) -> "dict[str, QTable]":
        """One table, a row for each state."""
        import numpy as np

        columns = {
            "temperature": (self.temperature_c, "deg_C"),
            "pressure": (self.pressure_hpa, "hPa"),
            "humidity": (self.humidity_percent, "%"),
            "group_index": (self.group_index, ""),
            "phase_index": (self.phase_index, ""),
            "u_group_index": (self.standard_uncertainty, ""),
            "vapour_pressure": (self.vapour_pressure_hpa, "hPa"),
            "dew_point": (self.dew_point_c, "deg_C"),
            "group_wavelength": (self.group_wavelength, "m"),
        }
        same = np.broadcast_arrays(*(value for value, _ in columns.values()))
        rows = {n: (v.ravel(), unit) for (n, (_, unit)), v in zip(columns.items(), same, strict=True)}
        return {"air": quantities(rows, model=self.model)}


def air(
    temperature_c: Any,
    pressure_hpa: Any,
    humidity_percent: Any,
    *,
    wavelength_um: Any = 0.780,
    model: str = "ciddor_hill1999",
    co2_ppm: Any = 450.0,
    u_temperature_c: Any = 0.0,
    u_pressure_hpa: Any = 0.0,
    u_humidity_percent: Any = 0.0,
    u_co2_ppm: Any = 0.0,
) -> AirResult:
    """Index of air, with sensitivities and uncertainty.

    temperature_c      air temperature, °C; as the next two a number or an array, broadcast together
    pressure_hpa       total pressure, hPa
    humidity_percent   relative humidity over liquid water, %
    wavelength_um      of the carrier in vacuum, µm
    model              ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963
    co2_ppm            carbon dioxide, ppm, where the model has it
    u_...              standard uncertainties of the inputs; with none the result's is the formula's alone

    Raises ValidityError where a value is outside the range of the formula.
    Source: the model's own file in `catseye.atmosphere.index`.

    >>> round(float(air(20.0, 933.0, 50.0).group_index), 9)
    1.000253319
    """
    from catseye.atmosphere.index.air import air as state_of
    from catseye.gateways.air.objects import air_verdict

    state = state_of(
        temperature_c, pressure_hpa, humidity_percent, wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm
    )
    u = state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm=u_co2_ppm)
    return AirResult(
        air_verdict(state, u),
        state.temperature_c,
        state.pressure_hpa,
        state.humidity_percent,
        wavelength_um,
        state.group_index,
        state.phase_index,
        state.vapour_pressure_hpa,
        state.dew_point_c,
        state.group_wavelength,
        state.sensitivity,
        u,
        state.standard_uncertainty,
        model,
        state,
    )


@dataclass(frozen=True, eq=False, repr=False)
class SoundResult(Result):
    """The speed of sound; arrays have the shape of the inputs, broadcast together.

    temperature_c, pressure_hpa, humidity_percent   the state; relative humidity over liquid water
    speed, dry_speed       m/s
    vapour_pressure_hpa    partial pressure of water vapour
    sensitivity            derivatives of the speed
    standard_uncertainty   of the speed, m/s: the formula's, and the instruments' as far as they were given
    formula_uncertainty    the formula's own part
    model                  name of the formula
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    speed: Any
    dry_speed: Any
    vapour_pressure_hpa: Any
    sensitivity: "SoundSensitivity"
    standard_uncertainty: Any
    formula_uncertainty: Any
    model: str
    state: "Sound"
    co2_ppm: Any

    def passages(self) -> "Sequence[Passage]":
        """The speed, its slopes and what other formulas say; of an array, how far it goes."""
        from catseye.gateways.air.sound_objects import sound_passages

        return sound_passages(self.to_object())

    def to_object(self) -> dict[str, Any]:
        """As `catseye sound --json`."""
        from catseye.gateways.air.sound_objects import sound_object

        weather = (self.temperature_c, self.pressure_hpa, self.humidity_percent)
        return sound_object(self.state, weather, self.co2_ppm, u=self.standard_uncertainty)

    def tables(self) -> "dict[str, QTable]":
        """One table, a row for each state."""
        import numpy as np

        columns = {
            "temperature": (self.temperature_c, "deg_C"),
            "pressure": (self.pressure_hpa, "hPa"),
            "humidity": (self.humidity_percent, "%"),
            "speed": (self.speed, "m / s"),
            "u_speed": (self.standard_uncertainty, "m / s"),
            "dry_speed": (self.dry_speed, "m / s"),
        }
        same = np.broadcast_arrays(*(value for value, _ in columns.values()))
        rows = {n: (v.ravel(), unit) for (n, (_, unit)), v in zip(columns.items(), same, strict=True)}
        return {"sound": quantities(rows, model=self.model)}


def sound(
    temperature_c: Any,
    pressure_hpa: Any,
    humidity_percent: Any,
    *,
    model: str = "parker2004",
    co2_ppm: Any = 450.0,
    u_temperature_c: Any = 0.0,
    u_pressure_hpa: Any = 0.0,
    u_humidity_percent: Any = 0.0,
    u_co2_ppm: Any = 0.0,
) -> SoundResult:
    """Speed of sound in air, with sensitivities and uncertainty.

    temperature_c, pressure_hpa, humidity_percent   as for `air`
    model     parker2004, the notes' as printed, or real_gas, which measures temperature
    co2_ppm   carbon dioxide, ppm; parker2004 has none
    u_...     standard uncertainties of the inputs; with none the result's is the formula's alone

    Raises ValidityError where a value is outside the range of the formula.

    >>> round(float(sound(20.0, 933.0, 50.0).speed), 3)
    343.577
    """
    from catseye.atmosphere.sound.speed import sound as state_of
    from catseye.gateways.air.sound_objects import sound_verdict

    state = state_of(temperature_c, pressure_hpa, humidity_percent, model=model, co2_ppm=co2_ppm)
    u = state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm)
    return SoundResult(
        sound_verdict(state, u),
        temperature_c,
        pressure_hpa,
        humidity_percent,
        state.speed,
        state.dry_speed,
        state.vapour_pressure_hpa,
        state.sensitivity,
        u,
        state.standard_uncertainty,
        model,
        state,
        co2_ppm,
    )
