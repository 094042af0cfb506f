"""The index of air by a named model, checked against the model's limits.

A new model is one file with a MODEL, and one line here.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.atmosphere import ciddor_hill1999, humidity, rueger1990
from catseye.atmosphere.model import Limit, Model, Sensitivity
from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ValidityError

MODELS: dict[str, Model] = {
    "ciddor_hill1999": ciddor_hill1999.MODEL,
    "rueger1990": rueger1990.MODEL,
}

MODULATION = Limit("modulation frequency", "Hz", 1e6, 1e12, "the notion of a group")


@dataclass(frozen=True)
class Air:
    """Everything about one state of air, or an array of them, that a ranger needs.

    group_index            n_g
    phase_index            n
    group_refractivity     n_g - 1, with all its digits
    phase_refractivity     n - 1, with all its digits
    vapour_pressure_hpa    partial pressure of water vapour, hPa
    dew_point_c            over liquid water, °C; nan in perfectly dry air, which has none
    group_wavelength       of the modulation in this air, m
    sensitivity            derivatives of the group index with relative humidity held: per °C, per hPa, per %
    standard_uncertainty   of the group index, from the formula alone, perfect weather given
    model                  the model's name
    """

    group_index: Any
    phase_index: Any
    group_refractivity: Any
    phase_refractivity: Any
    vapour_pressure_hpa: Any
    dew_point_c: Any
    group_wavelength: Any
    sensitivity: Sensitivity
    standard_uncertainty: float
    model: str

    def combined_uncertainty(self, u_temperature_c: Any, u_pressure_hpa: Any, u_humidity_percent: Any) -> Any:
        """Standard uncertainty of the group index from the formula and from uncorrelated inputs (1 sigma each).

        Source: law of propagation of uncertainty, first order; [JCGM100] eq. 10.

        >>> round(float(air(20.0, 933.0, 50.0).combined_uncertainty(0.3, 0.0, 0.0)) * 1e6, 2)
        0.27
        """
        inputs = np.square(self.sensitivity[0] * np.asarray(u_temperature_c, dtype=float))
        inputs = inputs + np.square(self.sensitivity[1] * np.asarray(u_pressure_hpa, dtype=float))
        inputs = inputs + np.square(self.sensitivity[2] * np.asarray(u_humidity_percent, dtype=float))
        return np.sqrt(self.standard_uncertainty**2 + inputs)


def group_refractivity(
    temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, model="ciddor_hill1999", co2_ppm=450.0
):
    """Group index of air minus one, by a named model, refusing values outside its limits.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, um, within the model's limits
    model              a name in MODELS
    co2_ppm            carbon dioxide, 0 to 2000 ppm (rueger1990 ignores it)

    Source: the model's own, [CIDDOR99] or [RUEGER90]. Good to the model's standard uncertainty.

    >>> round(float(group_refractivity(20.0, 933.0, 50.0, model="rueger1990")) * 1e6, 6)
    253.246815
    """
    chosen = _checked(model, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm)
    return chosen.group_refractivity(
        temperature_c, pressure_hpa, humidity_percent, wavelength_um=wavelength_um, co2_ppm=co2_ppm
    )


def phase_refractivity(
    temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, model="ciddor_hill1999", co2_ppm=450.0
):
    """Phase index of air minus one, by a named model, refusing values outside its limits.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, um, within the model's limits
    model              a name in MODELS
    co2_ppm            carbon dioxide, 0 to 2000 ppm (rueger1990 ignores it)

    Source: the model's own, [CIDDOR96] or [OWENS67]. Good to the model's standard uncertainty.

    >>> round(float(phase_refractivity(20.0, 1000.0, 0.0, wavelength_um=0.633)) * 1e8, 1)
    26824.4
    """
    chosen = _checked(model, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm)
    return chosen.phase_refractivity(
        temperature_c, pressure_hpa, humidity_percent, wavelength_um=wavelength_um, co2_ppm=co2_ppm
    )


def air(
    temperature_c,
    pressure_hpa,
    humidity_percent,
    *,
    wavelength_um=0.780,
    model="ciddor_hill1999",
    co2_ppm=450.0,
    modulation_hz=1500e6,
) -> Air:
    """Both indices of air, its vapour, and how the group index moves with the weather.

    temperature_c      air temperature, °C, within the model's limits
    pressure_hpa       total pressure, hPa, within the model's limits
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength of the carrier, um, within the model's limits
    model              a name in MODELS
    co2_ppm            carbon dioxide, 0 to 2000 ppm (rueger1990 ignores it)
    modulation_hz      modulation frequency, 1e6 to 1e12 Hz

    Source: the model's; the group wavelength is [PARKER04] eq. 1.27. Good to `standard_uncertainty`.

    >>> round(float(air(20.0, 933.0, 50.0, model="rueger1990").group_wavelength), 9)
    0.199811037
    """
    chosen = _checked(model, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm)
    MODULATION.check(modulation_hz)
    weather = (temperature_c, pressure_hpa, humidity_percent)
    light = {"wavelength_um": wavelength_um, "co2_ppm": co2_ppm}
    group, phase = chosen.group_refractivity(*weather, **light), chosen.phase_refractivity(*weather, **light)
    vapour = humidity.vapour_pressure_hpa(*weather, chosen.vapour_formula)
    return Air(
        group_index=1.0 + group,
        phase_index=1.0 + phase,
        group_refractivity=group,
        phase_refractivity=phase,
        vapour_pressure_hpa=vapour,
        dew_point_c=humidity.dew_point_c(vapour, pressure_hpa, chosen.vapour_formula),
        group_wavelength=SPEED_OF_LIGHT / ((1.0 + group) * np.asarray(modulation_hz, float)),
        sensitivity=chosen.group_sensitivity(*weather, **light),
        standard_uncertainty=chosen.standard_uncertainty,
        model=chosen.name,
    )


def _checked(model, temperature_c, pressure_hpa, humidity_percent, wavelength_um, co2_ppm) -> Model:
    """The named model, when every argument lies within its limits and the vapour leaves room for air."""
    if model not in MODELS:
        raise ValidityError(f"air model {model!r} is unknown; choose one of {', '.join(MODELS)}")
    chosen = MODELS[model]
    chosen.check(
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        wavelength_um=wavelength_um,
        co2_ppm=co2_ppm,
    )
    fraction = humidity.vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, chosen.vapour_formula)
    fraction = 100.0 * fraction / np.asarray(pressure_hpa, float)
    Limit("vapour's share of the pressure", "%", 0.0, 100.0, chosen.limits["humidity_percent"].source).check(fraction)
    return chosen
