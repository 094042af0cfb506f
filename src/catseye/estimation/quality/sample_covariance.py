"""Test of simulated errors against the covariance that they are claimed to have, as matrices.

A matrix test sees what a ratio of variances does not: errors that are too large along one combination of the
parameters, or correlated otherwise than claimed, while their sum of squares is right.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtrc

LEVEL = 1e-3  # probability of each test below which the claim is contradicted
RANK = 1e-12  # eigenvalue of a correlation matrix, over the largest, below which a combination has no error: rounding
# of a Tracy-Widom variate of order 1, exceeded once in a thousand: Monte Carlo of this file's test agrees
ONCE_IN_A_THOUSAND = 3.2724


@dataclass(frozen=True)
class CovarianceTest:
    """Scatter of simulated errors beside their claimed covariance.

    combinations         k, of the parameters: independent and of unit variance if the claim holds
    statistic            of the matrix; chi-square if the claim holds
    degrees_of_freedom   k (k + 1) / 2
    p                    probability of a larger statistic if the claim holds
    p_size               probability of a sum of squares farther from its expectation, either side
    largest              error over claim along the worst combination of all, root mean square
    by_chance            what `largest` exceeds in one simulation of a thousand if the claim holds
    """

    combinations: int
    statistic: float
    degrees_of_freedom: int
    p: float
    p_size: float
    largest: float
    by_chance: float

    @property
    def agrees(self) -> bool:
        """True if neither the matrix nor the sum of squares contradicts the claim."""
        return min(self.p, self.p_size) >= LEVEL

    @property
    def excess(self) -> float:
        """Error over claim along the worst combination, over what chance gives."""
        return self.largest / self.by_chance


def whitening(covariance: np.ndarray) -> np.ndarray:
    """Combinations (k, n) of parameters whose errors are independent and of unit variance.

    covariance   (n, n), of rank k

    >>> np.abs(whitening(np.array([[4.0, 0.0], [0.0, 0.0]])))
    array([[0.5, 0. ]])
    """
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = 1.0 / np.where(u > 0.0, u, np.inf)
    values, vectors = np.linalg.eigh(covariance * scale[:, None] * scale)
    chosen = values > RANK * values.max(initial=0.0)
    return np.asarray((vectors[:, chosen] / np.sqrt(values[chosen])).T * scale)


def covariance_test(moments: np.ndarray, runs: int) -> CovarianceTest:
    """Test that errors have the claimed covariance and no mean.

    moments   (k, k) sum over the runs of z z', with z of unit covariance by the claim, see `whitening`
    runs      of them, independent and normally distributed

    The statistic holds also where the runs are no more than the combinations, though then its p below 0.01 is up to
    twice too small. Source: [LEDOIT02] proposition 7, with a known mean; [JOHNSTONE01] theorem 1.1.

    >>> test = covariance_test(100.0 * np.eye(3), 100)
    >>> test.degrees_of_freedom, test.largest
    (6, 1.0)
    """
    k, n = len(moments), float(runs)
    sample = moments / n
    level = float(np.trace(sample)) / k
    distance = float(np.sum((sample - np.eye(k)) ** 2)) / k - k / n * level**2 + k / n
    statistic, degrees = max(0.5 * n * k * distance, 0.0), k * (k + 1) // 2
    below = float(chdtr(n * k, n * k * level))
    root = np.sqrt(max(n - 1.0, 1.0)) + np.sqrt(k)
    width = root * (1.0 / np.sqrt(max(n - 1.0, 1.0)) + 1.0 / np.sqrt(k)) ** (1.0 / 3.0)
    return CovarianceTest(
        combinations=k,
        statistic=statistic,
        degrees_of_freedom=degrees,
        p=float(chdtrc(degrees, statistic)),
        p_size=2.0 * min(below, 1.0 - below),
        largest=float(np.sqrt(max(np.linalg.eigvalsh(sample)[-1], 0.0))),
        by_chance=float(np.sqrt((root**2 + ONCE_IN_A_THOUSAND * width) / n)),
    )
