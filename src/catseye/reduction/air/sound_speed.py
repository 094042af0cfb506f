"""Speed of sound by weather, beside the other formulas, the notes' misprint and dispersion."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.sound import parker2004
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.speed import (
    MODELS,
    Sound,
    model_named,
    partials_of_vapour,
    sound,
    temperature_of_speed_c,
    temperature_of_speed_of_vapour_c,
)
from catseye.atmosphere.weather.humidity import humidity_doubts, relative_humidity_percent
from catseye.errors import ArgumentError, ValidityError
from catseye.reduction.air.stated import WEATHER, stated_inputs, uncertainty_words
from catseye.verdict import Verdict

BY_SPEED = ("speed", "pressure", "humidity")  # inputs of a temperature by sound
FREQUENCIES_HZ = (1e3, 10e3)  # range of loudspeakers


class MisprintCost(NamedTuple):
    """Effect of the notes' misprinted ratio of specific heats of water.

    printed, right               the ratio
    slow_by                      of the speed, m/s
    temperature_read_high_by_c   of a thermometer by that speed, °C
    """

    printed: float
    right: float
    slow_by: ArrayLike
    temperature_read_high_by_c: ArrayLike


class TemperatureBySound(NamedTuple):
    """Temperature of air by the speed of sound.

    temperature_c     °C
    u_temperature_c   its standard uncertainty, °C
    """

    temperature_c: ArrayLike
    u_temperature_c: ArrayLike


class FrequencyExcess(NamedTuple):
    """Speeds at a frequency above the one at zero frequency, m/s."""

    frequency_hz: float
    phase_excess: ArrayLike
    group_excess: ArrayLike


@dataclass(frozen=True, eq=False)
class SoundSpeed:
    """Speed of sound by weather; arrays have the inputs' broadcast shape.

    state      of the sound
    temperature_c, pressure_hpa, humidity_percent   the weather; relative humidity over liquid water
    co2_ppm    carbon dioxide, where the formula has it
    u          standard uncertainty of the speed, of formula and inputs, m/s
    stated     inputs whose uncertainty u includes, of `stated_inputs`
    u_temperature_c   standard uncertainty of a temperature found by the speed, °C; None: it is an input
    frequency_hz      of the sound whose speed is an input, Hz
    temperatures      such a temperature and its u by every formula, or the error outside its limits
    """

    state: Sound
    temperature_c: ArrayLike
    pressure_hpa: ArrayLike
    humidity_percent: ArrayLike
    co2_ppm: ArrayLike
    u: ArrayLike
    stated: tuple[str, ...]
    u_temperature_c: ArrayLike | None = None
    frequency_hz: ArrayLike = 0.0
    temperatures: "Mapping[str, TemperatureBySound | ValidityError] | None" = None

    @property
    def verdict(self) -> Verdict:
        """Verdict on the formula's limits, humidity and contributions of the uncertainty."""
        within = Verdict("good", f"within the limits of {self.state.model}; {self.uncertainty_words}")
        return within.hearing(humidity_doubts(self.humidity_percent))

    @property
    def uncertainty_words(self) -> str:
        """Sentence on the contributions that the uncertainty includes."""
        return uncertainty_words(self.stated, WEATHER if self.u_temperature_c is None else BY_SPEED)

    @cached_property
    def by_formula(self) -> Mapping[str, "Sound | ValidityError"]:
        """State by every formula, or the error outside its limits."""
        states: dict[str, Sound | ValidityError] = {}
        for name in MODELS:
            try:
                states[name] = sound(
                    self.temperature_c, self.pressure_hpa, self.humidity_percent, model=name, co2_ppm=self.co2_ppm
                )
            except ValidityError as problem:
                states[name] = problem
        return states

    @property
    def misprint(self) -> MisprintCost:
        """Effect of the notes' misprinted ratio of specific heats of water."""
        weather = (self.temperature_c, self.pressure_hpa, self.state.vapour_pressure_hpa)
        printed = parker2004.speed(*weather)
        right = parker2004.speed(*weather, gamma_water=parker2004.GAMMA_VAPOUR)
        per_c = parker2004.partials(*weather).temperature_c
        slow_by = right - printed
        return MisprintCost(parker2004.GAMMA_WATER, parker2004.GAMMA_VAPOUR, slow_by, slow_by / per_c)

    @property
    def dispersion(self) -> tuple[FrequencyExcess, ...]:
        """Speeds at the frequencies of loudspeakers above the one at zero frequency."""
        excesses = []
        for frequency in FREQUENCIES_HZ:
            share = dispersion(
                self.temperature_c, self.pressure_hpa, self.state.vapour_pressure_hpa, frequency_hz=frequency
            )
            excesses.append(FrequencyExcess(frequency, share.phase * self.state.speed, share.group * self.state.speed))
        return tuple(excesses)


