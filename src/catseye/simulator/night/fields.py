"""Fields of the air over a site: waves, fronts, turbulence, gradients.

Functions of place and time. Points are (..., 3) m in the ground frame, times (...) s since the start; both broadcast.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from catseye.constants import TWO_PI
from catseye.simulator.night.limits import require

MODES = 40  # one for each band of the spectrum, about a sixth of an octave wide
SMALLEST_EDDY_M = (
    5.0  # smaller ones, a tenth to a third of the variance, change a path of 100 m by 1 um at 0.1 degC rms
)
LARGEST_EDDY = 10.0  # outer scales: 1 in 3000 of the variance lies in larger ones


@dataclass(frozen=True)
class AirWave:
    """Wave of air temperature, as gravity waves in a stable night.

    amplitude_c        at z = 0
    period_s           above the buoyancy period, 4 min at a gradient of 0.008 degC/m
    phase_rad          at the origin at the start
    slowness_s_per_m   delay of the wave towards the east and the north; zero: simultaneous over the site
    growth_per_m       of the amplitude with height, as a share of that at z = 0

    Source: R. B. Stull, An Introduction to Boundary Layer Meteorology (1988), ch. 12.
    """

    amplitude_c: float
    period_s: float
    phase_rad: float = 0.0
    slowness_s_per_m: tuple[float, float] = (0.0, 0.0)
    growth_per_m: float = 0.0

    def __post_init__(self):
        require("amplitude_c of a wave", self.amplitude_c, -10.0, 10.0)
        require("period_s of a wave", self.period_s, 1.0, 1e6)
        require("growth_per_m of a wave", self.growth_per_m, -0.1, 0.1)

    def temperature_c(self, points, seconds):
        amplitude = self.amplitude_c * (1.0 + self.growth_per_m * points[..., 2])
        return amplitude * np.sin(
            TWO_PI / self.period_s * _local(points, seconds, self.slowness_s_per_m) + self.phase_rad
        )


@dataclass(frozen=True)
class PressureWave:
    """Wave of air pressure, the same from the ground to the dish.

    slowness_s_per_m   as of an `AirWave`
    """

    amplitude_hpa: float
    period_s: float
    phase_rad: float = 0.0
    slowness_s_per_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self):
        require("amplitude_hpa of a wave", self.amplitude_hpa, -10.0, 10.0)
        require("period_s of a wave", self.period_s, 1.0, 1e6)

    def pressure_hpa(self, points, seconds):
        local = _local(points, seconds, self.slowness_s_per_m)
        return self.amplitude_hpa * np.sin(TWO_PI / self.period_s * local + self.phase_rad)


@dataclass(frozen=True)
class Front:
    """Step of air temperature that passes the site: half a cosine.

    at_s               when half of it has passed the origin
    rise_s             from its first to its last
    slowness_s_per_m   as of an `AirWave`
    """

    step_c: float
    at_s: float
    rise_s: float = 300.0
    slowness_s_per_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self):
        require("step_c of a front", self.step_c, -20.0, 20.0)
        require("at_s of a front", self.at_s, -1e6, 1e6)
        require("rise_s of a front", self.rise_s, 1.0, 1e5)

    def temperature_c(self, points, seconds):
        passed = np.clip((_local(points, seconds, self.slowness_s_per_m) - self.at_s) / self.rise_s + 0.5, 0.0, 1.0)
        return self.step_c * 0.5 * (1.0 - np.cos(np.pi * passed))


@dataclass(frozen=True)
class HorizontalGradient:
    """Horizontal temperature gradient with a constant and a turning part.

    The turning is anticlockwise for a positive period.

    constant_c_per_m   towards the east and the north
    turning_c_per_m    length of the part that turns
    phase_rad          of the turning part at the start, from the east
    """

    constant_c_per_m: tuple[float, float] = (0.0, 0.0)
    turning_c_per_m: float = 0.0
    period_s: float = 5400.0
    phase_rad: float = 0.0

    def __post_init__(self):
        for part in (*self.constant_c_per_m, self.turning_c_per_m):
            require("a horizontal gradient in degC/m", part, -0.1, 0.1)
        require("period_s of a turning gradient", abs(self.period_s), 60.0, 1e6)

    def c_per_m(self, seconds):
        """Gradient (..., 2) towards the east and the north at times (...)."""
        angle = TWO_PI * np.asarray(seconds, dtype=float) / self.period_s + self.phase_rad
        turning = self.turning_c_per_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return np.asarray(self.constant_c_per_m) + turning

    def temperature_c(self, points, seconds):
        return np.sum(points[..., :2] * self.c_per_m(seconds), axis=-1)


@dataclass(frozen=True)
class Turbulence:
    """Frozen temperature eddies carried across the site by the wind.

    rms_c           over place and time
    outer_scale_m   of the von Karman spectrum; eddies from 10 of it down to 5 m are included
    wind_m_s        towards the east and the north
    seed            of the eddies

    Source: G. I. Taylor (1938) for frozen; V. I. Tatarskii, The Effects of the Turbulent Atmosphere on Wave
    Propagation (1971), sec. 1: the three-dimensional spectrum (k^2 + k0^2)^(-11/6), k^-5/3 in one dimension.
    """

    rms_c: float
    outer_scale_m: float = 80.0
    wind_m_s: tuple[float, float] = (2.0, 0.0)
    seed: int = 0

    def __post_init__(self):
        require("rms_c of turbulence", self.rms_c, 0.0, 5.0)
        require("outer_scale_m of turbulence", self.outer_scale_m, 2.0 * SMALLEST_EDDY_M, 1e4)
        require("wind_m_s of turbulence", float(np.hypot(*self.wind_m_s)), 0.0, 60.0)

    def temperature_c(self, points, seconds, lag_s: float = 0.0):
        """Eddy temperature at points (..., 3) and times (...), with a lag.

        For a fixed sensor that follows the air with a lag.
        """
        wave, amplitude, phase = _modes(self.seed, self.outer_scale_m)
        angle = self._angle(points, seconds, wave, phase)
        if lag_s:
            turn = lag_s * (wave[:, :2] @ np.asarray(self.wind_m_s))
            angle, amplitude = angle + np.arctan(turn), amplitude / np.hypot(1.0, turn)
        return self.rms_c * np.cos(angle) @ amplitude

    def mean_c(self, start, end, seconds):
        """Mean along straight lines, in closed form: each mode by a sinc."""
        wave, amplitude, phase = _modes(self.seed, self.outer_scale_m)
        half = 0.5 * (end - start)
        turn = half @ wave.T
        safe = np.where(np.abs(turn) < 1e-9, 1e-9, turn)
        averaged = np.sin(safe) / safe * np.cos(self._angle(start + half, seconds, wave, phase))
        return self.rms_c * averaged @ amplitude

    def _angle(self, points, seconds, wave, phase):
        """Phases (..., modes), rad."""
        advection = wave[:, :2] @ np.asarray(self.wind_m_s)
        return points @ wave.T - np.asarray(seconds, dtype=float)[..., None] * advection + phase


@lru_cache(maxsize=16)
def _modes(seed: int, outer_scale_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wave vectors (modes, 3), rad/m, amplitudes for rms 1, and phases.

    One mode for a band of the spectrum.
    """
    rng = np.random.default_rng(seed)
    outer = TWO_PI / outer_scale_m
    edges = np.geomspace(outer / LARGEST_EDDY, TWO_PI / SMALLEST_EDDY_M, MODES + 1)
    length = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.uniform(size=MODES)
    direction = rng.normal(size=(MODES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    middle = np.sqrt(edges[:-1] * edges[1:])
    variance = middle**2 * (middle**2 + outer**2) ** (-11.0 / 6.0) * np.diff(edges)
    return length[:, None] * direction, np.sqrt(2.0 * variance / variance.sum()), rng.uniform(0.0, TWO_PI, MODES)


def _local(points, seconds, slowness_s_per_m):
    """Time since the feature passing the origin at zero has passed the points, s."""
    return np.asarray(seconds, dtype=float) - points[..., :2] @ np.asarray(slowness_s_per_m)
