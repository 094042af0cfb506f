"""Cramer's speed of sound, the acoustics standards' polynomial for 0 to 30 °C."""

import numpy as np

from catseye.atmosphere.sound.model import SoundModel, SoundPartials, limits
from catseye.atmosphere.weather.humidity import PA_PER_HPA
from catseye.constants import PPM

# [CRAMER93] table III, a0 to a15 of his eq. 15: t in °C, p in Pa, mole fractions of water vapour and carbon dioxide
A = (
    (331.5024, 0.603055, -0.000528),  # 1, t, t²
    (51.471935, 0.1495874, -0.000782),  # the same times x_w
    (-1.82e-7, 3.73e-8, -2.93e-10),  # times p
    (-85.20931, -0.228525, 5.91e-5),  # times x_c
)
A_WW, A_PP, A_CC, A_WPC = -2.835149, -2.15e-13, 29.179762, 0.000486


def speed(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0):
    """Speed of sound in humid air at zero frequency, m/s.

    temperature_c         air temperature, 0 to 30 °C
    pressure_hpa          total pressure, 750 to 1020 hPa
    vapour_pressure_hpa   partial pressure of water vapour, up to 0.06 of the total
    co2_ppm               carbon dioxide, 0 to 10 000 ppm

    Source: [CRAMER93] eq. 15. Good to 300 ppm (author): 0.1 m/s.

    >>> round(float(speed(0.0, 1013.25, 0.0, 314.0)), 2)
    331.45
    """
    t, p = np.asarray(temperature_c, float), np.asarray(pressure_hpa, float) * PA_PER_HPA
    w, c = np.asarray(vapour_pressure_hpa, float) * PA_PER_HPA / p, np.asarray(co2_ppm, float) * PPM
    one, by_w, by_p, by_c = ((a[2] * t + a[1]) * t + a[0] for a in A)
    return one + by_w * w + by_p * p + by_c * c + A_WW * w**2 + A_PP * p**2 + A_CC * c**2 + A_WPC * w * p * c


def partials(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0) -> SoundPartials:
    """Derivatives of Cramer's speed of sound at constant vapour pressure.

    Arguments as of `speed`.

    Source: [CRAMER93] eq. 15 differentiated.

    >>> round(float(partials(20.0, 1013.25, 0.0, 400.0).temperature_c), 4)
    0.5844
    """
    t, p = np.asarray(temperature_c, float), np.asarray(pressure_hpa, float) * PA_PER_HPA
    w, c = np.asarray(vapour_pressure_hpa, float) * PA_PER_HPA / p, np.asarray(co2_ppm, float) * PPM
    _, by_w, by_p, by_c = ((a[2] * t + a[1]) * t + a[0] for a in A)
    slope, slope_w, slope_p, slope_c = (2.0 * a[2] * t + a[1] for a in A)
    per_w = by_w + 2.0 * A_WW * w + A_WPC * p * c
    per_p = by_p + 2.0 * A_PP * p + A_WPC * w * c - per_w * w / p  # x_w falls as the total pressure grows
    per_c = by_c + 2.0 * A_CC * c + A_WPC * w * p
    return SoundPartials(
        slope + slope_w * w + slope_p * p + slope_c * c, per_p * PA_PER_HPA, per_w / p * PA_PER_HPA, per_c * PPM
    )


MODEL = SoundModel(
    name="cramer1993",
    source="[CRAMER93]",
    speed=speed,
    partials=partials,
    # his appendix has the older constants of the same formula (1981); acoustics' standards use those of `ciddor`
    vapour_formula="ciddor",
    standard_uncertainty=0.06,  # m/s: "less than 300 ppm", 0.1 m/s, taken as the bound of a rectangle
    limits=limits("[CRAMER93]", temperature_c=(0.0, 30.0), pressure_hpa=(750.0, 1020.0), co2_ppm=(0.0, 10_000.0)),
    has_co2=True,
)
