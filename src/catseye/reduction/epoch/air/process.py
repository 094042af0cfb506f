"""Air that no station reads, as a process in time.

Its parts: level, slope with height, gradients across the site. Each is a chain of knots with straight lines
between. Its prior is a covariance: what the stations' readings leave uncertain of their own air (`air.stations`),
and the air between stations and paths, whose strengths follow from the ranges.

    temperature(x, y, z, t) = line through the stations + level(t) + slope(t) zeta(z) + east(t) x + north(t) y

with zeta 0 half-way between the lowest and the highest station and 1 at the highest. Level and slope vary within
minutes, the gradients across the site within hours.

Source: piecewise-linear offsets with constrained rates, as the analysis of very long baseline interferometry treats
troposphere and clocks.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np

from catseye.estimation.series.trend import Trend

LEVEL_TIME, FAST_TIME, ACROSS_TIME = 900.0, 100.0, 1800.0  # s, correlation times of the parts
LEVEL_STEP, SLOPE_STEP, ACROSS_STEP = 75.0, 150.0, 300.0  # s, least distance of knots: a quarter of the shortest waves
SHOTS_A_KNOT, FEWEST_KNOTS, MOST_KNOTS = 30, 2, 400
LEVEL_HEIGHT = 50.0  # m, of zeta = 1 where all stations are at one height
PARTS = ("level", "slope", "east", "north")


@dataclass(frozen=True)
class AirStrength:
    """Standard deviations of the process between stations and paths.

    level_c, slope_c             °C, common to the site, and at zeta = 1: in quarters of an hour
    level_fast_c, slope_fast_c   the same in minutes
    across_c_per_m               °C/m, each of east and north
    """

    level_c: float = 0.1
    slope_c: float = 0.03
    level_fast_c: float = 0.03
    slope_fast_c: float = 0.01
    across_c_per_m: float = 0.003


USUAL = AirStrength()
WIDE = AirStrength(0.3, 0.1, 0.15, 0.05, 0.006)  # before any estimate: rather too large than too small
LEAST = AirStrength(0.003, 0.002, 0.003, 0.002, 1e-4)
MOST = AirStrength(3.0, 1.0, 1.0, 0.5, 0.05)  # upper limits of real air


@dataclass(frozen=True, eq=False)
class AirKnots:
    """Knots of the process, and their uncertainty by the stations' readings.

    level, slope, across   (k,), (l,), (j,) s; across for east and north alike
    record                 (k + l, k + l) °C^2, of levels then slopes: errors of the stations' records
    """

    level: np.ndarray
    slope: np.ndarray
    across: np.ndarray
    record: np.ndarray

    @staticmethod
    def of(
        span: tuple[float, float],
        shots: int,
        temperatures: Sequence[Trend],
        other_trends: Sequence[tuple[Trend, float]],
        *,
        zeta: np.ndarray | None,
    ) -> "AirKnots":
        """Knots over a span that so many shots can resolve.

        span           s, of the shots
        temperatures   of the stations
        other_trends   pressures and humidities, and the equivalent of a unit of each in °C of the level
        zeta           (stations,) heights in units of the slope's; None where they stand at one height
        """
        seconds, most = span[1] - span[0], int(np.clip(shots // SHOTS_A_KNOT, FEWEST_KNOTS, MOST_KNOTS))
        level, slope, across = (
            np.linspace(*span, int(np.clip(np.ceil(seconds / step) + 1, FEWEST_KNOTS, max(FEWEST_KNOTS, most // per))))
            for step, per in ((LEVEL_STEP, 1), (SLOPE_STEP, 2), (ACROSS_STEP, 2))
        )
        design = np.ones((len(temperatures), 1)) if zeta is None else np.stack([np.ones(len(zeta)), zeta], axis=1)
        gain = np.linalg.pinv(design)
        k, times = len(level), np.concatenate([level, slope])
        part = np.repeat([0, 1], [k, len(slope)])
        record = np.zeros((len(times), len(times)))
        for station_gain, trend in zip(gain.T, temperatures, strict=True):
            by = np.append(station_gain, 0.0)[part]
            record += by[:, None] * by * trend.covariance(times)
        for trend, worth in other_trends:
            record[:k, :k] += (worth / len(temperatures)) ** 2 * trend.covariance(level)
        return AirKnots(level, slope, across, record)

    @property
    def count(self) -> int:
        """Number of parameters: level, slope, east, north."""
        return len(self.level) + len(self.slope) + 2 * len(self.across)

    def first_across(self, columns: np.ndarray, north: bool) -> np.ndarray:
        """Knots of a gradient by columns of the process.

        Counted from the gradient's first.
        """
        return columns - len(self.level) - len(self.slope) - (len(self.across) if north else 0)

    @property
    def labels(self) -> list[tuple[str, str]]:
        """Part and number of each parameter."""
        return [
            (part, str(i))
            for part, at in zip(PARTS, (self.level, self.slope, self.across, self.across), strict=True)
            for i in range(len(at))
        ]

    def shapes(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Covariances of unit strength.

        Of levels and slopes by each of the first four strengths, and (j, j) across the site.
        """
        k, level_and_slope = len(self.level), len(self.level) + len(self.slope)
        shapes = []
        for time in (LEVEL_TIME, FAST_TIME):
            for knots, part in ((self.level, slice(0, k)), (self.slope, slice(k, level_and_slope))):
                shape = np.zeros((level_and_slope, level_and_slope))
                shape[part, part] = _forgetting(knots, time)
                shapes.append(shape)
        return shapes, _forgetting(self.across, ACROSS_TIME) + 1e-9 * np.eye(len(self.across))

    def covariances(self, strength: AirStrength) -> tuple[np.ndarray, np.ndarray]:
        """Prior of levels and slopes, °C^2, and of each gradient.

        The gradient's is (j, j), (°C/m)^2.
        """
        shapes, across = self.shapes()
        *level_and_slope, by_metre = astuple(strength)
        prior = self.record_covariance + sum(s**2 * shape for s, shape in zip(level_and_slope, shapes, strict=True))
        return prior, by_metre**2 * across

    @property
    def record_covariance(self) -> np.ndarray:
        """Covariance of levels and slopes by the readings alone, °C^2.

        Plus 0.1 mK, which keeps it positive definite.
        """
        return self.record + 1e-8 * np.eye(len(self.record))

    def columns(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters (m, 8) of each time, and shares (m, 4).

        Two knots per part in the order of `PARTS`.
        """
        columns, shares, begin = [], [], 0
        for knots in (self.level, self.slope, self.across, self.across):
            first, share = hats(knots, seconds)
            columns += [begin + first, begin + first + 1]
            shares.append(share)
            begin += len(knots)
        return np.stack(columns, axis=1), np.stack(shares, axis=1)


U_LAG, U_RADIATION = 60.0, 0.5  # s, of a thermometer in its shield: 0 to 120 s; °C, in calm sunshine


def hats(knots: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Knot before each time (m,) and position towards the next, 0 to 1.

    The last knot but one at most.
    """
    first = np.clip(np.searchsorted(knots, seconds, side="right") - 1, 0, len(knots) - 2)
    span = np.maximum(knots[first + 1] - knots[first], 1e-9)
    return first, np.clip((seconds - knots[first]) / span, 0.0, 1.0)


def _forgetting(knots: np.ndarray, time: float) -> np.ndarray:
    return np.asarray(np.exp(-np.abs(knots[:, None] - knots) / time))
