"""The air that no station reads, as a process in time: its level, its slope with height, its gradients across the site.

Each is a chain of knots with straight lines between. What is known of it before a shot is fired is a covariance: what
the stations' readings leave of their own air (`air.stations`), and the air between stations and paths, whose
strengths the ranges tell.

    temperature(x, y, z, t) = line through the stations + level(t) + slope(t) zeta(z) + east(t) x + north(t) y

with zeta 0 half-way between the lowest and the highest station and 1 at the highest. The site lives in the level and
the slope as a process of some minutes; across it, in hours.

Source: piecewise-linear offsets with constrained rates, as the analysis of very long baseline interferometry treats
troposphere and clocks.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np

from catseye.estimation.series.trend import Trend

LEVEL_TIME, FAST_TIME, ACROSS_TIME = 900.0, 100.0, 1800.0  # s, in which parts of the process forget
LEVEL_STEP, SLOPE_STEP, ACROSS_STEP = 75.0, 150.0, 300.0  # s between knots at least: a quarter of the shortest waves
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
WIDE = AirStrength(0.3, 0.1, 0.15, 0.05, 0.006)  # where nothing is known yet: rather too much than too little
LEAST = AirStrength(0.003, 0.002, 0.003, 0.002, 1e-4)
MOST = AirStrength(3.0, 1.0, 1.0, 0.5, 0.05)  # more in minutes, or across a site, no air holds


@dataclass(frozen=True, eq=False)
class AirKnots:
    """Where the process has its knots, and what the stations' readings leave unknown of it.

    level, slope, across   (k,), (l,), (j,) s; across both of east and north
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
        others: Sequence[tuple[Trend, float]],
        *,
        zeta: np.ndarray | None,
    ) -> "AirKnots":
        """Knots over a span of time that so many shots can tell apart.

        span           s, of the shots
        temperatures   of the stations
        others         pressures and humidities, and what a unit of each is worth in °C of the level
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
        for own, trend in zip(gain.T, temperatures, strict=True):
            by = np.append(own, 0.0)[part]
            record += by[:, None] * by * trend.covariance(times)
        for trend, worth in others:
            record[:k, :k] += (worth / len(temperatures)) ** 2 * trend.covariance(level)
        return AirKnots(level, slope, across, record)

    @property
    def count(self) -> int:
        """Parameters of the process: level, slope, east, north."""
        return len(self.level) + len(self.slope) + 2 * len(self.across)

    def first_across(self, columns: np.ndarray, north: bool) -> np.ndarray:
        """Knots of a gradient, counted from its own first, by columns of the process."""
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
        """Covariances of unit strength: of levels and slopes by each of the first four, and (j, j) across the site."""
        k, both = len(self.level), len(self.level) + len(self.slope)
        shapes = []
        for time in (LEVEL_TIME, FAST_TIME):
            for knots, part in ((self.level, slice(0, k)), (self.slope, slice(k, both))):
                shape = np.zeros((both, both))
                shape[part, part] = _forgetting(knots, time)
                shapes.append(shape)
        return shapes, _forgetting(self.across, ACROSS_TIME) + 1e-9 * np.eye(len(self.across))

    def covariances(self, strength: AirStrength) -> tuple[np.ndarray, np.ndarray]:
        """Prior of levels and slopes, °C^2, and (j, j) of each gradient, (°C/m)^2."""
        shapes, across = self.shapes()
        *own, by_metre = astuple(strength)
        prior = self.known + sum(s**2 * shape for s, shape in zip(own, shapes, strict=True))
        return prior, by_metre**2 * across

    @property
    def known(self) -> np.ndarray:
        """°C^2, of levels and slopes, what the readings leave alone; 0.1 mK more, which keeps it positive definite."""
        return self.record + 1e-8 * np.eye(len(self.record))

    def columns(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters (m, 8) on which each time hangs, two knots a part in the order of `PARTS`, and shares (m, 4)."""
        columns, shares, begin = [], [], 0
        for knots in (self.level, self.slope, self.across, self.across):
            first, share = hats(knots, seconds)
            columns += [begin + first, begin + first + 1]
            shares.append(share)
            begin += len(knots)
        return np.stack(columns, axis=1), np.stack(shares, axis=1)


U_LAG, U_RADIATION = 60.0, 0.5  # s, of a thermometer in its shield: 0 to 120 s; °C, in calm sunshine


def hats(knots: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Knot before each time (m,), the last but one at most, and how far on the way to the next it is, 0 to 1."""
    first = np.clip(np.searchsorted(knots, seconds, side="right") - 1, 0, len(knots) - 2)
    span = np.maximum(knots[first + 1] - knots[first], 1e-9)
    return first, np.clip((seconds - knots[first]) / span, 0.0, 1.0)


def _forgetting(knots: np.ndarray, time: float) -> np.ndarray:
    return np.asarray(np.exp(-np.abs(knots[:, None] - knots) / time))
