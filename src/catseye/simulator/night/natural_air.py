"""Smooth air with waves, fronts, turbulence and gradients added."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import PPM
from catseye.simulator.night.air import TrueAir, group_refractivity_ppm, saturation_hpa
from catseye.simulator.night.nature import CALM, Nature

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)  # below 1e-12 of the index for eddies of 5 m along 380 m
SHARES, WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * WEIGHTS
BLOCK = 256  # paths at once: fits a processor's cache
STEEL_AT = np.array([0.0, 0.0, 50.0])  # m: middle of the telescope


@dataclass(frozen=True)
class NaturalAir(TrueAir):
    """Air as a function of place and time.

    Functions of a height alone hold over the pintle bearing.
    """

    nature: Nature = CALM

    @property
    def neighbours(self) -> float:
        return self.nature.neighbours

    def weather_at(self, points, seconds):
        """Weather as of `TrueAir`, with the fields added.

        Warming keeps the vapour: the same vapour is a lower relative humidity.
        """
        smooth_c, pressure_hpa, humidity_percent = TrueAir(self.conditions, self.stratification).weather_at(
            points, seconds
        )
        temperature_c = smooth_c + self.nature.temperature_c(points, seconds)
        drier = saturation_hpa(smooth_c) / saturation_hpa(temperature_c)
        humid = np.clip(humidity_percent * drier, 0.0, 100.0)
        return temperature_c, pressure_hpa + self.nature.pressure_hpa(points, seconds), humid

    def temperature_c(self, z, seconds):
        return self.weather_at(_over(z), seconds)[0]

    def pressure_hpa(self, z, seconds):
        return self.weather_at(_over(z), seconds)[1]

    def humidity_percent(self, seconds):
        return self.weather_at(_over(0.0), seconds)[2]

    def index_at(self, points, seconds):
        return 1.0 + PPM * group_refractivity_ppm(*self.weather_at(points, seconds))

    def index(self, z, seconds):
        return self.index_at(_over(z), seconds)

    def common_c(self, seconds):
        return super().common_c(seconds) + self.nature.common_c(STEEL_AT, seconds)

    def path_index(self, start, end, seconds):
        """Mean group index as of `TrueAir`, for points (k, 3) or (3,)."""
        start, end = (np.broadcast_to(p, (len(seconds), 3)) for p in (start, end))
        found = [
            self._block(start[i : i + BLOCK], end[i : i + BLOCK], seconds[i : i + BLOCK])
            for i in range(0, len(seconds), BLOCK)
        ]
        return np.concatenate([np.empty(0), *found])

    def _block(self, start, end, seconds):
        points = start[:, None] + (end - start)[:, None] * SHARES[:, None]
        return self.index_at(points, seconds[:, None]) @ WEIGHTS


def _over(z):
    """Points (..., 3) over the pintle bearing at heights (...)."""
    return np.multiply.outer(np.asarray(z, dtype=float), np.array([0.0, 0.0, 1.0]))
