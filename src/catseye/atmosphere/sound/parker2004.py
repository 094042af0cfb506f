"""Speed of sound as printed in chapter 4 of the notes.

For reproducing the notes, not for measuring temperature.

Its errors, derived by hand. An ideal gas has c² = gamma R T/M. In moist air with the mole fraction x = P_w/P
the molar mass is M_a [1 - x (1 - M_w/M_a)], M_w/M_a = 18.015/28.966 = 0.622 (the notes round to 5/8). Heat capacities
add: 1/(gamma - 1) = (1 - x)/(gamma_a - 1) + x/(gamma_w - 1), which falls with x as d ln gamma/dx =
(1 - gamma_a^-1)(gamma_a - 1) [1/(gamma_a - 1) - 1/(gamma_w - 1)]. With gamma_a = 1.402 and gamma_w = 1.330 (vapour has
three translations and three rotations, 4 R, and a little vibration) that is -0.063, so that d ln c²/dx =
0.378 - 0.063 = 0.315. Eq. 4.3 takes the mean of the gammas instead, gamma_w/gamma_a - 5/8 = 0.324 with gamma_w = 1.330:
as good as the full form. But it prints gamma_w = 1.004 "for water", which no gas has (a monatomic one has 5/3, the
limit of a very large molecule is 1); 1.004 is the specific heat of dry air in kJ/(kg K). So it has 0.0911 instead of
0.32. At 20 °C, 933 hPa, 50 % the notes' humid air is slow by (0.324 - 0.091)/2 x c = 0.50 m/s, 0.86 °C of temperature;
at 30 °C, 1000 hPa, 100 % by 1.8 m/s, 2.9 °C. Their dry air is fast by 0.05 m/s there (0.09 °C): gamma = 1.402 lies
between the 1.4001 of the ideal gas and the 1.4026 of air at 1000 hPa, M = 28.980 above the 28.966 of today's
composition.

The printed digits: the notes' program computes with unrounded constants and prints 343.577 (4.8), rounded; their
343.379 (4.2) is 343.379 83 truncated, or 343.379 30 with 20.0553.
"""

import numpy as np

from catseye.atmosphere.sound import real_gas
from catseye.atmosphere.sound.model import SoundModel, SoundPartials, limits
from catseye.constants import ZERO_CELSIUS_K

GAMMA_AIR = 1.402  # [PARKER04] 4.1: ratio of specific heats of dry air
GAMMA_WATER = 1.004  # [PARKER04] 4.3, as printed; about 1.33 is right, see above
GAMMA_VAPOUR = 1.330  # of water vapour at 20 °C: C_p = 4.034 R ([WAGNER02])
GAS_CONSTANT = 8.314  # J/(mol K), as the notes round it
DRY_AIR_KG_PER_MOL = 28.980e-3  # as the notes have it
MASS_RATIO = 5.0 / 8.0  # of water to air, as the notes round it
PER_ROOT_KELVIN = (GAMMA_AIR * GAS_CONSTANT / DRY_AIR_KG_PER_MOL) ** 0.5  # m/s/sqrt(K); 4.2 prints 20.0553
SHARE = GAMMA_WATER / GAMMA_AIR - MASS_RATIO  # 4.4 prints 0.091119


def speed(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=None, *, gamma_water=GAMMA_WATER):
    """Speed of sound in humid air by the notes, m/s.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa
    co2_ppm               ignored: the notes' air is fixed
    gamma_water           ratio of specific heats of water vapour; 1.004 is the notes', 1.330 the true value

    Source: [PARKER04] eqs. 4.1 and 4.3. Erratum: gamma_w, see the head of this file.

    >>> round(float(speed(20.0, 933.0, 11.73229)), 3)
    343.577
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    share = gamma_water / GAMMA_AIR - MASS_RATIO
    x = np.asarray(vapour_pressure_hpa, float) / np.asarray(pressure_hpa, float)
    return PER_ROOT_KELVIN * np.sqrt(kelvin / (1.0 - share * x))


def partials(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=None) -> SoundPartials:
    """Derivatives of the notes' speed of sound at constant vapour pressure.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa
    co2_ppm               ignored

    Source: [PARKER04] eq. 4.3 differentiated; the one by vapour pressure is 4.12.

    >>> round(float(partials(20.0, 933.0, 11.73229).vapour_pressure_hpa), 7)
    0.0167967
    """
    p, e = np.asarray(pressure_hpa, float), np.asarray(vapour_pressure_hpa, float)
    c = speed(temperature_c, p, e)
    per_x = 0.5 * c * SHARE / (1.0 - SHARE * e / p)
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    return SoundPartials(0.5 * c / kelvin, -per_x * e / p**2, per_x / p, np.zeros_like(c))


def temperature_c(speed, pressure_hpa, vapour_pressure_hpa):
    """Temperature of air from the notes' speed of sound, °C.

    The vapour pressure is given.

    speed                 of sound, m/s; of a path, its length over the travel time (4.7)
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa

    Source: [PARKER04] eqs. 4.6 and 4.7. Reads humid air too warm (0.8 °C at 20 °C, 933 hPa, 50 %), see above.

    >>> round(float(temperature_c(343.57674, 933.0, 11.73229)), 3)
    20.0
    """
    x = np.asarray(vapour_pressure_hpa, float) / np.asarray(pressure_hpa, float)
    return (1.0 - SHARE * x) * (np.asarray(speed, float) / PER_ROOT_KELVIN) ** 2 - ZERO_CELSIUS_K


def departure(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0):
    """Standard uncertainty of the notes' speed of sound, m/s.

    Its distance from `real_gas`, and the uncertainty of that.

    Arguments as of `speed`, and carbon dioxide, ppm, which the notes' air lacks.

    >>> [round(float(v), 3) for v in departure(20.0, 933.0, 11.73229)]
    [-0.426, 0.035]
    """
    weather = (temperature_c, pressure_hpa, vapour_pressure_hpa)
    standard = real_gas.MODEL
    return speed(*weather) - standard.speed(*weather, co2_ppm), standard.uncertainty(*weather, co2_ppm)


MODEL = SoundModel(
    name="parker2004",
    source="[PARKER04]",
    speed=speed,
    partials=partials,
    vapour_formula="buck",
    # m/s, the least: rms departure from `real_gas` over -20 to 45 °C, 600 to 1100 hPa, 0 to 100 %; 8 hot, moist, high
    standard_uncertainty=1.0,
    limits=limits("[PARKER04]", temperature_c=(-40.0, 50.0), pressure_hpa=(500.0, 1100.0)),
    has_co2=False,
    departure=departure,
)
