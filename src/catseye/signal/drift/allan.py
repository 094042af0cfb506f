"""Overlapping Allan deviation of a series, and noise kinds.

The series y is the reading itself (phase a cycle, range a buffer), equally spaced; averaging m of them, white noise
falls as m^(-1/2), flicker stays, a random walk grows as m^(1/2). For clocks this is the deviation of
fractional frequency, with y the frequency.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

KINDS = ("white", "flicker", "random walk")
SLOPES = {"white": -1.0, "flicker": 0.0, "random walk": 1.0}  # of the variance against m, in logarithms


@dataclass(frozen=True, eq=False)
class AllanDeviation:
    """Allan deviations, one element an averaging length.

    size       m, readings averaged
    deviation  in the unit of the series
    degrees    equivalent degrees of freedom of its square
    kind       dominant noise there, one of KINDS, from the local slope
    """

    size: NDArray[np.int64]
    deviation: NDArray[np.float64]
    degrees: NDArray[np.float64]
    kind: tuple[str, ...]

    def interval(self, probability: float = 0.95) -> NDArray[np.float64]:
        """Confidence limits (sizes, 2), chi-square with `degrees`."""
        from scipy.stats import chi2

        tail = 0.5 * (1.0 - probability)
        quantiles = chi2.ppf(np.array([1.0 - tail, tail]), self.degrees[:, None])
        return self.deviation[:, None] * np.sqrt(self.degrees[:, None] / quantiles)


def octaves(count: int) -> NDArray[np.int64]:
    """Averaging lengths 1, 2, 4, ... for a series.

    count   readings; each length has at least four

    >>> octaves(40).tolist()
    [1, 2, 4, 8]
    """
    if count < 4:
        raise ValidityError(f"{count} readings are too few for an Allan deviation (expected at least 4)")
    return 2 ** np.arange(int(np.log2(count // 4)) + 1)


def allan_deviation(series: ArrayLike, sizes: ArrayLike | None = None) -> AllanDeviation:
    """Overlapping Allan deviation of a series.

    Rms difference of neighbouring averages of m readings, over the square root of 2.

    series   (n,) readings at equal intervals, any unit, none missing, n at least 4; phases unwrapped
    sizes    m, whole numbers of 1 to n/2 (default `octaves(n)`)

    Raises ValidityError for a series that is too short or has gaps, or a size that does not fit.

    Source: [RILEY08] eq. 11 (overlapping form) and table 5 (degrees of freedom, by the kind of noise that prevails,
    good to some 10 %). Exact for the deviation but for rounding.

    >>> float(allan_deviation([1.0, 0.0, 1.0, 0.0, 1.0], [1]).deviation[0]).__round__(6)
    0.707107
    """
    y = np.asarray(series, dtype=float)
    if y.ndim != 1 or y.size < 4:
        raise ValidityError(f"a series of shape {y.shape} has no Allan deviation (expected at least 4 readings)")
    if not np.all(np.isfinite(y)):
        where = int(np.flatnonzero(~np.isfinite(y))[0])
        raise ValidityError(f"reading {where} of the series is {y[where]} (expected numbers at equal intervals)")
    m = octaves(y.size) if sizes is None else np.atleast_1d(np.asarray(sizes))
    if np.any(m != np.rint(m)) or np.any(m < 1) or np.any(2 * m > y.size):
        raise ValidityError(f"averaging lengths {m.tolist()} are not whole numbers of 1 to {y.size // 2}")
    m = m.astype(np.int64)
    sums = np.concatenate([[0.0], np.cumsum(y - y.mean())])  # the mean cancels; removing it saves digits
    variance = np.array([_variance(sums, int(size)) for size in m])
    kind = _prevailing(m, variance)
    degrees = np.array([_degrees(k, y.size + 1, int(size)) for k, size in zip(kind, m, strict=True)])
    return AllanDeviation(m, np.sqrt(variance), degrees, kind)


def expected_variance(size: ArrayLike, *, white: float = 0.0, flicker: float = 0.0, walk: float = 0.0) -> NDArray:
    """Allan variance of averages for a mixture of noises.

    size      m, readings averaged
    white     standard deviation of a reading
    flicker   square root of the coefficient h of a one-sided density h/f; f any unit
    walk      standard deviation of a step from one reading to the next

    Source: [RILEY08] table 3: white^2/m + 2 ln 2 flicker^2 + walk^2 m/3 for large m. Here exact for readings that are
    points: a walk in steps gives walk^2 (2 m^2 + 1)/(6 m), and flicker of the density pi h / sin(pi v) (see
    `catseye.signal.drift.noise`) 2 h at m = 1, within 2 % of 2 ln 2 h from m = 8 on; its integral by quadrature.

    >>> float(expected_variance(1, walk=1.0)), round(float(expected_variance(1, flicker=1.0)), 9)
    (0.5, 2.0)
    """
    m = np.asarray(size, dtype=float)
    return white**2 / m + flicker**2 * _flicker_variance(m) + walk**2 * (2.0 * m**2 + 1.0) / (6.0 * m)


def _flicker_variance(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral of (pi / sin x) 2 sin(m x)^4 / (m sin x)^2 over frequency, x = pi v up to a right angle."""
    x, w = np.polynomial.legendre.leggauss(16)
    variance = np.empty(sizes.shape)
    for k, m in np.ndenumerate(sizes):
        edges = np.linspace(0.0, 0.5, int(m) + 1)  # half a wave of sin(m x) to a piece
        v = (edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1.0 + x)).ravel()
        weight = np.tile(0.25 * w / m, int(m))
        variance[k] = np.sum(weight * 2.0 * np.pi * np.sin(m * np.pi * v) ** 4 / (m**2 * np.sin(np.pi * v) ** 3))
    return variance


def _variance(sums: NDArray[np.float64], m: int) -> float:
    second = sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]
    return float(np.mean(second**2) / (2.0 * m**2))


def _prevailing(m: NDArray[np.int64], variance: NDArray[np.float64]) -> tuple[str, ...]:
    """Noise kind of nearest slope, by averaging length."""
    if len(m) < 2 or np.any(variance <= 0.0):
        return ("white",) * len(m)
    slope = np.gradient(np.log(variance), np.log(m.astype(float)))
    return tuple(min(KINDS, key=lambda kind: abs(SLOPES[kind] - s)) for s in slope)


def _degrees(kind: str, points: int, m: int) -> float:
    """Equivalent degrees of freedom of an overlapping variance.

    points   readings plus one
    """
    n = float(points)
    if kind == "white":
        degrees = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    elif kind == "flicker":
        degrees = 2.0 * (n - 2.0) ** 2 / (2.3 * n - 4.9) if m == 1 else 5.0 * n**2 / (4.0 * m * (n + 3.0 * m))
    else:
        degrees = (n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m**2) / (n - 3.0) ** 2
    return max(degrees, 1.0)
