"""Index of air by a named model, checked against the model's limits.

A new model is one file with a MODEL, and its name in `catseye.names`. Carbon dioxide enters where the model has it; the
others' air has a fixed share, given in `AirState.co2_ppm`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from catseye.atmosphere.index.model import IndexModel, IndexSensitivity, Kind, Partials
from catseye.atmosphere.limit import ValidInterval, check_spreads
from catseye.atmosphere.weather import humidity
from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ValidityError
from catseye.names import AIR_MODEL, AIR_MODELS, AirModelName


def _registered(name: AirModelName) -> IndexModel:
    model: IndexModel = import_module(f"catseye.atmosphere.index.{name}").MODEL
    assert model.name == name, f"atmosphere/index/{name}.py defines {model.name!r}"
    return model


MODELS: dict[str, IndexModel] = {name: _registered(name) for name in AIR_MODELS}
LARGE = 200_000  # states from which loading the compiled form (0.7 s, once) pays

MODULATION = ValidInterval("modulation frequency", "Hz", 1e6, 1e12, "the definition of a group index")


@dataclass(frozen=True)
class AirState:
    """State of air, or an array of them, as a ranger needs it.

    temperature_c          air temperature, °C
    pressure_hpa           total pressure, hPa
    group_index            n_g
    phase_index            n
    group_refractivity     n_g - 1, at full precision
    phase_refractivity     n - 1, at full precision
    vapour_pressure_hpa    partial pressure of water vapour, hPa
    humidity_percent       relative humidity over liquid water, %
    dew_point_c            over liquid water, °C; nan in perfectly dry air
    group_wavelength       of the modulation in this air, m
    sensitivity            derivatives of the group index
    phase_sensitivity      derivatives of the phase index
    standard_uncertainty   of the group index, of the formula alone, weather taken as exact
    co2_ppm                carbon dioxide of this state, ppm
    model                  the model's name
    """

    temperature_c: Any
    pressure_hpa: Any
    group_index: Any
    phase_index: Any
    group_refractivity: Any
    phase_refractivity: Any
    vapour_pressure_hpa: Any
    humidity_percent: Any
    dew_point_c: Any
    group_wavelength: Any
    sensitivity: IndexSensitivity
    phase_sensitivity: IndexSensitivity
    standard_uncertainty: Any
    co2_ppm: Any
    model: str

    def combined_uncertainty(
        self,
        u_temperature_c: Any = 0.0,
        u_pressure_hpa: Any = 0.0,
        u_humidity_percent: Any = 0.0,
        *,
        u_co2_ppm: Any = 0.0,
        u_wavelength_um: Any = 0.0,
    ) -> Any:
        """Standard uncertainty of the group index from formula and uncorrelated inputs.

        Inputs are 1 sigma each.

        Raises ValidityError for an uncertainty below zero or not a number.
        Source: law of propagation of uncertainty, first order; [JCGM100] eq. 10.

        >>> round(float(air(20.0, 933.0, 50.0).combined_uncertainty(0.3)) * 1e6, 2)
        0.27
        """
        check_spreads(
            u_temperature_c=u_temperature_c,
            u_pressure_hpa=u_pressure_hpa,
            u_humidity_percent=u_humidity_percent,
            u_co2_ppm=u_co2_ppm,
            u_wavelength_um=u_wavelength_um,
        )
        slope = self.sensitivity
        shares = (
            (slope.temperature_c, u_temperature_c),
            (slope.pressure_hpa, u_pressure_hpa),
            (slope.humidity_percent, u_humidity_percent),
            (slope.co2_ppm, u_co2_ppm),
            (slope.wavelength_um, u_wavelength_um),
        )
        inputs = sum(np.square(per_unit * np.asarray(u, dtype=float)) for per_unit, u in shares)
        return np.sqrt(self.standard_uncertainty**2 + inputs)


def group_refractivity(
    temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, model=AIR_MODEL, co2_ppm=450.0
):
    """Group index of air minus one, by a named model within its limits.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, um, within the model's limits
    model              a name in MODELS
    co2_ppm            carbon dioxide, 0 to 2000 ppm, where the model has it

    Source: the model's own, [CIDDOR99], [RUEGER90], [IAG99] or [BARRELL39]. Good to the model's standard uncertainty.
    Large arrays go through a compiled form that agrees to 1e-15.

    Raises ValidityError with the mask of the offending places.

    >>> round(float(group_refractivity(20.0, 933.0, 50.0, model="rueger1990")) * 1e6, 6)
    253.246815
    """
    weather = (temperature_c, pressure_hpa, humidity_percent)
    return _refractivity(weather, wavelength_um, model, co2_ppm, "group")


def phase_refractivity(
    temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, model=AIR_MODEL, co2_ppm=450.0
):
    """Phase index of air minus one, by a named model within its limits.

    Arguments as of `group_refractivity`.

    Source: the model's own, [CIDDOR96], [OWENS67], [IAG99] or [BARRELL39]. Good to the model's standard uncertainty.

    Raises ValidityError with the mask of the offending places.

    >>> round(float(phase_refractivity(20.0, 1000.0, 0.0, wavelength_um=0.633)) * 1e8, 1)
    26824.4
    """
    weather = (temperature_c, pressure_hpa, humidity_percent)
    return _refractivity(weather, wavelength_um, model, co2_ppm, "phase")


def group_partials(
    temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um=0.780, model=AIR_MODEL, co2_ppm=450.0
) -> Partials:
    """Derivatives of the group index at constant vapour pressure.

    Arguments as of `air_of_vapour`.

    Source: the model's formula differentiated; exact for it. [PARKER04] eq. 1.53 prints the third.

    Raises ValidityError with the mask of the offending places.

    >>> round(float(group_partials(20.0, 933.0, 11.7323, model="rueger1990").vapour_pressure_hpa) * 1e8, 3)
    -4.094
    """
    chosen = _model_named(model)
    weather = (temperature_c, pressure_hpa, vapour_pressure_hpa)
    _check_vapour(chosen, *weather, wavelength_um, co2_ppm)
    return chosen.partials(*weather, wavelength_um=wavelength_um, co2_ppm=co2_ppm)


def air(
    temperature_c,
    pressure_hpa,
    humidity_percent,
    *,
    wavelength_um=0.780,
    model=AIR_MODEL,
    co2_ppm=450.0,
    modulation_hz=1500e6,
) -> AirState:
    """Both indices of air, its vapour, and their derivatives by weather.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength of the carrier, um, within the model's limits
    model              a name in MODELS
    co2_ppm            carbon dioxide, 0 to 2000 ppm, where the model has it
    modulation_hz      modulation frequency, 1e6 to 1e12 Hz

    Source: the model's; the group wavelength is [PARKER04] eq. 1.27. Good to `standard_uncertainty`.

    Raises ValidityError with the mask of the offending places.

    >>> round(float(air(20.0, 933.0, 50.0, model="rueger1990").group_wavelength), 9)
    0.199811037
    """
    chosen = _model_named(model)
    _check(chosen, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm)
    vapour = humidity.vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, chosen.vapour_formula)
    weather = (temperature_c, pressure_hpa, vapour, humidity_percent)
    return _air(chosen, *weather, wavelength_um=wavelength_um, co2_ppm=co2_ppm, modulation_hz=modulation_hz)


def air_of_vapour(
    temperature_c,
    pressure_hpa,
    vapour_pressure_hpa,
    *,
    wavelength_um=0.780,
    model=AIR_MODEL,
    co2_ppm=450.0,
    modulation_hz=1500e6,
) -> AirState:
    """State of air from the vapour pressure, for dew point or wet bulb.

    vapour_pressure_hpa   partial pressure of water vapour, hPa, 0 to saturation
    others                as of `air`

    Raises ValidityError with the mask of the offending places.

    >>> round(float(air_of_vapour(20.0, 933.0, 11.7323, model="rueger1990").humidity_percent), 3)
    50.0
    """
    chosen = _model_named(model)
    _check_vapour(chosen, temperature_c, pressure_hpa, vapour_pressure_hpa, wavelength_um, co2_ppm)
    saturated = humidity.saturation(temperature_c, pressure_hpa, chosen.vapour_formula).pressure_hpa
    relative = 100.0 * np.asarray(vapour_pressure_hpa, float) / saturated
    weather = (temperature_c, pressure_hpa, vapour_pressure_hpa, relative)
    return _air(chosen, *weather, wavelength_um=wavelength_um, co2_ppm=co2_ppm, modulation_hz=modulation_hz)


def _air(
    chosen: IndexModel, temperature_c, pressure_hpa, vapour, relative, *, wavelength_um, co2_ppm, modulation_hz
) -> AirState:
    MODULATION.check(modulation_hz)
    state = (temperature_c, pressure_hpa, vapour)
    saturation = humidity.saturation(temperature_c, pressure_hpa, chosen.vapour_formula)
    light = {"wavelength_um": wavelength_um, "co2_ppm": co2_ppm}
    group = chosen.refractivity(*state, **light)
    phase = chosen.refractivity(*state, **light, kind="phase")
    return AirState(
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        group_index=1.0 + group,
        phase_index=1.0 + phase,
        group_refractivity=group,
        phase_refractivity=phase,
        vapour_pressure_hpa=vapour,
        humidity_percent=relative,
        dew_point_c=humidity.dew_point_c(vapour, pressure_hpa, chosen.vapour_formula),
        group_wavelength=SPEED_OF_LIGHT / ((1.0 + group) * np.asarray(modulation_hz, float)),
        sensitivity=chosen.partials(*state, **light).at_constant_humidity(saturation, relative),
        phase_sensitivity=chosen.partials(*state, **light, kind="phase").at_constant_humidity(saturation, relative),
        standard_uncertainty=chosen.uncertainty(*state, **light),
        co2_ppm=co2_ppm if chosen.co2_slope else chosen.co2_ppm,
        model=chosen.name,
    )


def _refractivity(weather, wavelength_um, model, co2_ppm, kind: Kind):
    """Refractivity by the compiled form where faster and valid.

    Otherwise by the plain form, which reports what is invalid.
    """
    chosen = _model_named(model)
    if chosen.is_compiled and np.ndim(wavelength_um) == 0 and np.ndim(co2_ppm) == 0:
        arrays = [np.asarray(value, float) for value in weather]
        shape = np.broadcast_shapes(*(array.shape for array in arrays))
        if np.prod(shape, dtype=int) >= LARGE:
            chosen.check(wavelength_um=wavelength_um, co2_ppm=co2_ppm)
            # one value for all states stays one: the kernel expands it
            flat = [a.ravel() if a.size == 1 else np.broadcast_to(a, shape).ravel() for a in arrays]
            values, inside = _kernel(model)(*flat, *chosen.coefficients(wavelength_um, co2_ppm, kind))
            if inside:
                return values.reshape(shape)
    temperature_c, pressure_hpa, humidity_percent = weather
    _check(chosen, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm)
    vapour = humidity.vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, chosen.vapour_formula)
    state = (temperature_c, pressure_hpa, vapour)
    return chosen.refractivity(*state, wavelength_um=wavelength_um, co2_ppm=co2_ppm, kind=kind)


def _kernel(model: str) -> Callable[..., Any]:
    """Compiled form of a model, imported when a large problem first needs it."""
    refractivity: Callable[..., Any] = import_module(f"catseye.atmosphere.index.{model}_kernel").refractivity
    return refractivity


def _model_named(model: str) -> IndexModel:
    if model not in MODELS:
        raise ValidityError(f"air model {model!r} is unknown; choose one of {', '.join(MODELS)}")
    return MODELS[model]


def _check(chosen: IndexModel, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm) -> None:
    """Check all arguments against the model's limits, and vapour against pressure."""
    chosen.check(
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        wavelength_um=wavelength_um,
        co2_ppm=co2_ppm,
    )
    e = humidity.vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, chosen.vapour_formula)
    _check_share(chosen, e, pressure_hpa)


