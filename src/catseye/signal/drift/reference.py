"""Drift of the electronics between reference shots, to be removed.

The drift is a random walk of variance random_walk^2 a second; 10 mrad per root hour is 1.67e-4 rad per root second.
"""

import numpy as np
from numpy.typing import ArrayLike


def drift_at(
    reference_time: np.ndarray,
    reference_phase: np.ndarray,
    reference_variance: np.ndarray,
    *,
    time: np.ndarray,
    random_walk: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Phase of the electronics with full covariance, from reference shots.

    The drift is a random walk.

    reference_time      (r,) s, any order, at least one
    reference_phase     (r,) rad, unwrapped
    reference_variance  (r,) rad^2, of the reference phases themselves
    time                (m,) s
    random_walk         growth of the drift, rad per square root of a second

    Returns (m,) rad and (m, m) rad^2. Between references the phase is a weighted line and its variance a parabola
    that vanishes only as far as the references are exact; beyond them the phase is the last level and its variance
    grows with time. Shots that share references are correlated, and so are neighbours in one gap. The first
    level has a flat prior. Work and memory grow with (r + m)^2, and r^3: some thousands of either; for the diagonal
    alone, `drift_along` goes on to millions.

    Source: best linear unbiased prediction of a Wiener process from noisy values; [PARKER04] section 5.4 asks for it
    without naming a rule. Exact for a random walk; a smooth warm-up transient T'' bends it by T'' gap^2 / 8.

    >>> phase, covariance = drift_at(np.array([0.0, 100.0]), np.array([0.0, 0.01]), np.zeros(2),
    ...                              time=np.array([50.0]), random_walk=1e-4)
    >>> f"{phase[0]:.6f} {covariance[0, 0]:.3e}"
    '0.005000 2.500e-07'
    """
    t = np.concatenate([np.asarray(reference_time, dtype=float), np.asarray(time, dtype=float)])
    r = len(reference_time)
    # A random walk from any origin before all times; a flat prior on its level makes the origin irrelevant.
    walk = random_walk**2 * (np.minimum(t[:, None], t) - t.min())
    reference_covariance = walk[:r, :r] + np.diag(np.asarray(reference_variance, dtype=float))
    # Two exact references at one time would be singular: a variance of a part in 1e12 avoids that.
    reference_covariance = reference_covariance + np.eye(r) * 1e-12 * max(
        float(np.trace(reference_covariance)) / r, random_walk**2, 1e-30
    )
    weight = np.linalg.inv(reference_covariance)
    ones = np.ones(r)
    level_variance = 1.0 / (ones @ weight @ ones)
    level = level_variance * (ones @ weight @ np.asarray(reference_phase, dtype=float))
    gain = walk[r:, :r] @ weight
    remainder = 1.0 - gain @ ones
    mean = level + gain @ (np.asarray(reference_phase, dtype=float) - level)
    covariance = walk[r:, r:] - gain @ walk[:r, r:] + level_variance * remainder[:, None] * remainder
    return mean, 0.5 * (covariance + covariance.T)


def drift_along(
    reference_time: np.ndarray,
    reference_phase: np.ndarray,
    reference_variance: np.ndarray,
    *,
    time: np.ndarray,
    random_walk: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Phase and standard uncertainty of the electronics, (m,) rad each.

    Arguments as for `drift_at`, the same mean and root of the diagonal, in r + m steps.

    Source: smoother of two filters: forward and backward filters of a random walk are independent
    estimates. Exact.

    >>> phase, u = drift_along(np.array([0.0, 100.0]), np.array([0.0, 0.01]), np.zeros(2), time=np.array([50.0]),
    ...                        random_walk=1e-4)
    >>> f"{phase[0]:.6f} {u[0]:.3e}"
    '0.005000 5.000e-04'
    """
    at = np.asarray(time, dtype=float)
    t, y, v = _sorted_references(reference_time, reference_phase, reference_variance, random_walk)
    preceding = np.searchsorted(t, at, side="right") - 1  # the last reference not later; -1 for none
    _, _, mean, spread = _filtered(t, y, v, random_walk)
    _, _, back_mean, back_spread = (a[::-1] for a in _filtered(-t[::-1], y[::-1], v[::-1], random_walk))
    lower, upper = np.maximum(preceding, 0), np.minimum(preceding + 1, len(t) - 1)
    before = np.where(preceding >= 0, spread[lower] + random_walk**2 * (at - t[lower]), np.inf)
    after = np.where(preceding + 1 < len(t), back_spread[upper] + random_walk**2 * (t[upper] - at), np.inf)
    return _joined(mean[lower], before, back_mean[upper], after)


def reference_prediction_error(
    reference_time: np.ndarray, reference_phase: np.ndarray, reference_variance: np.ndarray, *, random_walk: float
) -> tuple[np.ndarray, np.ndarray]:
    """Leave-one-out prediction error of each reference shot, with uncertainty.

    Arguments as for `drift_at`; at least two references; (r,) rad each; a single one gives (nan, nan).

    >>> d, u = reference_prediction_error(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), np.full(3, 1e-6),
    ...                           random_walk=1e-3)
    >>> int(np.argmax(np.abs(d) / u))
    1
    """
    r = len(reference_time)
    if r < 2:
        return np.full(r, np.nan), np.full(r, np.nan)
    order = np.argsort(reference_time, kind="stable")
    t, y, v = _sorted_references(reference_time, reference_phase, reference_variance, random_walk)
    before, spread, _, _ = _filtered(t, y, v, random_walk)
    after, back_spread, _, _ = (a[::-1] for a in _filtered(-t[::-1], y[::-1], v[::-1], random_walk))
    mean, u = _joined(before, spread, after, back_spread)
    difference, uncertainty = np.empty(r), np.empty(r)
    difference[order], uncertainty[order] = y - mean, np.hypot(u, np.sqrt(v))
    return difference, uncertainty


def _sorted_references(
    time: ArrayLike, phase: ArrayLike, variance: ArrayLike, random_walk: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sort references by time, with the variance floor of `drift_at`."""
    t = np.asarray(time, dtype=float)
    order = np.argsort(t, kind="stable")
    v = np.asarray(variance, dtype=float)
    scale = float(np.mean(v + random_walk**2 * (t - t.min())))
    floor = 1e-12 * max(scale, random_walk**2, 1e-30)
    return t[order], np.asarray(phase, dtype=float)[order], v[order] + floor


def _filtered(
    t: np.ndarray, y: np.ndarray, v: np.ndarray, random_walk: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Kalman filter of a walk from a flat prior.

    Returns mean and variance before and after each reference.
    """
    r = len(t)
    before, spread, mean, variance = np.zeros(r), np.full(r, np.inf), np.empty(r), np.empty(r)
    mean[0], variance[0] = y[0], v[0]
    for k in range(1, r):
        before[k], spread[k] = mean[k - 1], variance[k - 1] + random_walk**2 * (t[k] - t[k - 1])
        gain = spread[k] / (spread[k] + v[k])
        mean[k], variance[k] = before[k] + gain * (y[k] - before[k]), gain * v[k]
    return before, spread, mean, variance


def _joined(a: np.ndarray, variance_a: np.ndarray, b: np.ndarray, variance_b: np.ndarray) -> tuple:
    """Weighted mean of two independent values, with standard uncertainty.

    Infinite variance means no value.
    """
    weight_a, weight_b = 1.0 / variance_a, 1.0 / variance_b
    return (weight_a * a + weight_b * b) / (weight_a + weight_b), 1.0 / np.sqrt(weight_a + weight_b)
