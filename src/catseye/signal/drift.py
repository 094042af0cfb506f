"""Electronic drift removed by the reference cube: the phase of the electronics between reference shots."""

import numpy as np


def drift_at(
    reference_time: np.ndarray,
    reference_phase: np.ndarray,
    reference_variance: np.ndarray,
    time: np.ndarray,
    *,
    random_walk: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Phase of the electronics at given times, and its full covariance, from reference shots of a random walk.

    reference_time      (r,) s, any order, at least one
    reference_phase     (r,) rad, unwrapped
    reference_variance  (r,) rad^2, of the reference phases themselves
    time                (m,) s
    random_walk         growth of the drift, rad per square root of a second

    Returns (m,) rad and (m, m) rad^2. Between references the answer is a weighted line and its variance a parabola
    that vanishes only as far as the references are exact; beyond them it is the last level and grows with time.
    Shots that share references are correlated, and so are neighbours in one gap. Nothing is assumed of the first
    level (flat prior).

    Source: best linear unbiased prediction of a Wiener process from noisy values; [PARKER04] section 5.4 asks for it
    without naming a rule. Exact for a random walk; a smooth warm-up transient T'' bends it by T'' gap^2 / 8.

    >>> phase, covariance = drift_at(np.array([0.0, 100.0]), np.array([0.0, 0.01]), np.zeros(2),
    ...                              np.array([50.0]), random_walk=1e-4)
    >>> f"{phase[0]:.6f} {covariance[0, 0]:.3e}"
    '0.005000 2.500e-07'
    """
    t = np.concatenate([np.asarray(reference_time, dtype=float), np.asarray(time, dtype=float)])
    r = len(reference_time)
    # A random walk from any origin before all times; a flat prior on its level makes the origin irrelevant.
    walk = random_walk**2 * (np.minimum(t[:, None], t) - t.min())
    seen = walk[:r, :r] + np.diag(np.asarray(reference_variance, dtype=float))
    # Two references at one time and without noise would repeat each other: a part in 1e12 keeps them apart.
    seen = seen + np.eye(r) * 1e-12 * max(float(np.trace(seen)) / r, random_walk**2, 1e-30)
    weight = np.linalg.inv(seen)
    ones = np.ones(r)
    level_variance = 1.0 / (ones @ weight @ ones)
    level = level_variance * (ones @ weight @ np.asarray(reference_phase, dtype=float))
    gain = walk[r:, :r] @ weight
    rest = 1.0 - gain @ ones
    mean = level + gain @ (np.asarray(reference_phase, dtype=float) - level)
    covariance = walk[r:, r:] - gain @ walk[:r, r:] + level_variance * rest[:, None] * rest
    return mean, 0.5 * (covariance + covariance.T)


def reference_surprise(
    reference_time: np.ndarray, reference_phase: np.ndarray, reference_variance: np.ndarray, *, random_walk: float
) -> tuple[np.ndarray, np.ndarray]:
    """How far each reference shot lies from what the others predict: difference (r,) and its standard uncertainty.

    Arguments as for `drift_at`; at least two references. Of a single reference nothing can be said: (nan, nan).

    >>> d, u = reference_surprise(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), np.full(3, 1e-6),
    ...                           random_walk=1e-3)
    >>> int(np.argmax(np.abs(d) / u))
    1
    """
    r = len(reference_time)
    difference, uncertainty = np.full(r, np.nan), np.full(r, np.nan)
    for k in range(r) if r > 1 else ():
        others = np.arange(r) != k
        mean, covariance = drift_at(
            reference_time[others],
            reference_phase[others],
            reference_variance[others],
            reference_time[[k]],
            random_walk=random_walk,
        )
        difference[k] = reference_phase[k] - mean[0]
        uncertainty[k] = np.sqrt(covariance[0, 0] + reference_variance[k])
    return difference, uncertainty
