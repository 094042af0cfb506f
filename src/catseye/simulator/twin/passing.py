"""Passing disturbances of a living site's air: waves, fronts, eddies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.fields import AirWave, PressureWave, Turbulence
from catseye.simulator.night.nature import PRESSURE_WAVES, WAVES, air_wave, pressure_wave
from catseye.simulator.twin.conditions import LivingConditions
from catseye.simulator.twin.fronts import LivingFronts

STILLEST = 0.5  # m/s: still air moves too


@dataclass(frozen=True, eq=False)
class TravellingWaves:
    """Waves (n,) travelling over the site.

    Amplitudes at z = 0, their growth a metre, rad/s, rad, (2, n) s/m.
    """

    amplitude: Array
    growth: Array
    omega: Array
    phase: Array
    slowness: Array

    @staticmethod
    def of(waves: Sequence[AirWave | PressureWave]) -> "TravellingWaves":
        """The same waves as arrays."""
        return TravellingWaves(
            np.array([w.amplitude_c if isinstance(w, AirWave) else w.amplitude_hpa for w in waves]),
            np.array([w.growth_per_m if isinstance(w, AirWave) else 0.0 for w in waves]),
            TWO_PI / np.array([w.period_s for w in waves]),
            np.array([w.phase_rad for w in waves]),
            np.array([w.slowness_s_per_m for w in waves]).T,
        )

    def __call__(self, points: Array, seconds: Array, lag: float = 0.0) -> Array:
        """Sum at points (..., 3) and times (...), with a first-order lag, s."""
        turn = self.omega * lag
        local = np.asarray(seconds, dtype=float)[..., None] - points[..., :2] @ self.slowness
        wave = np.sin(self.omega * local + (self.phase - np.arctan(turn)))
        size = self.amplitude / np.hypot(1.0, turn)
        total: Array = wave @ size
        return total + points[..., 2] * (wave @ (size * self.growth)) if self.growth.any() else total


@dataclass(frozen=True, eq=False)
class PassingAir:
    """Waves of temperature and pressure, fronts, eddies.

    `eddy_gain` is a factor on the eddies.
    """

    waves: TravellingWaves
    pressure_hpa: TravellingWaves
    fronts: LivingFronts
    eddies: Turbulence
    eddy_gain: float

    @staticmethod
    def of(conditions: LivingConditions, *, streams: Streams, planted: Planted) -> "PassingAir":
        """Draw all disturbances.

        Waves have any amplitude up to the largest; fronts and eddies go with the wind.
        """
        c, rng = conditions, streams("passing air")
        sizes, towards, seed = rng.uniform(size=WAVES + PRESSURE_WAVES), rng.uniform(0.0, TWO_PI), rng.integers(2**31)
        wave_c = planted.gain("air_waves") * c.wave_c * sizes[:WAVES]
        hpa = planted.gain("pressure_waves") * c.pressure_wave_hpa * sizes[WAVES:]
        wind = max(c.wind_m_s, STILLEST) * np.array([np.cos(towards), np.sin(towards)])
        return PassingAir(
            TravellingWaves.of([air_wave(streams(f"air wave/{k}"), k, float(a)) for k, a in enumerate(wave_c)]),
            TravellingWaves.of([pressure_wave(streams(f"pressure wave/{k}"), float(a)) for k, a in enumerate(hpa)]),
            LivingFronts.drawn(streams("fronts"), planted.gain("fronts") * c.front_c, wind),
            Turbulence(c.eddy_c, c.eddy_outer_m, (float(wind[0]), float(wind[1])), int(seed)),
            planted.gain("eddies"),
        )

    def common_c(self, points: Array, seconds: Array, lag: float = 0.0) -> Array:
        """Waves and fronts at points (..., 3), times (...), °C, with a lag, s."""
        return self.waves(points, seconds, lag) + self.fronts(points, seconds, lag)

    def eddies_c(self, points: Array, seconds: Array, lag: float = 0.0) -> Array:
        """Eddies at points (..., 3), times (...), °C, with a lag, s.

        For a fixed sensor that follows the air.
        """
        if self.eddy_gain == 0.0:
            return np.zeros(np.broadcast_shapes(points.shape[:-1], np.shape(seconds)))
        eddies: Array = self.eddy_gain * self.eddies.temperature_c(points, seconds, lag)
        return eddies

    def mean_eddies_c(self, start: Array, end: Array, seconds: Array) -> Array:
        """Means of the eddies along straight lines, points (k, 3), °C."""
        if self.eddy_gain == 0.0:
            return np.zeros(len(seconds))
        mean: Array = self.eddy_gain * self.eddies.mean_c(start, end, seconds)
        return mean
