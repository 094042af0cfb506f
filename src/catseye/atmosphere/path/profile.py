"""Profile of one quantity of the air in height and time, by kriging.

A Gauss-Markov process from stations' readings, with its covariance.

The quantity at a height h above the ground and a time t is

    level(t) + gradient(t) h + layer(t) ln(1 + h/1 m) + local air

the form of mixed air or a steady inversion, and the logarithm of the surface layer by day and night. Each coefficient
is an unknown steady part and a part that changes with a correlation time (Matérn's 3/2: it has a slope, so that a drift
continues for a while and then decays). Local air belongs to one place: turbulence, a correlation
time of a minute. Each station has an offset, common to all its readings, and each reading its noise. All these are
priors, so that one station, stations at one height, a gap, a time outside the readings are not special cases: where
nothing was read, the standard uncertainty grows to the prior's.

A station's place is not in its record; its local air is taken as independent of all paths and other stations.
"""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.errors import EstimationError, ValidityError

MOST_READINGS = 2000  # of one quantity: 1 s on one core; average more first (`ProfileReadings.averaged`)
ABOVE_GROUND = ValidInterval("height above the ground", "m", 0.0, 1000.0, "a logarithmic surface layer", places=1)
BLOCK_ROWS = 512  # elements of a covariance at a time


@dataclass(frozen=True)
class Coefficient:
    """Prior of a coefficient; its expectation is zero, the level's the readings' mean.

    steady     standard uncertainty of its part that does not change
    changing   standard deviation of its part that does
    time       s, correlation time of that, above zero
    """

    steady: float
    changing: float
    time: float

    def covariance(self, lag: np.ndarray) -> np.ndarray:
        """Covariance at time lags in s: Matérn's with 3/2, [RASMUSSEN06] eq. 4.17."""
        r = np.sqrt(3.0) * np.abs(lag) / self.time
        return self.steady**2 + self.changing**2 * (1.0 + r) * np.exp(-r)


@dataclass(frozen=True)
class ProfilePrior:
    """Prior of a quantity, in its unit.

    level, gradient, layer   coefficients: unit, unit/m, unit per factor e of (1 m + height above the ground)
    offset                   standard uncertainty of a station's constant offset
    noise                    of one reading
    local                    standard deviation of local air
    local_time               s, its correlation time at a fixed place
    local_length             m, its correlation length
    """

    level: Coefficient
    gradient: Coefficient
    layer: Coefficient
    offset: float
    noise: float
    local: float = 0.0
    local_time: float = 60.0
    local_length: float = 20.0

    @property
    def coefficients(self) -> tuple[Coefficient, Coefficient, Coefficient]:
        """Coefficients in the order of `Profile.basis`."""
        return self.level, self.gradient, self.layer

    def local_covariance(self, seconds: np.ndarray) -> np.ndarray:
        """Covariance (m, m) of local air at one place between times (m,)."""
        return self.local**2 * np.exp(-np.abs(seconds[:, None] - seconds) / self.local_time)


