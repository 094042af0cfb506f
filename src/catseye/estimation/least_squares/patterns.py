"""Tests of error patterns: what would explain the misfit, how well, and by how much.

A pattern is a change of many observations by one error: a length that all ranges of a night share, three coordinates
of a pillar. Each explanation has one column or a few, and is tested as additional parameters of the model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from catseye.estimation.least_squares.influence import UNSEEN, Influence

LEVEL = 2e-5  # of one explanation's test: of 250 explanations, one good adjustment in 200 shows one


@dataclass(frozen=True, eq=False)
class Patterns:
    """Patterns of several explanations, side by side.

    vectors   (rows, k) change of the stacked observations by one unit of each error; 0 in inactive rows
    first     (h + 1,) first column of each explanation, and k
    rows      of each explanation: observations without which it is nothing; none of one that changes others
    """

    vectors: np.ndarray
    first: np.ndarray
    rows: tuple[np.ndarray, ...] = ()

    @staticmethod
    def of(vectors: Sequence[np.ndarray], count: int, rows: Sequence[np.ndarray] = ()) -> "Patterns":
        """Patterns from one (count, k) array an explanation."""
        counts = [v.shape[1] for v in vectors]
        vector = np.concatenate([np.zeros((count, 0)), *vectors], axis=1)
        return Patterns(vector, np.cumsum([0, *counts]).astype(int), tuple(rows))

    def columns(self, h: int) -> np.ndarray:
        """Columns of one explanation."""
        return np.arange(self.first[h], self.first[h + 1])


@dataclass(frozen=True, eq=False)
class PatternFit:
    """Fit of one explanation.

    gain      decrease of the weighted sum of squares
    degrees   errors that the observations determine
    errors    (k,) estimates; NaN where undetermined
    u         (k,) their standard uncertainties; infinite where undetermined
    covariance   (k, k) of them; zero rows and columns where undetermined
    """

    gain: float
    degrees: int
    errors: np.ndarray
    u: np.ndarray
    covariance: np.ndarray

    def beside(self, allowed: np.ndarray) -> "PatternFit":
        """Fit without the standard uncertainties (k,) that the model allows these errors already."""
        determined = np.isfinite(self.u)
        unshared = self.covariance[np.ix_(determined, determined)] - np.diag(allowed[determined] ** 2)
        values, directions = np.linalg.eigh(unshared)
        used = values > UNSEEN * max(float(values.max(initial=0.0)), 0.0)
        parts = directions[:, used].T @ self.errors[determined] / np.sqrt(values[used])
        return replace(self, gain=float(parts @ parts), degrees=int(np.count_nonzero(used)))

    @property
    def spread(self) -> np.ndarray:
        """Factor (k, k + 1) of the second moments of the errors: the estimates, and a root of their covariance."""
        values, directions = np.linalg.eigh(self.covariance)
        return np.column_stack([np.nan_to_num(self.errors), directions * np.sqrt(np.maximum(values, 0.0))])

    @property
    def score(self) -> float:
        """Gain less the price of errors beyond the first, comparable with the square of a single w."""
        return self.gain - price(self.degrees)

    @property
    def significant(self) -> bool:
        """True where so large a gain is no chance."""
        return self.degrees > 0 and self.score > chdtri(1, LEVEL)


def price(degrees: int) -> float:
    """Gain that errors beyond the first must have, by the same level.

    >>> round(price(3), 1)
    6.3
    """
    return float(chdtri(degrees, LEVEL) - chdtri(1, LEVEL)) if degrees > 1 else 0.0


def record_price(degrees: int) -> float:
    """Gain from which an explanation of so many errors is significant.

    >>> round(record_price(1), 1)
    18.2
    """
    return float(chdtri(max(degrees, 1), LEVEL))


class PatternTests:
    """Gains of explanations beside an adjustment, and as explanations are added one after the other.

    With P_v = P - P A Q A' P and g = P v, patterns C have the normal equations M = C' P_v C, b = C' g: an
    explanation with the columns h gains b_h' M_hh^-1 b_h. Adding it to the model is a step of Cholesky's on M and b.

    Source: [FOERSTNER16] chapter 4 (tests of additional parameters); for a single observation [BAARDA68].
    """

    def __init__(self, influence: Influence, patterns: Patterns):
        """Set up the normal equations.

        influence   of the adjustment, before any row is left out
        """
        self.patterns = patterns
        vectors = patterns.vectors
        self._matrix = vectors.T @ influence.through(vectors).T
        self._right = vectors.T @ influence.weighed
        self._usual = np.sum(vectors**2 * influence.weight[:, None], axis=0)

    def add(self, column: np.ndarray, weighed: float) -> None:
        """Add to the model the error of a row that is left out.

        column    (rows,) of P_v, over the root of its diagonal
        weighed   the row's P v, over the same root
        """
        along = self.patterns.vectors.T @ column
        self._matrix = self._matrix - np.outer(along, along)
        self._right = self._right - along * weighed

    def accept(self, h: int) -> None:
        """Add an explanation to the model."""
        at = self.patterns.columns(h)
        inverse, _ = self._inverse(at)
        across = self._matrix[:, at]
        self._right = self._right - across @ (inverse @ self._right[at])
        self._matrix = self._matrix - across @ inverse @ across.T

    def fit(self, h: int) -> PatternFit:
        """Fit of one explanation beside those accepted."""
        return self.fit_of(self.patterns.columns(h))

    def fit_of(self, at: np.ndarray) -> PatternFit:
        """Fit of some columns together."""
        inverse, degrees = self._inverse(at)
        errors = inverse @ self._right[at]
        u = np.sqrt(np.maximum(np.diag(inverse), 0.0))
        determined = u > 0.0
        return PatternFit(
            gain=float(self._right[at] @ errors),
            degrees=degrees,
            errors=np.where(determined, errors, np.nan),
            u=np.where(determined, u, np.inf),
            covariance=inverse,
        )

    @property
    def fits(self) -> list[PatternFit]:
        """Fits of all explanations."""
        return [self.fit(h) for h in range(len(self.patterns.first) - 1)]

    @property
    def best(self) -> tuple[int, float]:
        """Explanation with the largest score, and the score; 0 where none is significant."""
        scores = [fit.score if fit.significant else 0.0 for fit in self.fits]
        best = int(np.argmax(scores)) if scores else -1
        return best, scores[best] if scores else 0.0

    def _inverse(self, at: np.ndarray) -> tuple[np.ndarray, int]:
        """Pseudo-inverse of a block of the matrix, and its rank.

        Errors that the parameters absorb have zero rows and columns.
        """
        block = self._matrix[np.ix_(at, at)]
        diagonal = np.diag(block)
        estimable = diagonal > UNSEEN * np.maximum(self._usual[at], 1e-300)
        scale = np.where(estimable, 1.0 / np.sqrt(np.where(estimable, diagonal, 1.0)), 0.0)
        values, directions = np.linalg.eigh(block * np.outer(scale, scale))
        used = values > UNSEEN
        inverse = (directions[:, used] / values[used]) @ directions[:, used].T
        return inverse * np.outer(scale, scale), int(np.count_nonzero(used))
