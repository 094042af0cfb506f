"""Speed of sound in moist air, a mixture of real gases.

Each gas has its heat capacity and second virial coefficients.

Derived. To the first order in density p V = R T + B p, and at zero frequency and fixed composition
    c² = (gamma R T/M) (1 + K p/RT),   K = 2 B + 2 (gamma - 1) T B' + ((gamma - 1)²/gamma) T² B''
with gamma = C_p/(C_p - R) of the ideal gas and B of the mixture, x_a² B_aa + 2 x_a x_w B_aw + x_w² B_ww. Moles add
heat capacities and masses. Dry air is that of [PICARD08]; carbon dioxide takes the place of oxygen. Neglected:
third virial coefficients, 7 ppm of the speed at 1013 hPa and -40 °C, 4 ppm at 20 °C, in proportion to p² (against the
full equation of state of [LEMMON00]): the speed is low by that. Those with vapour are more: 50 ppm at 30 °C and 100 ppm
at 45 °C in saturated air at 1000 hPa (against [IAPWS10], with which all else agrees within 3 ppm at the same
composition), in proportion to p² and to the vapour's share: the speed is high by that.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.sound.model import SoundModel, SoundPartials, limits
from catseye.atmosphere.weather.humidity import PA_PER_HPA
from catseye.constants import PPM, ZERO_CELSIUS_K

GAS_CONSTANT = 8.314_462_618  # J/(mol K), exact in the SI to these digits
DRY_AIR_KG_PER_MOL, CO2_OVER_O2_KG_PER_MOL, CO2_OF_MASS = 28.965_46e-3, 12.011e-3, 400e-6  # [PICARD08]
WATER_KG_PER_MOL = 18.015_268e-3  # [WAGNER02]
# [LEMMON00] C_p/R of the ideal gas without carbon dioxide: powers of T, then weight and temperature (K) of vibrations
AIR_POWERS = (
    (3.490888032, 0.0),
    (2.395525583e-6, 1.0),
    (7.172111248e-9, 2.0),
    (-3.115413101e-13, 3.0),
    (0.223806688, -1.5),
)
AIR_VIBRATIONS = ((0.791309509, 3364.011), (0.212236768, 2242.45))
NOBLE_EXCESS = 1.565e-4  # noble gases of [PICARD08] beyond the 0.0092 of argon in [LEMMON00]; each subtracts one R
# carbon dioxide for oxygen: vibrations at 667 (twice), 1342 and 2349 cm^-1 (harmonic), and none at 1556 cm^-1
CO2_FOR_O2_VIBRATIONS = ((2.0, 960.0), (1.0, 1932.0), (1.0, 3380.0), (-1.0, 2242.45))
# [WAGNER02] table 6.1, C_p/R of the ideal gas: rotation and translation, then weight and temperature of vibrations
WATER_CONSTANT = 4.00632
WATER_VIBRATIONS = (
    (0.012436, 833.0),
    (0.97315, 2289.0),
    (1.27950, 5009.0),
    (0.96956, 5982.0),
    (0.24873, 17800.0),
)
# second virial coefficients as sums of c (T/T0)^d, in m³/mol: [LEMMON00], [HARVEY07], [HARVEY04]
B_AIR_KELVIN, B_AIR_PER_MOL_M3 = 132.6312, 10_447.7
B_AIR = tuple(
    (n / B_AIR_PER_MOL_M3, -j)
    for n, j in (
        (0.118160747229, 0.0),
        (0.713116392079, 0.33),
        (-1.61824192067, 1.01),
        (-0.101365037912, 1.6),
        (-0.146629609713, 3.6),
        (0.0148287891978, 3.5),
    )
)
B_AIR_WATER = ((66.5687e-6, -0.237), (-238.834e-6, -1.048), (-176.755e-6, -3.183))
B_WATER = ((0.34404e-3, -0.5), (-0.75826e-3, -0.8), (-24.219e-3, -3.35), (-3978.2e-3, -8.3))
THIRD_VIRIAL, SATURATED_SHARE = 100e-6, 0.0959  # of the speed; vapour's share in saturated air at 45 °C and 1000 hPa
OTHER_TERMS = 84e-6  # of the speed: heat capacities 60, second virial coefficients 50, composition 30 ppm
HUNDRED_KELVIN = 100.0


class HeatCapacity(NamedTuple):
    """Molar heat capacity of an ideal mixture over R, with derivatives.

    At constant pressure.

    cp             C_p/R
    per_k          by temperature, 1/K
    per_fraction   by the mole fraction of vapour
    per_co2        by the mole fraction of carbon dioxide
    """

    cp: Any
    per_k: Any
    per_fraction: Any
    per_co2: Any


def heat_capacity(temperature_c, vapour_fraction, co2_ppm=450.0) -> HeatCapacity:
    """Molar heat capacity of moist air over R, with derivatives.

    As an ideal gas.

    temperature_c     air temperature, -40 to 50 °C
    vapour_fraction   mole fraction of water vapour, 0 to 0.2
    co2_ppm           carbon dioxide, 0 to 2000 ppm

    Source: [LEMMON00] (air), [WAGNER02] table 6.1 (water). Good to 1e-4 of itself.

    >>> round(float(heat_capacity(26.85, 0.0, 0.0).cp), 4)
    3.5002
    """
    kelvin, x = np.asarray(temperature_c, float) + ZERO_CELSIUS_K, np.asarray(vapour_fraction, float)
    c = np.asarray(co2_ppm, float) * PPM
    air, air_slope = _vibrations(kelvin, AIR_VIBRATIONS)
    air = air + sum(a * kelvin**k for a, k in AIR_POWERS) - NOBLE_EXCESS
    air_slope = air_slope + sum(a * k * kelvin ** (k - 1.0) for a, k in AIR_POWERS)
    co2, co2_slope = _vibrations(kelvin, CO2_FOR_O2_VIBRATIONS)
    water, water_slope = _vibrations(kelvin, WATER_VIBRATIONS)
    water, dry, dry_slope = water + WATER_CONSTANT, air + c * co2, air_slope + c * co2_slope
    return HeatCapacity(
        (1.0 - x) * dry + x * water, (1.0 - x) * dry_slope + x * water_slope, water - dry, (1.0 - x) * co2
    )


def second_virial(temperature_c, vapour_fraction):
    """Second virial coefficient of moist air, (B, T B', T² B'', T³ B'''), and by fraction.

    The same four differentiated by the vapour fraction.

    temperature_c     air temperature, -40 to 50 °C
    vapour_fraction   mole fraction of water vapour, 0 to 0.2

    Two arrays (4, ...) in m³/mol.
    Source: [LEMMON00] (air), [HARVEY07] (air with water), [HARVEY04] (water). Good to 0.5e-6 m³/mol in dry air.

    >>> round(float(second_virial(20.0, 0.0)[0][0]) * 1e6, 2)
    -9.12
    """
    kelvin, x = np.broadcast_arrays(
        np.asarray(temperature_c, float) + ZERO_CELSIUS_K, np.asarray(vapour_fraction, float)
    )
    aa = _powers(kelvin / B_AIR_KELVIN, B_AIR)
    aw, ww = (_powers(kelvin / HUNDRED_KELVIN, terms) for terms in (B_AIR_WATER, B_WATER))
    y = 1.0 - x
    return y**2 * aa + 2.0 * x * y * aw + x**2 * ww, 2.0 * (-y * aa + (y - x) * aw + x * ww)


def speed(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0):
    """Speed of sound in moist air at zero frequency, m/s.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 0.2 of the total
    co2_ppm               carbon dioxide, 0 to 2000 ppm

    Source: derived at the head of this file. Good to 1e-4 of itself up to 35 °C; 2.9e-5 to 1.16e-4 below
    [CRAMER93] from 0 to 30 °C (a third of it: today's air has more argon).

    >>> round(float(speed(20.0, 1013.25, 0.0, 400.0)), 3)
    343.337
    """
    return np.sqrt(_square(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm)[0])


def partials(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0) -> SoundPartials:
    """Derivatives of the speed of sound at constant vapour pressure.

    Arguments as of `speed`.

    Source: derived at the head of this file, differentiated by hand; exact for the formula.

    >>> round(float(partials(20.0, 1013.25, 0.0, 400.0).temperature_c), 4)
    0.584
    """
    square, log_slopes = _square(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm)
    return SoundPartials(*(0.5 * np.sqrt(square) * slope for slope in log_slopes))


def _square(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm):
    """c² in m²/s², and derivatives of ln c² per °C, hPa, hPa vapour, ppm CO2."""
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    p = np.asarray(pressure_hpa, float)
    x = np.asarray(vapour_pressure_hpa, float) / p
    c = np.asarray(co2_ppm, float) * PPM
    heat = heat_capacity(temperature_c, x, co2_ppm)
    gamma = heat.cp / (heat.cp - 1.0)
    dry_mass = DRY_AIR_KG_PER_MOL + CO2_OVER_O2_KG_PER_MOL * (c - CO2_OF_MASS)
    mass = (1.0 - x) * dry_mass + x * WATER_KG_PER_MOL
    (b0, b1, b2, b3), per_x = second_virial(temperature_c, x)
    density = PA_PER_HPA * p / (GAS_CONSTANT * kelvin)  # mol/m³, of the ideal gas: K is given to its first order
    one, two = 2.0 * (gamma - 1.0), (gamma - 1.0) ** 2 / gamma
    k = 2.0 * b0 + one * b1 + two * b2
    real = 1.0 + k * density
    k_t = (2.0 * b1 + one * (b1 + b2) + two * (2.0 * b2 + b3)) / kelvin  # gamma held
    k_gamma = 2.0 * b1 + (1.0 - gamma**-2) * b2
    k_x = 2.0 * per_x[0] + one * per_x[1] + two * per_x[2]
    gamma_cp = -1.0 / (heat.cp - 1.0) ** 2
    by_gamma = gamma_cp * (1.0 / gamma + k_gamma * density / real)  # of ln c² by C_p/R
    by_t = 1.0 / kelvin + by_gamma * heat.per_k + density / real * (k_t - k / kelvin)
    by_x = by_gamma * heat.per_fraction + (dry_mass - WATER_KG_PER_MOL) / mass + k_x * density / real
    by_p = k * density / (real * p) - by_x * x / p
    by_c = by_gamma * heat.per_co2 - (1.0 - x) * CO2_OVER_O2_KG_PER_MOL / mass
    return gamma * GAS_CONSTANT * kelvin / mass * real, (by_t, by_p, by_x / p, by_c * PPM)


def _vibrations(kelvin, terms):
    """Heat capacity of harmonic vibrations over R, and its slope.

    E = ((u/2) / sinh(u/2))², T dE/dT = E (u coth(u/2) - 2), u the vibration's temperature over T.
    """
    total, slope = np.zeros_like(kelvin), np.zeros_like(kelvin)
    for weight, temperature in terms:
        u = temperature / kelvin
        one = weight * (0.5 * u / np.sinh(0.5 * u)) ** 2
        total, slope = total + one, slope + one * (u / np.tanh(0.5 * u) - 2.0) / kelvin
    return total, slope


def _powers(ratio, terms):
    """Sums (4, ...) of c r^d and T^k times its k-th derivative by temperature, k = 1, 2, 3."""
    rows = [(c * ratio**d, d) for c, d in terms]
    return np.stack(
        [
            sum(v for v, _ in rows),
            sum(v * d for v, d in rows),
            sum(v * d * (d - 1.0) for v, d in rows),
            sum(v * d * (d - 1.0) * (d - 2.0) for v, d in rows),
        ]
    )


def departure(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0):
    """Standard uncertainty, m/s: neglected third virial coefficients, and other terms.

    Arguments as of `speed`.

    Source: the head of this file: 100 ppm where vapour has 9.6 % of 1000 hPa (saturated at 45 °C), in proportion to p²
    and its share.

    >>> [round(float(v), 3) for v in departure(45.0, 1000.0, 95.9)]
    [0.036, 0.03]
    """
    p, share = np.asarray(pressure_hpa, float) / 1000.0, np.asarray(vapour_pressure_hpa, float) / pressure_hpa
    c = speed(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm)
    return c * THIRD_VIRIAL * p**2 * share / SATURATED_SHARE, c * OTHER_TERMS


MODEL = SoundModel(
    name="real_gas",
    source="[LEMMON00], [WAGNER02], [HARVEY07]",
    speed=speed,
    partials=partials,
    vapour_formula="iapws",
    # m/s, the minimum, 100 ppm: heat capacities 60, second virial coefficients 50, composition 30, third ones 40
    standard_uncertainty=0.035,
    limits=limits("this mixture", temperature_c=(-40.0, 50.0), pressure_hpa=(500.0, 1100.0)),
    has_co2=True,
    departure=departure,
)
