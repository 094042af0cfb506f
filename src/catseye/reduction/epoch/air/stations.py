"""Weather stations' records as states in time.

Temperature, pressure and humidity with their covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.estimation.series.trend import Trend, TrendStrength, trend_of, trend_strength
from catseye.records.site.site import Location

GRID = 60.0  # s between additional states beside the readings
MOST_STATES = 2000  # of them at most
NAMES = ("temperature", "pressure", "humidity")
# For records too short for an estimate: scatter by the campaign layout, and air of an ordinary night.
USUAL = (
    TrendStrength(0.05, 0.3 / 60.0, 1e-6),  # °C; 0.3 °C per root hour
    TrendStrength(0.05, 0.2 / 60.0, 1e-6),  # hPa
    TrendStrength(0.5, 2.0 / 60.0, 1e-5),  # %
)
DAY = (3.0, 21.0)  # hours of local mean solar time, outside which no Sun stands above 60° of latitude's horizon
STEP = 0.5  # °C, hPa, %: half the step of the numerical slopes
LEAST_NOISE = (0.003, 0.003, 0.03)  # of a reading, as files round it: 0.01 °C, 0.01 hPa, 0.1 %


@dataclass(frozen=True, eq=False)
class StationRecord:
    """One station's readings as states in time.

    temperature_c, pressure_hpa, humidity_percent   levels with their covariance
    """

    temperature_c: Trend
    pressure_hpa: Trend
    humidity_percent: Trend

    @staticmethod
    def of(seconds: np.ndarray, readings: np.ndarray) -> "StationRecord":
        """Record of n readings.

        seconds (n,), readings (n, 3): °C, hPa, %.
        """
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
    """Weather of each station at times (m,).

    Temperature °C, pressure hPa, humidity %: (m, stations, 3). Humidity stays within 0 to 100 %: a trend through
    readings near an end, or rounding in fog, leads beyond.
    """
    state = np.stack([np.stack([t.at(seconds) for t in r.trends], axis=-1) for r in records], axis=-2)
    state[..., 2] = np.clip(state[..., 2], 0.0, 100.0)
    return np.asarray(state)


def sunshine(where: Location, mjd_utc: np.ndarray, start: float) -> np.ndarray:
    """Sine of the Sun's altitude in time, 0 below the horizon.

    (2, n): s since the start and the sine; (2, 0) at night.
    """
    hours = 24.0 * (mjd_utc + where.longitude_deg / 360.0) % 24.0
    if np.all((hours < DAY[0]) | (hours > DAY[1])):
        return np.zeros((2, 0))
    from catseye.geometry.sky.sun import sun_direction

    times = np.linspace(mjd_utc.min(), mjd_utc.max(), max(2, int(np.ptp(mjd_utc) * 96.0) + 1))
    high = sun_direction(times, where.latitude_deg * DEGREE, where.longitude_deg * DEGREE)[:, 2]
    if np.all(high <= 0.0):
        return np.zeros((2, 0))
    return np.stack([(times - start) * SECONDS_PER_DAY, np.maximum(high, 0.0)])


def temperature_equivalents(
    records: Sequence[StationRecord], seconds: float, *, wavelength_um: float, model: str
) -> list[tuple[Trend, float]]:
    """Pressure and humidity records with their temperature equivalents.

    °C per hPa or per %: the same change of the index.
    """
    state = states_at(records, np.array([seconds]))[0].mean(axis=0)
    light = {"wavelength_um": wavelength_um, "model": model}
    by = []
    for k in range(3):
        up, down = state.copy(), state.copy()
        up[k], down[k] = up[k] + STEP, down[k] - STEP
        up[2], down[2] = min(up[2], 100.0), max(down[2], 0.0)
        by.append(float(group_refractivity(*up, **light) - group_refractivity(*down, **light)) / (up[k] - down[k]))
    return [(r.trends[k], by[k] / by[0]) for r in records for k in (1, 2)]
