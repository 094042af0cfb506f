"""The weather stations' records as states in time: temperature, pressure and humidity with their covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.estimation.series.trend import Trend, TrendStrength, trend_of, trend_strength

GRID = 60.0  # s between the states kept beside the readings
MOST_STATES = 2000  # of them at most
NAMES = ("temperature", "pressure", "humidity")
# Of records too short to tell: a reading's scatter, as the campaign layout says, and air of an ordinary night.
USUAL = (
    TrendStrength(0.05, 0.3 / 60.0, 1e-6),  # °C; 0.3 °C per root hour
    TrendStrength(0.05, 0.2 / 60.0, 1e-6),  # hPa
    TrendStrength(0.5, 2.0 / 60.0, 1e-5),  # %
)
LEAST_NOISE = (0.003, 0.003, 0.03)  # of a reading, as files round it: 0.01 °C, 0.01 hPa, 0.1 %


@dataclass(frozen=True, eq=False)
class StationRecord:
    """What one station read, as states in time.

    temperature_c, pressure_hpa, humidity_percent   levels with their covariance
    """

    temperature_c: Trend
    pressure_hpa: Trend
    humidity_percent: Trend

    @staticmethod
    def of(seconds: np.ndarray, readings: np.ndarray) -> "StationRecord":
        """The record of n readings; seconds (n,), readings (n, 3): °C, hPa, %."""
        step = max(GRID, float(np.ptp(seconds)) / MOST_STATES)
        grid = np.arange(seconds.min(), seconds.max(), step)
        trends = []
        for values, usual, least in zip(readings.T, USUAL, LEAST_NOISE, strict=True):
            if np.ptp(values) == 0.0:
                strength = TrendStrength(least, least / 60.0, usual.rate)
            elif usual is USUAL[-1]:  # a percent of humidity is 0.01 °C
                strength = usual
            else:
                strength = trend_strength(seconds, values, usual=usual, least_noise=least)
            trends.append(trend_of(seconds, values, strength, grid=grid))
        return StationRecord(*trends)

    @property
    def trends(self) -> tuple[Trend, Trend, Trend]:
        """All three, in the order of `NAMES`."""
        return self.temperature_c, self.pressure_hpa, self.humidity_percent


def states_at(records: Sequence[StationRecord], seconds: np.ndarray) -> np.ndarray:
    """Temperature °C, pressure hPa, humidity % of each station at times (m,): (m, stations, 3).

    Humidity stays within 0 to 100 %: a trend through readings near an end, or rounding in fog, leads beyond.
    """
    state = np.stack([np.stack([t.at(seconds) for t in r.trends], axis=-1) for r in records], axis=-2)
    state[..., 2] = np.clip(state[..., 2], 0.0, 100.0)
    return np.asarray(state)