def _check_vapour(chosen: IndexModel, temperature_c, pressure_hpa, vapour_pressure_hpa, wavelength_um, co2_ppm) -> None:
    """Check a given vapour pressure; it may reach saturation, to rounding."""
    chosen.check(temperature_c=temperature_c, pressure_hpa=pressure_hpa, wavelength_um=wavelength_um, co2_ppm=co2_ppm)
    e = np.asarray(vapour_pressure_hpa, float)
    ValidInterval("vapour pressure", "hPa", 0.0, np.inf, "the definition of a pressure").check(e)
    saturated = humidity.saturation(temperature_c, pressure_hpa, chosen.vapour_formula).pressure_hpa
    SATURATED.check(100.0 * e / saturated)
    _check_share(chosen, e, pressure_hpa)


def _check_share(chosen: IndexModel, vapour_pressure_hpa, pressure_hpa) -> None:
    share = 100.0 * vapour_pressure_hpa / np.asarray(pressure_hpa, float)
    ValidInterval("vapour's share of the pressure", "%", 0.0, 100.0, chosen.limits["humidity_percent"].source).check(
        share
    )


# 0.2 % of grace: the saturation formulas differ by 0.1 % and each instrument comes with its own
SATURATED = ValidInterval("vapour pressure over saturation", "%", 0.0, 100.2, "air without droplets", places=1)
