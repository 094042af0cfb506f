"""Speed of sound in air by a named model, and temperature from it.

A new model is one file with a MODEL, and one line here. `parker2004` is chapter 4 of the notes as printed, slow in
humid air (see that file): it reproduces the notes. Temperatures are measured with `real_gas`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.sound import cramer1993 as sound_cramer1993
from catseye.atmosphere.sound import parker2004 as sound_parker2004
from catseye.atmosphere.sound import real_gas as sound_real_gas
from catseye.atmosphere.sound.dispersion import FREQUENCY, dispersion
from catseye.atmosphere.sound.model import SoundModel, SoundPartials, SoundSensitivity
from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError

MODELS: dict[str, SoundModel] = {
    "parker2004": sound_parker2004.MODEL,
    "cramer1993": sound_cramer1993.MODEL,
    "real_gas": sound_real_gas.MODEL,
}
THERMOMETRY = "real_gas"
STEPS = 12  # steps of Newton's method; from 20 °C it needs five
CLOSE_ENOUGH_C = 1e-10

SPEED = ValidInterval("speed of sound", "m/s", 250.0, 450.0, "air")


@dataclass(frozen=True)
class Sound:
    """Sound in a state of air, or an array of them.

    speed                  m/s, at zero frequency
    dry_speed              m/s in dry air of the same temperature and pressure
    vapour_pressure_hpa    partial pressure of water vapour, hPa
    sensitivity            derivatives of the speed with relative humidity held
    standard_uncertainty   of the speed, m/s, of the formula alone, exact weather
    model                  the model's name
    """

    speed: Any
    dry_speed: Any
    vapour_pressure_hpa: Any
    sensitivity: SoundSensitivity
    standard_uncertainty: Any
    model: str

    @property
    def travel_time_per_m(self) -> Any:
        """Travel time of sound for a metre, s/m; [PARKER04] eq. 4.13."""
        return 1.0 / self.speed

    @property
    def time_sensitivity(self) -> SoundSensitivity:
        """Derivatives of the travel time for a metre, s/m per unit.

        -1/c² times the speed's; [PARKER04] eq. 4.14.
        """
        return SoundSensitivity(*(-slope / self.speed**2 for slope in self.sensitivity))

    def combined_uncertainty(
        self, u_temperature_c: Any, u_pressure_hpa: Any, u_humidity_percent: Any, u_co2_ppm: Any = 0.0
    ) -> Any:
        """Standard uncertainty of the speed, m/s, from formula and uncorrelated inputs.

        Inputs are 1 sigma each.

        Source: law of propagation of uncertainty, first order; [JCGM100] eq. 10.

        >>> round(float(sound(20.0, 933.0, 50.0, model="real_gas").combined_uncertainty(0.1, 0.0, 0.0)), 3)
        0.072
        """
        slope = self.sensitivity
        return np.sqrt(
            self.standard_uncertainty**2
            + np.square(slope.temperature_c * np.asarray(u_temperature_c, float))
            + np.square(slope.pressure_hpa * np.asarray(u_pressure_hpa, float))
            + np.square(slope.humidity_percent * np.asarray(u_humidity_percent, float))
            + np.square(slope.co2_ppm * np.asarray(u_co2_ppm, float))
        )


def sound(temperature_c, pressure_hpa, humidity_percent, *, model="parker2004", co2_ppm=450.0) -> Sound:
    """Speed of sound in air and its derivatives by weather, zero frequency.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    model              a name in MODELS
    co2_ppm            carbon dioxide, ppm, within the model's limits (parker2004 ignores it)

    Source: the model's, [PARKER04] eqs. 4.1-4.14, [CRAMER93] or derived. Raises ValidityError for values outside.

    >>> round(float(sound(20.0, 933.0, 50.0).speed), 3)
    343.577
    """
    chosen = model_named(model)
    chosen.check(
        temperature_c=temperature_c, pressure_hpa=pressure_hpa, humidity_percent=humidity_percent, co2_ppm=co2_ppm
    )
    e = humidity.vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, chosen.vapour_formula)
    _check_vapour(chosen, e, pressure_hpa)
    weather = (temperature_c, pressure_hpa)
    saturation = humidity.saturation(*weather, chosen.vapour_formula)
    return Sound(
        speed=chosen.speed(*weather, e, co2_ppm),
        dry_speed=chosen.speed(*weather, np.zeros_like(e), co2_ppm),
        vapour_pressure_hpa=e,
        sensitivity=chosen.partials(*weather, e, co2_ppm).at_constant_humidity(saturation, humidity_percent),
        standard_uncertainty=chosen.uncertainty(*weather, e, co2_ppm),
        model=chosen.name,
    )


def partials_of_vapour(
    temperature_c, pressure_hpa, vapour_pressure_hpa, *, model=THERMOMETRY, co2_ppm=450.0
) -> SoundPartials:
    """Derivatives of the speed of sound at constant vapour pressure.

    For a dew-point or wet-bulb instrument.

    temperature_c         air temperature, °C, within the model's limits
    pressure_hpa          total pressure, hPa, within the model's limits
    vapour_pressure_hpa   partial pressure of water vapour, hPa, 0 to a fifth of the total
    model                 a name in MODELS
    co2_ppm               carbon dioxide, ppm, within the model's limits

    Source: the model's, differentiated; exact. Raises ValidityError for values outside.

    >>> round(float(partials_of_vapour(20.0, 933.0, 11.73, model="parker2004").temperature_c), 4)
    0.586
    """
    chosen = model_named(model)
    chosen.check(temperature_c=temperature_c, pressure_hpa=pressure_hpa, co2_ppm=co2_ppm)
    _check_vapour(chosen, vapour_pressure_hpa, pressure_hpa)
    return chosen.partials(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm)


def temperature_of_speed_c(
    speed, pressure_hpa, humidity_percent, *, model=THERMOMETRY, co2_ppm=450.0, frequency_hz=0.0
):
    """Temperature of air from the speed of sound at a relative humidity, °C.

    speed              of sound, m/s; of a path, its length over the travel time
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    model              a name in MODELS
    co2_ppm            carbon dioxide, ppm, within the model's limits
    frequency_hz       of the sound: the air's dispersion (`dispersion`) is subtracted from the speed

    Source: [PARKER04] eqs. 4.6 and 4.7, there with vapour pressure given; here Newton's method, exact to 1e-9 °C.
    Raises ValidityError for values outside, the resulting temperature included.

    >>> round(float(temperature_of_speed_c(343.576743, 933.0, 50.0, model="parker2004")), 4)
    20.0
    """
    return _refused_outside(
        model_named(model),
        temperatures_c(
            speed,
            pressure_hpa,
            humidity_percent,
            vapour_pressure_hpa=None,
            model=model,
            co2_ppm=co2_ppm,
            frequency_hz=frequency_hz,
        ),
        speed,
    )


def temperature_of_speed_of_vapour_c(
    speed, pressure_hpa, vapour_pressure_hpa, *, model=THERMOMETRY, co2_ppm=450.0, frequency_hz=0.0
):
    """Temperature of air from the speed of sound at a vapour pressure, °C.

    vapour_pressure_hpa   partial pressure of water vapour, hPa; the other arguments as of `temperature_of_speed_c`

    Source: [PARKER04] eqs. 4.6 and 4.7. Raises ValidityError for values outside, the resulting temperature included.

    >>> round(float(temperature_of_speed_of_vapour_c(343.576743, 933.0, 11.73229, model="parker2004")), 4)
    20.0
    """
    return _refused_outside(
        model_named(model),
        temperatures_c(
            speed,
            pressure_hpa,
            None,
            vapour_pressure_hpa=vapour_pressure_hpa,
            model=model,
            co2_ppm=co2_ppm,
            frequency_hz=frequency_hz,
        ),
        speed,
    )


def temperatures_c(speed, pressure_hpa, humidity_percent, *, vapour_pressure_hpa, model, co2_ppm, frequency_hz):
    """Temperatures from speeds, for batches whose rows fail one by one.

    Relative humidity or vapour pressure is given. nan where the air would be outside the model's limits, or the speed
    is not a number. Invalid weather raises.
    """
    chosen = model_named(model)
    chosen.check(pressure_hpa=pressure_hpa, co2_ppm=co2_ppm)
    FREQUENCY.check(frequency_hz)
    if humidity_percent is not None:
        chosen.check(humidity_percent=humidity_percent)
    else:
        _check_vapour(chosen, vapour_pressure_hpa, pressure_hpa)
    low, high = chosen.limits["temperature_c"].lower, chosen.limits["temperature_c"].upper
    moist = humidity_percent if humidity_percent is not None else vapour_pressure_hpa
    speed, p, moist, co2, f = np.broadcast_arrays(
        *(np.asarray(v, float) for v in (speed, pressure_hpa, moist, co2_ppm, frequency_hz))
    )
    t, step = np.full(speed.shape, min(max(20.0, low), high)), np.full(speed.shape, np.inf)
    for _ in range(STEPS):
        if humidity_percent is not None:
            saturation = humidity.saturation(t, p, chosen.vapour_formula)
            e = saturation.pressure_hpa * moist / 100.0
            slope = chosen.partials(t, p, e, co2).at_constant_humidity(saturation, moist).temperature_c
        else:
            e = moist
            slope = chosen.partials(t, p, e, co2).temperature_c
        target = speed / (1.0 + dispersion(t, p, e, frequency_hz=f).of_a_pulse()[0])
        step = (target - chosen.speed(t, p, e, co2)) / slope
        if not np.any(np.abs(step) > CLOSE_ENOUGH_C):
            break
        t = np.clip(t + step, low - 10.0, high + 10.0)  # only during iteration: a result outside is nan
    slack = 1e-9  # a speed computed at the limit returns within rounding
    inside = (np.abs(step) < 1e-6) & (t + step >= low - slack) & (t + step <= high + slack)
    return np.where(inside, t + step, np.nan)[()]


def _refused_outside(chosen, temperature, speed):
    SPEED.check(speed)
    bad = np.isnan(temperature)
    if np.any(bad):
        limit = chosen.limits["temperature_c"]
        at = int(np.flatnonzero(bad)[0])
        where = f" (element {at} of {temperature.size})" if np.ndim(temperature) else ""
        value = float(np.broadcast_to(np.asarray(speed, float), np.shape(temperature)).flat[at])
        raise ValidityError(
            f"speed of sound {value:g} m/s{where} is not possible in air within {limit.lower:g} to {limit.upper:g} C, "
            f"where {limit.source} holds",
            bad if np.ndim(temperature) else None,
        )
    return temperature


def _check_vapour(chosen, e, pressure_hpa) -> None:
    share = 100.0 * np.asarray(e, float) / np.asarray(pressure_hpa, float)
    upper = 6.0 if chosen.name == "cramer1993" else 20.0
    ValidInterval("vapour's share of the pressure", "%", 0.0, upper, chosen.limits["humidity_percent"].source).check(
        share
    )


def model_named(model: str) -> SoundModel:
    """Model by name; ValidityError for an unknown one."""
    if model not in MODELS:
        raise ValidityError(f"model of sound {model!r} is unknown; choose one of {', '.join(MODELS)}")
    return MODELS[model]
