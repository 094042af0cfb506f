"""Full test procedure of ISO 17123-4 for distance meters: equal weights, points on one line.

Every pair of p points is measured, d = |x_j - x_i| + zero + e. Unknown are the p - 1 lengths from the first point and
the zero; the standard's correction delta is -zero. With all p (p - 1)/2 pairs measured once the solution is closed:

    zero = 6 (sum d - sum_k b_k B_k / p) / ((p - 1)(p - 2)),    u = s sqrt(6 / ((p - 1)(p - 2)))

with b_k = 2k - p - 1 and B_k the distances that end in k less those that begin there: the points' lengths see b only,
and the Laplacian of all pairs is p I - 1 1'. For the standard's seven points u = s sqrt(0.2), 14 degrees of freedom.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError


@dataclass(frozen=True, eq=False)
class FullTest:
    """Result of the full test procedure.

    x                    (p,) positions along the line, 0 for the first point, m
    zero                 excess of the instrument's reading, m; the standard's delta is -zero
    u_zero               its standard uncertainty from s, m
    s                    experimental standard deviation of a single distance, m (of unit weight, if sigma is given)
    degrees_of_freedom   nu
    residual             (m,) observed minus adjusted, m
    """

    x: np.ndarray
    zero: float
    u_zero: float
    s: float
    degrees_of_freedom: int
    residual: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """Result of a test: statistic, limit (and `lower` limit), and if it passed."""

    statistic: float
    limit: float
    passed: bool
    lower: float = 0.0


def full_test(start, end, distance, *, order, sigma=None) -> FullTest:
    """Positions of points on a line and the zero of an instrument, by least squares.

    start, end   (m,) numbers of the points of each distance, 0 to p - 1
    distance     (m,) along the line, m
    order        (p,) numbers of the points in sequence along the line
    sigma        (m,) claimed standard deviation of each distance, m, for weights; None: equal weights

    With `sigma`, s is the root of the variance factor: 1 if the claims are right.
    Source: [ISO12], full test procedure, there for seven points and 21 distances. Raises EstimationError if the
    distances do not determine the zero, or have no redundancy.

    >>> result = full_test([0, 0, 1, 0, 1, 2], [1, 2, 2, 3, 3, 3], [1.1, 3.1, 2.1, 6.1, 5.1, 3.1], order=[0, 1, 2, 3])
    >>> round(result.zero, 12), result.degrees_of_freedom
    (0.1, 2)
    """
    start, end, distance = np.asarray(start), np.asarray(end), np.asarray(distance, float)
    rank = np.empty(len(order), int)
    rank[np.asarray(order)] = np.arange(len(order))
    low, high = np.minimum(rank[start], rank[end]), np.maximum(rank[start], rank[end])
    rows = np.arange(len(distance))
    design = np.zeros((len(distance), len(order) + 1))
    design[rows, high] += 1.0
    design[rows, low] -= 1.0
    design[:, -1] = 1.0
    design = design[:, 1:]  # the first point stays at zero
    weight = np.ones(len(distance)) if sigma is None else 1.0 / np.asarray(sigma, float)
    inverse = np.linalg.pinv(weight[:, None] * design, rcond=1e-10)
    freedom = len(distance) - design.shape[1]
    if np.linalg.matrix_rank(weight[:, None] * design, tol=1e-9 * weight.max()) < design.shape[1]:
        raise EstimationError(
            f"{len(distance)} distances between {len(order)} points do not determine the zero: "
            "measure parts of a line and its full length"
        )
    if freedom < 1:
        raise EstimationError(
            f"{len(distance)} distances for {design.shape[1]} unknowns have no redundancy: measure more pairs"
        )
    values = inverse @ (weight * distance)
    residual = distance - design @ values
    s = float(np.sqrt(np.sum((weight * residual) ** 2) / freedom))
    x = np.zeros(len(order))
    x[np.asarray(order)] = np.concatenate([[0.0], values[:-1]])
    u_zero = s * float(np.linalg.norm(inverse[-1]))
    return FullTest(x=x, zero=float(values[-1]), u_zero=u_zero, s=s, degrees_of_freedom=freedom, residual=residual)


def within_claim(variance_factor: float, degrees_of_freedom: int, level: float = 0.05) -> Outcome:
    """Test a): s not larger than claimed (one-sided, limit from the claim alone).

    variance_factor      s² over the claimed variance
    degrees_of_freedom   nu
    level                false-alarm probability

    Source: [ISO12], statistical tests, s <= sigma sqrt(chi²/nu).

    >>> round(within_claim(1.0, 14).limit ** 0.5, 2)
    1.3
    """
    from scipy.stats import chi2

    limit = float(chi2.ppf(1.0 - level, degrees_of_freedom)) / degrees_of_freedom
    return Outcome(variance_factor, limit, variance_factor <= limit)


def same_precision(s: float, degrees_of_freedom: int, s_before: float, *, before: int, level: float = 0.05) -> Outcome:
    """Test b): two experimental standard deviations of one population (two-sided).

    s, degrees_of_freedom   of this sample, any unit
    s_before, before        of the earlier one, the same unit, and its degrees of freedom
    level                   false-alarm probability

    Source: [ISO12], statistical tests.

    >>> test = same_precision(1.0, 14, 1.0, before=14)
    >>> round(test.lower, 2), round(test.limit, 2)
    (0.34, 2.98)
    """
    from scipy.stats import f

    ratio = float("inf") if s_before == 0.0 else (s / s_before) ** 2
    lower = float(f.ppf(0.5 * level, degrees_of_freedom, before))
    limit = float(f.ppf(1.0 - 0.5 * level, degrees_of_freedom, before))
    return Outcome(ratio, limit, lower <= ratio <= limit, lower)


def is_nothing(value: float, u: float, degrees_of_freedom: float, *, level: float = 0.05) -> Outcome:
    """Test c): a value, such as the zero, does not differ from zero (two-sided).

    value                any unit
    u                    its standard uncertainty, from a sample, the same unit
    degrees_of_freedom   of u; infinite if u is known a priori
    level                false-alarm probability

    Source: [ISO12], statistical tests, |delta| <= t u.

    >>> round(is_nothing(0.0, 1.0, 14).limit, 2)
    2.14
    """
    from scipy.stats import t

    statistic = abs(value) / u if u > 0.0 else (0.0 if value == 0.0 else float("inf"))
    limit = float(t.ppf(1.0 - 0.5 * level, degrees_of_freedom))
    return Outcome(statistic, limit, statistic <= limit)
