"""The air that no station reads, as a process in time: its level, its slope with height, its gradients across the site.

Each is a chain of knots with straight lines between. What is known of it before a shot is fired is a covariance: what
the stations' readings leave of their own air (`station_record`), and the air between stations and paths, whose
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
LEAST_STEP, ACROSS_STEP = 120.0, 300.0  # s between knots
SHOTS_A_KNOT, FEWEST_KNOTS, MOST_KNOTS = 30, 2, 150
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

    knots, across   (k,), (j,) s of level and slope, and of east and north
    record          (2k, 2k) °C^2, of levels then slopes: errors of the stations' records
    """

    knots: np.ndarray
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
        seconds = span[1] - span[0]
        count = int(np.clip(shots // SHOTS_A_KNOT, FEWEST_KNOTS, MOST_KNOTS))
        count = min(count, max(FEWEST_KNOTS, int(np.ceil(seconds / LEAST_STEP)) + 1))
        knots = np.linspace(*span, count)
        across = np.linspace(*span, min(count, max(FEWEST_KNOTS, int(np.ceil(seconds / ACROSS_STEP)) + 1)))
        design = np.ones((len(temperatures), 1)) if zeta is None else np.stack([np.ones(len(zeta)), zeta], axis=1)
        gain = np.linalg.pinv(design)
        k = len(knots)
        record = np.zeros((2 * k, 2 * k))
        for own, trend in zip(gain.T, temperatures, strict=True):
            record[: len(own) * k, : len(own) * k] += np.kron(np.outer(own, own), trend.covariance(knots))
        for trend, worth in others:
            record[:k, :k] += (worth / len(temperatures)) ** 2 * trend.covariance(knots)
        return AirKnots(knots, across, record)

    @property
    def count(self) -> int:
        """Parameters of the process: level, slope, east, north."""
        return 2 * (len(self.knots) + len(self.across))

    @property
    def labels(self) -> list[tuple[str, str]]:
        """Part and number of each parameter."""
        return [
            (part, str(i))
            for part, at in zip(PARTS, (self.knots, self.knots, self.across, self.across), strict=True)
            for i in range(len(at))
        ]

    def shapes(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Covariances of unit strength: (2k, 2k) of each of the first four strengths, and (j, j) across the site."""
        k = len(self.knots)
        shapes = []
        for time in (LEVEL_TIME, FAST_TIME):
            own = _forgetting(self.knots, time)
            for part in (slice(0, k), slice(k, 2 * k)):
                shape = np.zeros((2 * k, 2 * k))
                shape[part, part] = own
                shapes.append(shape)
        return shapes, _forgetting(self.across, ACROSS_TIME) + 1e-9 * np.eye(len(self.across))

    def covariances(self, strength: AirStrength) -> tuple[np.ndarray, np.ndarray]:
        """Prior (2k, 2k) of level and slope, °C^2, and (j, j) of each gradient, (°C/m)^2."""
        shapes, across = self.shapes()
        *own, by_metre = astuple(strength)
        prior = self.known + sum(s**2 * shape for s, shape in zip(own, shapes, strict=True))
        return prior, by_metre**2 * across

    @property
    def known(self) -> np.ndarray:
        """(2k, 2k) °C^2, of what the readings leave alone; 0.1 mK more, which keeps it positive definite."""
        return self.record + 1e-8 * np.eye(len(self.record))

    def columns(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters (m, 8) on which each time hangs, two knots a part in the order of `PARTS`, and shares (m, 4)."""
        first, share = hats(self.knots, seconds)
        far, far_share = hats(self.across, seconds)
        k, j = len(self.knots), len(self.across)
        at = np.stack([first, first + k, far + 2 * k, far + 2 * k + j], axis=1)
        columns = np.stack([at, at + 1], axis=2).reshape(len(first), 8)
        return columns, np.stack([share, share, far_share, far_share], axis=1)


def hats(knots: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Knot before each time (m,), the last but one at most, and how far on the way to the next it is, 0 to 1."""
    first = np.clip(np.searchsorted(knots, seconds, side="right") - 1, 0, len(knots) - 2)
    span = np.maximum(knots[first + 1] - knots[first], 1e-9)
    return first, np.clip((seconds - knots[first]) / span, 0.0, 1.0)


def _forgetting(knots: np.ndarray, time: float) -> np.ndarray:
    return np.asarray(np.exp(-np.abs(knots[:, None] - knots) / time))
