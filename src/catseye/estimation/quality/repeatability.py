"""Repeatability: scatter of readings within sets and between sets."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError


@dataclass(frozen=True)
class Repeatability:
    """One-way analysis of variance of readings in sets.

    In the unit of the readings.

    mean, u_mean       weighted mean of the sets' means, and its standard uncertainty
    within             standard deviation of a reading within its set, `degrees_within` degrees of freedom
    between            additional standard deviation between sets, 0 if not significant
    intermediate       of one reading at another time: root of within^2 + between^2
    f, f_limit         ratio of the mean squares and its limit at `level`; above it the sets differ
    degrees_within, degrees_between
    usual              effective readings per set for unequal sets
    """

    mean: float
    u_mean: float
    within: float
    between: float
    f: float
    f_limit: float
    degrees_within: int
    degrees_between: int
    usual: float

    @property
    def intermediate(self) -> float:
        return float(np.hypot(self.within, self.between))

    @property
    def sets_differ(self) -> bool:
        return self.f > self.f_limit


def repeatability(values: ArrayLike, sets: Sequence[Hashable], *, level: float = 0.05) -> Repeatability:
    """Standard deviations within and between sets of readings of one quantity.

    values   (n,) readings, any unit
    sets     (n,) set of each reading: a day, a pointing, an operator; at least two sets, one with two readings
    level    of the F test that the sets agree

    A negative estimate of the between-set variance is set to zero; `f` shows its size.

    Raises ValidityError if the sets cannot separate the two components.

    Source: [ISO19] part 2, 7.4 (unequal sets too); moments, exact for equal sets.

    >>> result = repeatability([1.0, 1.2, 2.0, 2.2], ["a", "a", "b", "b"])
    >>> round(result.within, 6), round(result.between, 6), round(result.mean, 6)
    (0.141421, 0.7, 1.6)
    """
    y = np.asarray(values, dtype=float)
    if y.ndim != 1 or len(sets) != y.size or not np.all(np.isfinite(y)):
        raise ValidityError(
            f"{y.shape} readings with {len(sets)} set labels (expected equal numbers, all readings finite)"
        )
    names = list(dict.fromkeys(sets))
    rows = [np.array([s == name for s in sets]) for name in names]
    count = np.array([int(r.sum()) for r in rows])
    n, k = y.size, len(names)
    if k < 2 or n == k:
        raise ValidityError(f"{n} readings in {k} sets cannot separate scatter within and between sets")
    means = np.array([y[r].mean() for r in rows])
    square_within = float(sum(np.sum((y[r] - m) ** 2) for r, m in zip(rows, means, strict=True)) / (n - k))
    if square_within == 0.0:
        raise ValidityError("readings agree to the last digit within every set; give more digits")
    square_between = float(np.sum(count * (means - y.mean()) ** 2) / (k - 1))
    usual = (n - float(np.sum(count**2)) / n) / (k - 1)
    between = max(0.0, (square_between - square_within) / usual)
    mean, u_mean = _weighted(means, between + square_within / count)
    return Repeatability(
        mean=mean,
        u_mean=u_mean,
        within=float(np.sqrt(square_within)),
        between=float(np.sqrt(between)),
        f=square_between / square_within,
        f_limit=_f_limit(level, k - 1, n - k),
        degrees_within=n - k,
        degrees_between=k - 1,
        usual=usual,
    )


def _weighted(means: NDArray[np.float64], variance: NDArray[np.float64]) -> tuple[float, float]:
    weight = 1.0 / variance
    return float(weight @ means / weight.sum()), float(1.0 / np.sqrt(weight.sum()))


def _f_limit(level: float, between: int, within: int) -> float:
    from scipy.stats import f

    return float(f.ppf(1.0 - level, between, within))