# 3 °C in 3 h: slopes of some 2 °C/h; 0.02 °C/m: lapse and inversion; 0.2 °C: T*/0.4 of a calm night or a fair day;
# 0.15 °C: half a degree within a minute by day is three sigmas ([PARKER04] section 1.6.2)
TEMPERATURE = ProfilePrior(
    Coefficient(20.0, 3.0, 10_800.0), Coefficient(0.02, 0.01, 3600.0), Coefficient(0.2, 0.1, 3600.0),
    offset=0.3, noise=0.05, local=0.15,
)  # fmt: skip
# reduced to one height before; 2 hPa in 3 h, a front's; 0.2 hPa: a barometer not lately compared
PRESSURE = ProfilePrior(
    Coefficient(50.0, 2.0, 10_800.0), Coefficient(0.0, 0.0, 3600.0), Coefficient(0.0, 0.0, 3600.0),
    offset=0.2, noise=0.05,
)  # fmt: skip
# relative humidity; 0.06 %/m: what a lapse or an inversion of 0.01 °C/m makes of an even vapour pressure
HUMIDITY = ProfilePrior(
    Coefficient(50.0, 15.0, 10_800.0), Coefficient(0.06, 0.03, 3600.0), Coefficient(1.0, 0.5, 3600.0),
    offset=2.0, noise=0.5, local=1.0,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ProfileReadings:
    """Readings of one quantity.

    seconds   (n,) s, from any start
    z         (n,) m, height of its station
    station   (n,) int, which station, from 0
    value     (n,) the quantity's unit
    count     (n,) readings averaged in each
    """

    seconds: np.ndarray
    z: np.ndarray
    station: np.ndarray
    value: np.ndarray
    count: np.ndarray

    def averaged(self, block: float) -> "ProfileReadings":
        """Means over blocks of time, by station.

        block   s, length of a block, above zero

        The noise falls with the root of the count. Local air is not reduced, which gives a slightly too
        large standard uncertainty where blocks are longer than its correlation time.
        Raises ValidityError for a block that is not above zero.

        >>> two = ProfileReadings(*(np.array(v) for v in ([0.0, 10.0], [2.0, 2.0], [0, 0], [5.0, 6.0], [1, 1])))
        >>> two.averaged(60.0).value, two.averaged(60.0).count
        (array([5.5]), array([2]))
        """
        if not block > 0.0:
            raise ValidityError(f"block of {block} s is not above zero")
        key = np.stack([self.station, np.floor((self.seconds - self.seconds.min()) / block)], axis=1)
        _, of = np.unique(key, axis=0, return_inverse=True)
        of = of.ravel()
        count = np.bincount(of, weights=self.count)

        def mean(column):
            return np.bincount(of, weights=self.count * column) / count

        first = np.unique(of, return_index=True)[1]
        counts = np.rint(count).astype(int)
        return ProfileReadings(mean(self.seconds), self.z[first], self.station[first], mean(self.value), counts)


@dataclass(frozen=True, eq=False)
class Profile:
    """Profile of a quantity given its readings; `Profile.of` makes one.

    readings    the readings
    prior       the prior
    ground      m, height of the ground
    mean        the readings' mean, from which the level counts
    weights     (n,) inverse covariance of the readings times (readings - mean)
    factor      (n, n) lower Cholesky factor of that covariance
    """

    readings: ProfileReadings
    prior: ProfilePrior
    ground: float
    mean: float
    weights: np.ndarray
    factor: np.ndarray

    @classmethod
    def of(cls, readings: ProfileReadings, prior: ProfilePrior, *, ground: float) -> "Profile":
        """Profile from readings.

        readings   at least one
        prior      TEMPERATURE, PRESSURE, HUMIDITY or another
        ground     m, height of the ground; nothing is below it

        Source: [RASMUSSEN06] eqs. 2.23, 2.24; the model is at the top of this file.
        Raises EstimationError without a reading or with more than MOST_READINGS, ValidityError for readings that are
        not finite or below the ground.

        >>> one = ProfileReadings(*(np.array(v) for v in ([0.0], [2.0], [0], [15.0], [1])))
        >>> air = Profile.of(one, TEMPERATURE, ground=0.0)
        >>> np.round(air.at([0.0, 0.0], [2.0, 52.0]), 2), np.round(air.u_at([0.0, 0.0], [2.0, 52.0]), 2)
        (array([15., 15.]), array([0.34, 1.33]))
        """
        from scipy.linalg import cholesky

        n = len(readings.value)
        if n == 0:
            raise EstimationError("no readings; priors alone do not determine the air")
        if n > MOST_READINGS:
            raise EstimationError(f"{n} readings are more than {MOST_READINGS}; average them over blocks of time first")
        for name in ("seconds", "z", "value"):
            if not np.all(np.isfinite(getattr(readings, name))):
                raise ValidityError(f"{name} of a reading is not finite; leave the reading out")
        mean = float(np.mean(readings.value))
        empty = cls(
            readings=readings, prior=prior, ground=ground, mean=mean, weights=np.zeros(n), factor=np.zeros((0, 0))
        )
        basis = empty.basis(readings.z)
        covariance = empty._smooth(readings.seconds, basis, readings.seconds, basis)
        same_station = readings.station[:, None] == readings.station
        covariance += same_station * (prior.offset**2 + prior.local_covariance(readings.seconds))
        covariance[np.diag_indices(n)] += prior.noise**2 / readings.count
        factor = cholesky(covariance, lower=True, overwrite_a=True)
        weights = _solved(factor, _solved(factor, readings.value - mean), transposed=True)
        return cls(readings=readings, prior=prior, ground=ground, mean=mean, weights=weights, factor=factor)

    def basis(self, z) -> np.ndarray:
        """Basis (..., 3) of the coefficients at heights z (...).

        Raises ValidityError below the ground.
        """
        h = np.asarray(z, float) - self.ground
        ABOVE_GROUND.check(h)
        return np.stack([np.ones(h.shape), h, np.log1p(h)], axis=-1)

    def coefficients(self, seconds) -> np.ndarray:
        """Coefficients (m, 3) at times (m,), the level from `mean`."""
        lag = np.asarray(seconds, float)[:, None] - self.readings.seconds
        design = self.basis(self.readings.z) * self.weights[:, None]
        return np.stack([c.covariance(lag) @ design[:, j] for j, c in enumerate(self.prior.coefficients)], axis=1)

    def at(self, seconds, z) -> np.ndarray:
        """Smooth quantity (m, ...) at times (m,) and heights (m, ...).

        Without local air and offsets.
        """
        basis = self.basis(z)
        return self.mean + np.einsum("m...j,mj->m...", basis, self.coefficients(seconds))

    def u_at(self, seconds, z) -> np.ndarray:
        """Standard uncertainty of `at` for heights (m,)."""
        return np.sqrt(np.diagonal(self.covariance(seconds, self.basis(z))))

    def covariance(self, seconds, weights) -> np.ndarray:
        """Covariance (m, m) of sums of the smooth quantity over heights.

        Each sum is at one time.

        seconds   (m,) s
        weights   (m, 3) `basis` summed over its heights; for a mean along a path, averaged
        """
        t, weights = np.asarray(seconds, float), np.asarray(weights, float)
        basis = self.basis(self.readings.z)
        learnt = _solved(self.factor, self._smooth(self.readings.seconds, basis, t, weights))
        return self._smooth(t, weights, t, weights) - learnt.T @ learnt

    def offsets(self) -> tuple[np.ndarray, np.ndarray]:
        """Offset and u (stations,) of each station, from other stations and prior."""
        count = int(self.readings.station.max()) + 1
        of = (self.readings.station[:, None] == np.arange(count)) * self.prior.offset**2
        learnt = _solved(self.factor, of)
        return of.T @ self.weights, np.sqrt(np.maximum(self.prior.offset**2 - np.sum(learnt**2, axis=0), 0.0))

    def _smooth(self, s, f, t, g) -> np.ndarray:
        """Prior covariance of the smooth quantity, times s (n,), t (m,), weights f (n, 3), g (m, 3)."""
        out = np.empty((len(s), len(t)))
        for k in range(0, len(s), BLOCK_ROWS):
            rows = slice(k, k + BLOCK_ROWS)
            lag = s[rows, None] - t
            out[rows] = sum(
                (f[rows, None, j] * g[None, :, j]) * c.covariance(lag) for j, c in enumerate(self.prior.coefficients)
            )
        return out


def _solved(factor, right, *, transposed=False):
    from scipy.linalg import solve_triangular

    return solve_triangular(factor, right, lower=True, trans=1 if transposed else 0, check_finite=False)
