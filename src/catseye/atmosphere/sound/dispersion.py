"""Dispersion of sound: its speed at a frequency against zero frequency.

Vibrating molecules lag behind the sound.

Above its relaxation frequency a gas's vibration no longer contributes to the heat capacity. The notes and the models of
the speed are for zero frequency; a chirp of some kHz runs above nitrogen's relaxation (some 100 Hz in moist air) and
below oxygen's (tens of kHz; some 10 Hz in dry air). So its speed is high by 0.02 m/s (0.04 °C) in moist air at 20 °C,
and by up to 0.14 m/s (0.23 °C) in dry air: not negligible.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.constants import ZERO_CELSIUS_K

GAMMA = 1.400
STANDARD_HPA, STANDARD_K = 1013.25, 293.15  # [ISO93]: reference pressure and temperature
OXYGEN_SHARE, OXYGEN_K = 0.209, 2239.1  # [ISO93]: mole fraction, temperature of the vibration
NITROGEN_SHARE, NITROGEN_K = 0.781, 3352.0
U_DISPERSION = 0.1  # of the dispersion itself: [ISO93] gives absorption to 10 %

FREQUENCY = ValidInterval("frequency", "Hz", 0.0, 1e6, "[ISO93]")


class SoundDispersion(NamedTuple):
    """Relative change of the speed of sound at a frequency.

    phase      of the phase velocity: for a steady tone, or a correlation with the carrier
    group      of the group velocity: for the envelope of a narrow band
    standard   standard uncertainty of either: 10 % of the larger
    """

    phase: Any
    group: Any
    standard: Any

    def of_a_pulse(self):
        """Dispersion and standard uncertainty for correlation with a known pulse.

        It is that of the phase. A real signal has no phase of its own to give: the delay with the highest correlation
        is the mean of the phase delays with weight f² |S|², whatever the band, so the frequency to give is the signal's
        root mean square one.
        """
        return self.phase, self.standard


def relaxation_hz(temperature_c, pressure_hpa, vapour_pressure_hpa):
    """Relaxation frequencies of oxygen and nitrogen in moist air, Hz.

    temperature_c         air temperature, -20 to 50 °C
    pressure_hpa          total pressure, up to 2000 hPa
    vapour_pressure_hpa   partial pressure of water vapour, up to 0.05 of the total

    Source: [ISO93] eqs. 3 and 4. Good to 10 %.

    >>> [round(float(f)) for f in relaxation_hz(20.0, 1013.25, 11.7)]
    [35477, 332]
    """
    ratio = (np.asarray(temperature_c, float) + ZERO_CELSIUS_K) / STANDARD_K
    p = np.asarray(pressure_hpa, float)
    h = 100.0 * np.asarray(vapour_pressure_hpa, float) / p  # molar concentration in %
    oxygen = p / STANDARD_HPA * (24.0 + 4.04e4 * h * (0.02 + h) / (0.391 + h))
    nitrogen = p / STANDARD_HPA / np.sqrt(ratio) * (9.0 + 280.0 * h * np.exp(-4.170 * (ratio ** (-1.0 / 3.0) - 1.0)))
    return oxygen, nitrogen


def dispersion(temperature_c, pressure_hpa, vapour_pressure_hpa, *, frequency_hz) -> SoundDispersion:
    """Relative change of phase and group velocity of sound at a frequency.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa
    frequency_hz          of the sound, 0 to 1e6 Hz

    A vibration of heat capacity C_v = X (theta/T)² e^(-theta/T) R raises the speed by s r²/(1 + r²), r = f/f_r, with
    s = (gamma - 1)² C_v/(2 gamma R); the group velocity has f dc/df more, s 2r²/(1 + r²)². The strength is good to 2 %.

    Source: [PIERCE19] chapter 10; relaxation frequencies [ISO93]. Raises ValidityError for the frequency.

    >>> round(float(dispersion(20.0, 1013.25, 0.0, frequency_hz=10e3).phase) * 1e6)
    399
    """
    FREQUENCY.check(frequency_hz)
    kelvin, f = np.asarray(temperature_c, float) + ZERO_CELSIUS_K, np.asarray(frequency_hz, float)
    phase, group = 0.0, 0.0
    gases = ((OXYGEN_SHARE, OXYGEN_K), (NITROGEN_SHARE, NITROGEN_K))
    for (share, theta), relaxation in zip(
        gases, relaxation_hz(temperature_c, pressure_hpa, vapour_pressure_hpa), strict=True
    ):
        heat = share * (theta / kelvin) ** 2 * np.exp(-theta / kelvin)
        strength = (GAMMA - 1.0) ** 2 / (2.0 * GAMMA) * heat
        square = (f / relaxation) ** 2
        phase = phase + strength * square / (1.0 + square)
        group = group + strength * square * (3.0 + square) / (1.0 + square) ** 2
    return SoundDispersion(phase, group, U_DISPERSION * np.maximum(phase, group))
