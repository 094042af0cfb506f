"""Uncertainty budget of a calibrated quantity: contributions, effective degrees of freedom, coverage factor."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

COVERAGE = 0.9545  # probability of an expanded uncertainty, that of two normal standard deviations
NEGLIGIBLE = 1e-4  # of u: a smaller contribution changes the sum by 1e-8 at most
UNSTATED = "normal (assumed)"  # a sheet's u comes without a distribution
NORMAL = "normal"
SCATTER = "Student's t"
ROUNDING = 1e15  # degrees of freedom beyond which the estimated part is rounding of the other


class Contribution(NamedTuple):
    """One input's part of a standard uncertainty.

    source        of the uncertainty
    u             standard uncertainty of the input, in its unit
    unit          of the input
    evaluation    A by statistics of the readings, B by other knowledge
    distribution  of the input
    degrees       of freedom of u
    sensitivity   of the quantity by the input, in their units
    """

    source: str
    u: float
    unit: str
    evaluation: Literal["A", "B"]
    distribution: str
    degrees: float
    sensitivity: float

    @property
    def part(self) -> float:
        """Contribution to the standard uncertainty, in the quantity's unit."""
        return abs(self.sensitivity) * self.u


@dataclass(frozen=True, eq=False)
class SharedInput:
    """Input that moves n quantities.

    source       of the uncertainty
    u            standard uncertainty, in its unit; (n,) where each quantity has its own, in its own unit
    unit         of it; empty: that of each quantity
    slopes       (n,) derivatives of the quantities, in their units
    evaluation, distribution, degrees   as of a Contribution
    """

    source: str
    u: float | np.ndarray
    unit: str
    slopes: np.ndarray
    evaluation: Literal["A", "B"] = "B"
    distribution: str = UNSTATED
    degrees: float = np.inf

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (n, n) of the quantities by this input alone; by one u all are moved together."""
        return float(self.u) ** 2 * np.outer(self.slopes, self.slopes)

    def contribution(self, number: int, unit: str) -> Contribution:
        """Contribution to one quantity, by its number and unit."""
        return Contribution(
            self.source,
            float(np.broadcast_to(self.u, len(self.slopes))[number]),
            self.unit or unit,
            self.evaluation,
            self.distribution,
            self.degrees,
            float(self.slopes[number]),
        )


@dataclass(frozen=True, eq=False)
class CovarianceParts:
    """Covariance of p free parameters and q effects by its causes, which add up.

    effects      names (q,), u (q,) and units (q,) of the effects' priors
    covariance   (p + q, p + q) of all
    claimed      part of it by the claimed scatter
    estimated    component of estimated scatter -> part of the covariance by a variance of one
    variances    (k,) estimated, of each component
    information  (k, k) of these variances
    """

    effects: tuple[str, ...]
    u: np.ndarray
    units: tuple[str, ...]
    covariance: np.ndarray
    claimed: np.ndarray
    estimated: dict[str, np.ndarray] = field(default_factory=dict)
    variances: np.ndarray = field(default_factory=lambda: np.zeros(0))
    information: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def contributions(self, slope: np.ndarray, unit: str) -> list[Contribution]:
        """Contributions to a linear combination.

        slope   (p,) or (p + q,) derivatives by the parameters
        unit    of the combination; scatter is told in it
        """
        full = np.zeros(len(self.covariance))
        full[: len(slope)] = slope
        rows = self._by_scatter(full, unit)
        first = len(full) - len(self.effects)
        for k, (name, u, input_unit) in enumerate(zip(self.effects, self.u, self.units, strict=True)):
            sensitivity = float(full @ self.covariance[:, first + k]) / float(u) ** 2
            rows.append(Contribution(name, float(u), input_unit, "B", UNSTATED, np.inf, sensitivity))
        return rows

    def _by_scatter(self, slope: np.ndarray, unit: str) -> list[Contribution]:
        """Claimed scatter, then the estimated components as one: their estimates are correlated."""
        rows = []
        claimed = float(np.sqrt(max(slope @ self.claimed @ slope, 0.0)))
        if claimed > 0.0:
            rows.append(Contribution("scatter as stated", claimed, unit, "B", UNSTATED, np.inf, 1.0))
        if not self.estimated:
            return rows
        by_variance = np.array([float(slope @ part @ slope) for part in self.estimated.values()])
        variance = max(float(by_variance @ self.variances), 0.0)
        spread = 2.0 * float(by_variance @ np.linalg.pinv(self.information) @ by_variance)
        touched = variance**2 > 0.0 and spread > 0.0  # else the square underflows, and nothing is contributed
        degrees = 2.0 * variance**2 / spread if touched else np.inf
        name = " and ".join(self.estimated)
        rows.append(Contribution(name, float(np.sqrt(variance)), unit, "A", SCATTER, degrees, 1.0))
        return rows


def significant(rows: Sequence[Contribution]) -> tuple[Contribution, ...]:
    """Contributions that are not negligible beside the largest."""
    largest = max((row.part for row in rows), default=0.0)
    return tuple(row for row in rows if row.part > NEGLIGIBLE * largest)


def combined(rows: Sequence[Contribution]) -> float:
    """Combined standard uncertainty of independent contributions.

    Source: [JCGM100] eq. 10.
    """
    return float(np.sqrt(sum(row.part**2 for row in rows)))


def welch_satterthwaite(rows: Sequence[Contribution]) -> float:
    """Effective degrees of freedom of a combined standard uncertainty.

    Source: [JCGM100] eq. G.2b.

    >>> few = Contribution("readings", 3.0, "mm", "A", SCATTER, 4.0, 1.0)
    >>> many = Contribution("gauge", 4.0, "mm", "B", NORMAL, float("inf"), 1.0)
    >>> round(welch_satterthwaite([few, many]), 3)
    30.864
    """
    total = combined(rows)
    weighed = sum(row.part**4 / row.degrees for row in rows)
    degrees = float(total**4 / weighed) if weighed > 0.0 else float("inf")
    return degrees if degrees < ROUNDING else float("inf")
