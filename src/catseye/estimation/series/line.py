"""Mean and straight line through independent readings, with the scatter beside the claim."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class LineFit:
    """Straight line through readings: value at the middle of the times, and rate.

    middle      weighted mean of the times; there value and rate are uncorrelated
    value       at the middle
    rate        per unit of time; 0 where all readings are of one time
    u_value, u_rate   standard uncertainties from those of the readings; u_rate infinite without a rate
    pvv         weighted sum of squared residuals
    degrees_of_freedom   readings less 2, or less 1 without a rate
    residual    (n,) reading less line
    """

    middle: float
    value: float
    rate: float
    u_value: float
    u_rate: float
    pvv: float
    degrees_of_freedom: int
    residual: np.ndarray

    @property
    def factor(self) -> float:
        """Scatter over claim, squared: [pvv] over degrees of freedom, expectation 1; nan without any."""
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom > 0 else float("nan")

    @property
    def expansion(self) -> float:
        """Factor of the standard uncertainties where readings scatter more than they claim; 1 or more."""
        return float(np.sqrt(max(1.0, self.factor))) if self.degrees_of_freedom > 0 else 1.0

    def at(self, times: ArrayLike) -> np.ndarray:
        """Values of the line at times."""
        return np.asarray(self.value + self.rate * (np.asarray(times, dtype=float) - self.middle))

    def u_at(self, times: ArrayLike) -> np.ndarray:
        """Standard uncertainties of the line at times, from those of the readings."""
        arm = np.asarray(times, dtype=float) - self.middle
        slope = np.where(arm == 0.0, 0.0, arm * (self.u_rate if np.isfinite(self.u_rate) else 0.0))
        return np.asarray(np.hypot(self.u_value, slope))


def fit_line(times: ArrayLike, values: ArrayLike, u: ArrayLike) -> LineFit:
    """Weighted straight line through independent readings, at least one.

    times    (n,)
    values   (n,)
    u        (n,) above 0, standard uncertainties

    Source: [RAO73] section 4a, two parameters about the weighted mean of the times.

    >>> line = fit_line([0.0, 1.0, 2.0, 3.0], [1.0, 3.0, 5.0, 7.0], [0.1] * 4)
    >>> round(line.rate, 9), round(line.value, 9), round(line.u_rate, 6), line.degrees_of_freedom
    (2.0, 4.0, 0.044721, 2)
    """
    t, y, w = np.asarray(times, float), np.asarray(values, float), 1.0 / np.square(np.asarray(u, float))
    total = float(w.sum())
    middle, value = float(w @ t) / total, float(w @ y) / total
    arm = t - middle
    spread = float(w @ arm**2)
    sloped = len(t) > 1 and bool(np.ptp(t) > 0.0)
    rate = float(w @ (arm * (y - value))) / spread if sloped else 0.0
    residual = y - value - rate * arm
    return LineFit(
        middle=middle,
        value=value,
        rate=rate,
        u_value=float(total**-0.5),
        u_rate=float(spread**-0.5) if sloped else float("inf"),
        pvv=float(w @ residual**2),
        degrees_of_freedom=len(t) - (2 if sloped else 1),
        residual=residual,
    )


def without_prior(
    value: ArrayLike, u: ArrayLike, prior: ArrayLike, u_prior: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and standard uncertainty of a parameter with its own prior taken out; nan where that left nothing.

    value, u         (n,) estimate that the prior took part in
    prior, u_prior   (n,) value of the prior, independent of all else

    What is left is what the other observations say: estimates of several nights share their prior, and only without
    it are they independent. Exact in a linear adjustment, as the estimate's information is the sum of both.

    Source: [RAO73] section 4a: inverse variances of independent estimates add up.

    >>> estimate, u = without_prior([0.5], [0.5**0.5], [0.0], [1.0])
    >>> estimate.round(6).tolist(), u.round(6).tolist()
    ([1.0], [1.0])
    """
    x, p = np.asarray(value, float), np.asarray(prior, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        all_of_it, of_prior = np.asarray(u, float) ** -2.0, np.asarray(u_prior, float) ** -2.0
        left = all_of_it - of_prior
        enough = left > LEAST * all_of_it  # else rounding and other priors decide; False for nan
        estimate = (all_of_it * x - of_prior * p) / left
        return np.where(enough, estimate, np.nan), np.where(enough, left**-0.5, np.nan)


LEAST = 1e-6  # of an estimate's information, that is not its prior's: less is rounding