def sound_by_weather(  # noqa: PLR0913 - a state with the uncertainty of each input
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    humidity_percent: ArrayLike,
    *,
    model: str = "parker2004",
    co2_ppm: ArrayLike = 450.0,
    u_temperature_c: ArrayLike = 0.0,
    u_pressure_hpa: ArrayLike = 0.0,
    u_humidity_percent: ArrayLike = 0.0,
    u_co2_ppm: ArrayLike = 0.0,
) -> SoundSpeed:
    """Speed of sound by weather.

    temperature_c, pressure_hpa, humidity_percent   °C, hPa, % over liquid water
    model     a name in `atmosphere.sound.speed.MODELS`
    co2_ppm   carbon dioxide, ppm, where the model has it
    u_...     standard uncertainties

    Raises ValidityError where a value is outside the range of the formula.

    >>> round(float(sound_by_weather(20.0, 933.0, 50.0).state.speed), 3)
    343.577
    """
    state = sound(temperature_c, pressure_hpa, humidity_percent, model=model, co2_ppm=co2_ppm)
    return SoundSpeed(
        state=state,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        co2_ppm=co2_ppm,
        u=state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm),
        stated=stated_inputs(
            temperature=u_temperature_c, pressure=u_pressure_hpa, humidity=u_humidity_percent, carbon_dioxide=u_co2_ppm
        ),
    )


@dataclass(frozen=True, eq=False)
class MeasuredSound:
    """Speed of sound in air, with pressure and humidity there.

    speed                 m/s
    pressure_hpa          hPa
    humidity_percent      % over liquid water; None: the next
    vapour_pressure_hpa   hPa; None: the one above
    frequency_hz          of the sound, Hz; 0: its dispersion is corrected already
    co2_ppm               carbon dioxide, where the formula has it
    u_...                 standard uncertainties
    """

    speed: ArrayLike
    pressure_hpa: ArrayLike
    humidity_percent: ArrayLike | None = None
    vapour_pressure_hpa: ArrayLike | None = None
    frequency_hz: ArrayLike = 0.0
    co2_ppm: ArrayLike = 450.0
    u_speed: ArrayLike = 0.0
    u_pressure_hpa: ArrayLike = 0.0
    u_humidity_percent: ArrayLike = 0.0
    u_vapour_pressure_hpa: ArrayLike = 0.0
    u_co2_ppm: ArrayLike = 0.0

    def temperature(self, model: str) -> tuple[TemperatureBySound, Sound]:
        """Temperature by a formula, and the sound at it.

        The uncertainty is that of the speed, of the formula and of the other inputs, over the slope of the speed by
        temperature with the same humidity, or the same vapour pressure, held.
        Raises ValidityError where a value is outside the range of the formula, the resulting temperature included.
        Source: [PARKER04] eqs. 4.6 and 4.7; [JCGM100] eq. 10.
        """
        how = {"model": model, "co2_ppm": self.co2_ppm}
        p, e = self.pressure_hpa, self.vapour_pressure_hpa
        if e is None:
            relative = self.humidity_percent
            t = temperature_of_speed_c(self.speed, p, relative, **how, frequency_hz=self.frequency_hz)
        else:
            t = temperature_of_speed_of_vapour_c(self.speed, p, e, **how, frequency_hz=self.frequency_hz)
            relative = relative_humidity_percent(e, t, p, formula=model_named(model).vapour_formula)
        state = sound(t, p, relative, **how)
        slope = state.sensitivity
        if e is not None:
            by_vapour = partials_of_vapour(t, p, e, **how)
            slope = slope._replace(temperature_c=by_vapour.temperature_c, pressure_hpa=by_vapour.pressure_hpa)
        parts = (
            state.standard_uncertainty,
            self.u_speed,
            slope.pressure_hpa * np.asarray(self.u_pressure_hpa, float),
            slope.humidity_percent * np.asarray(self.u_humidity_percent, float),
            slope.vapour_pressure_hpa * np.asarray(self.u_vapour_pressure_hpa, float),
            slope.co2_ppm * np.asarray(self.u_co2_ppm, float),
        )
        u = np.sqrt(sum(np.square(np.asarray(part, float)) for part in parts)) / slope.temperature_c
        return TemperatureBySound(t, u), state


