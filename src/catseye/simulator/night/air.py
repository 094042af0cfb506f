"""True air of a night: profiles in height and time, and group index."""

from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import PPM, ZERO_CELSIUS_K

WAVELENGTH_UM = 0.780
PRESSURE_LAPSE_HPA_PER_M = 0.11
ELEVATION_OF_Z0 = 806.42  # m above sea level
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)  # 12 nodes: below 1e-12 on a profile of 10 m scale height


@dataclass(frozen=True)
class AirConditions:
    """Air at z = 0 and at the start, and its changes.

    surface_layer_c   temperature gained on leaving the ground (positive at night), within `surface_layer_m`
    """

    temperature_c: float = 11.3
    gradient_c_per_m: float = 0.008
    surface_layer_c: float = 0.4
    surface_layer_m: float = 10.0
    drift_c_per_h: float = -0.9
    pressure_hpa: float = 930.6
    pressure_drift_hpa_per_h: float = 0.25
    humidity_percent: float = 70.5
    humidity_drift_percent_per_h: float = 2.4
    thermometer_offset_c: float = 0.3  # one sigma, each station
    index_fluctuation_ppm: float = 0.15  # one sigma, each path from a ranger to a target, all through the campaign


NIGHT = AirConditions()
SUMMER_DAY = replace(
    NIGHT, temperature_c=28.0, humidity_percent=60.0, gradient_c_per_m=-0.0098, surface_layer_c=-0.8, drift_c_per_h=0.8
)
WINTER = replace(NIGHT, temperature_c=-12.0, humidity_percent=80.0, surface_layer_c=0.8, gradient_c_per_m=0.015)


def saturation_hpa(temperature_c):
    """Saturation vapour pressure by Magnus' form, good to 0.5 %.

    Only ratios of it are used.
    """
    return 6.112 * np.exp(17.62 * temperature_c / (243.12 + temperature_c))


def group_refractivity_ppm(temperature_c, pressure_hpa, humidity_percent):
    """Group refractivity of air at 0.780 um, (n_g - 1) 1e6.

    temperature_c      -40 to 50
    pressure_hpa       500 to 1100
    humidity_percent   relative humidity over liquid water, 0 to 100

    Source: [PARKER04] eqs. 1.3, 1.5, 1.23 to 1.25, deliberately coded here a second time: the twin checks the
    reduction.

    >>> round(float(group_refractivity_ppm(20.0, 933.0, 50.0)), 4)
    253.2468
    """
    t = np.asarray(temperature_c, dtype=float)
    kelvin = t + ZERO_CELSIUS_K
    saturation = 6.1121 * (1.0007 + 3.46e-6 * pressure_hpa) * np.exp(17.502 * t / (240.97 + t))
    wet = saturation * humidity_percent / 100.0
    dry = pressure_hpa - wet
    density_dry = dry / kelvin * (1.0 + dry * (57.90e-8 + (-9.3250e-4 + 0.25844 / kelvin) / kelvin))
    virial = -2.37321e-3 + (2.23366 + (-710.792 + 7.75141e4 / kelvin) / kelvin) / kelvin
    density_wet = wet / kelvin * (1.0 + virial * wet * (1.0 + 3.7e-4 * wet))
    s = WAVELENGTH_UM**-2
    per_dry = 1646386.0 * (238.0185 + s) / (238.0185 - s) ** 2 + 47729.9 * (57.362 + s) / (57.362 - s) ** 2
    per_wet = 6487.31 + s * (174.174 + s * (-3.55750 + s * 0.61957))
    return (per_dry * density_dry + per_wet * density_wet) * 1e-2


@dataclass(frozen=True)
class TrueAir:
    """True air as a function of height (m) and time (s).

    In the ground frame, since the start.
    """

    conditions: AirConditions
    stratification: float = 1.0  # factor on every change with height

    @property
    def neighbours(self) -> float:
        """Share of a line's residual variance in common with neighbouring lines."""
        return 0.0

    def temperature_c(self, z, seconds):
        c = self.conditions
        height = np.asarray(z, dtype=float)
        layered = c.gradient_c_per_m * height + c.surface_layer_c * (1.0 - np.exp(-height / c.surface_layer_m))
        return c.temperature_c + self.stratification * layered + c.drift_c_per_h * seconds / 3600.0

    def pressure_hpa(self, z, seconds):
        c = self.conditions
        fall = self.stratification * PRESSURE_LAPSE_HPA_PER_M * np.asarray(z, dtype=float)
        return c.pressure_hpa + c.pressure_drift_hpa_per_h * seconds / 3600.0 - fall

    def humidity_percent(self, seconds):
        c = self.conditions
        drifted = c.humidity_percent + c.humidity_drift_percent_per_h * np.asarray(seconds, dtype=float) / 3600.0
        return np.clip(drifted, 0.0, 100.0)

    def index(self, z, seconds):
        """Group index at a height and a time."""
        p, h = self.pressure_hpa(z, seconds), self.humidity_percent(seconds)
        return 1.0 + PPM * group_refractivity_ppm(self.temperature_c(z, seconds), p, h)

    def weather_at(self, points, seconds):
        """Temperature, °C, pressure, hPa, humidity, %, at points (..., 3), times (...)."""
        z = points[..., 2]
        return self.temperature_c(z, seconds), self.pressure_hpa(z, seconds), self.humidity_percent(seconds)

    def index_at(self, points, seconds):
        """Group index at points (..., 3) and times (...)."""
        return self.index(points[..., 2], seconds)

    def common_c(self, seconds):
        """Temperature of the whole site at times (...) less that at the start."""
        return self.conditions.drift_c_per_h * np.asarray(seconds, dtype=float) / 3600.0

    def path_index(self, start, end, seconds):
        """Mean group index along straight lines between points (..., 3), by quadrature."""
        share = 0.5 * (NODES + 1.0)
        z = start[..., 2, None] + (end - start)[..., 2, None] * share
        return 0.5 * self.index(z, np.asarray(seconds)[..., None]) @ WEIGHTS
