"""Spectrum of residuals over unevenly spaced positions.

For a period outside the model.
"""

import numpy as np

from catseye.constants import TWO_PI

MOST_CYCLES = 16.0  # periods looked at reach down to the half wavelength over this
SHORTEST = 2.0  # mean steps of the positions: a shorter period looks like a longer one
LEAST = 6  # readings: three are a mean, a cosine and a sine
WORST_CONDITION = 1e6  # of the two waves of a period: a sine that vanishes at every position is no line


def spectrum(
    position: np.ndarray, residual: np.ndarray, covariance: np.ndarray, *, half: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Period (k,) m, amplitude (k,) m and chance probability (k,).

    Amplitude of the best wave of each; chance of as strong a line without a cause.

    position     (m,) m
    residual     (m,) m
    covariance   (m, m) m^2, of the values behind the residuals: a drift that it holds is no line
    half         m, half the modulation's wavelength

    Each period is fitted with a mean, a cosine and a sine, weighted. The wave takes a share z of the weighted sum of
    squares; in noise as claimed, up to a factor, z exceeds a value with the chance (1 - z)^((m - 3)/2), and the
    strongest of as many periods as there are readings with 1 - (1 - that)^m: a guide, as neighbouring periods are not
    independent. The longest period is the span, the shortest two steps of the positions. With fewer than six readings
    nothing is said: one period, amplitude 0, chance 1.

    Source: least squares spectral analysis, the chance from the beta distribution of z; [SIDAK67] for the strongest of
    many.
    """
    m, span = len(position), float(np.ptp(position))
    if m < LEAST or span == 0.0 or not np.any(residual):
        return np.array([half]), np.zeros(1), np.ones(1)
    most = min(MOST_CYCLES * span / half, (m - 1) / SHORTEST)
    frequency = np.arange(1.0, max(2.0, most), 0.25) / span
    angle = TWO_PI * frequency[:, None] * (position - position.mean())
    lower = np.linalg.cholesky(covariance)
    level = np.linalg.solve(lower, np.ones(m))
    level /= np.linalg.norm(level)

    def white(values: np.ndarray) -> np.ndarray:
        """Whitened values (m, ...), mean removed."""
        w = np.linalg.solve(lower, values)
        return w - np.tensordot(level, level @ w, axes=0)

    y = white(residual)
    waves = np.stack([white(np.cos(angle).T), white(np.sin(angle).T)], axis=-1).swapaxes(0, 1)
    normal = waves.swapaxes(1, 2) @ waves
    good = np.linalg.cond(normal) < WORST_CONDITION
    frequency, waves, normal = frequency[good], waves[good], normal[good]
    right = waves.swapaxes(1, 2) @ y
    coefficient = np.linalg.solve(normal, right[..., None])[..., 0]
    share = np.clip(np.sum(coefficient * right, axis=1) / float(y @ y), 0.0, 1.0)
    single = (1.0 - share) ** (0.5 * (m - 3))
    chance = -np.expm1(m * np.log1p(-np.minimum(single, 1.0 - 1e-15)))
    return 1.0 / frequency, np.hypot(*coefficient.T), chance