def require_weather(
    temperature_c: ArrayLike | None,
    pressure_hpa: ArrayLike | None,
    humidity_percent: ArrayLike | None,
    speed: ArrayLike | None,
    u_temperature_c: ArrayLike,
    by_speed: Mapping[str, ArrayLike | None],
) -> None:
    """Raise ArgumentError unless weather, or speed with weather, is complete.

    by_speed   arguments that belong to a speed, by name; None or 0 where not given
    """
    if (temperature_c is None) == (speed is None):
        excess = "" if speed is None else ", not both"
        raise ArgumentError(f"give temperature_c or speed{excess}", "temperature_c", "speed")
    if pressure_hpa is None:
        raise ArgumentError("pressure_hpa is missing", "pressure_hpa")
    if speed is not None:
        if np.any(np.asarray(u_temperature_c, float) > 0.0):
            raise ArgumentError("u_temperature_c does not belong to speed", "u_temperature_c", "speed")
        return
    if humidity_percent is None:
        raise ArgumentError("humidity_percent is missing", "humidity_percent")
    for name, value in by_speed.items():
        if value is not None and np.any(np.asarray(value, float) != 0.0):
            raise ArgumentError(f"{name} belongs to speed", name, "speed")


def air_by_sound(measured: MeasuredSound, model: str = "parker2004") -> SoundSpeed:
    """Temperature of air by the speed of sound in it.

    model   a name in `atmosphere.sound.speed.MODELS`

    Raises ValidityError as `MeasuredSound.temperature`; ArgumentError: no humidity or two, or an uncertainty of the
    one that is not given.
    Source: [PARKER04] eqs. 4.6 and 4.7.

    >>> found = air_by_sound(MeasuredSound(343.576743, 933.0, 50.0))
    >>> round(float(found.temperature_c), 4), round(float(found.u_temperature_c), 2)
    (20.0, 1.67)
    """
    moist = {"humidity_percent": measured.humidity_percent, "vapour_pressure_hpa": measured.vapour_pressure_hpa}
    if (measured.humidity_percent is None) == (measured.vapour_pressure_hpa is None):
        excess = "" if measured.humidity_percent is None else ", not both"
        raise ArgumentError(f"humidity: give humidity_percent or vapour_pressure_hpa{excess}", *moist)
    for name, value in moist.items():
        if value is None and np.any(np.asarray(getattr(measured, f"u_{name}"), float) > 0.0):
            raise ArgumentError(f"u_{name} belongs to {name}", f"u_{name}", name)
    found, state = measured.temperature(model)
    temperatures: dict[str, TemperatureBySound | ValidityError] = {}
    for name in MODELS:
        try:
            temperatures[name] = measured.temperature(name)[0]
        except ValidityError as problem:
            temperatures[name] = problem
    u_moist = np.add(measured.u_humidity_percent, measured.u_vapour_pressure_hpa)
    relative = measured.humidity_percent
    if relative is None:
        formula = model_named(model).vapour_formula
        relative = relative_humidity_percent(
            state.vapour_pressure_hpa, found.temperature_c, measured.pressure_hpa, formula=formula
        )
    return SoundSpeed(
        state=state,
        temperature_c=found.temperature_c,
        pressure_hpa=measured.pressure_hpa,
        humidity_percent=relative,
        co2_ppm=measured.co2_ppm,
        u=np.hypot(state.standard_uncertainty, measured.u_speed),
        stated=stated_inputs(
            speed=measured.u_speed,
            pressure=measured.u_pressure_hpa,
            humidity=u_moist,
            carbon_dioxide=measured.u_co2_ppm,
        ),
        u_temperature_c=found.u_temperature_c,
        frequency_hz=measured.frequency_hz,
        temperatures=temperatures,
    )
