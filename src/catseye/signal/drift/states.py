"""Walk of the electronics between reference shots as hidden states.

Errors shared by shots become columns.

`drift_at` gives the full covariance matrix of the walk's errors at m shots. Here the same errors are sums of a few
parameters each, and an independent remainder of each shot: the walk at the reference shots on either side, and the
strongest modes of the bridge between them.
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class DriftStates:
    """Phase errors at m shots: shared states plus independent remainder.

    The errors are sum of slopes * states[columns], plus the remainder.

    columns         (m, w) states of each shot, -1 for none
    slopes          (m, w) rad a unit
    own             (m,) rad^2, variance of the remainder
    prior_columns   (s, 2), -1 for none, and
    prior_slopes    (s, 2): s independent combinations of the states with mean 0 and variance 1, their complete
                    prior
    strength        of the last states, the bridges' modes: variance over the shots' noise
    neglected       strength of the strongest mode moved to the remainder
    """

    columns: np.ndarray
    slopes: np.ndarray
    own: np.ndarray
    prior_columns: np.ndarray
    prior_slopes: np.ndarray
    strength: np.ndarray
    neglected: float = 0.0

    @property
    def count(self) -> int:
        """Number s of states of a ranger."""
        return len(self.prior_columns)

    def without(self, weak: float) -> "DriftStates":
        """Move modes up to this strength to the independent errors.

        Their variance counts, their correlation does not.

        weak   0 keeps all
        """
        first = self.count - len(self.strength)
        retained = np.concatenate([np.ones(first, dtype=bool), self.strength > weak])
        if retained.all():
            return self
        number = np.append(np.where(retained, np.cumsum(retained) - 1, -1), -1)
        dropped = (self.columns >= 0) & ~np.append(retained, True)[self.columns]
        columns = number[self.columns]
        order = np.argsort(columns[:, 2:] < 0, axis=1, kind="stable") + 2  # retained columns first
        width = int((columns[:, 2:] >= 0).sum(axis=1).max(initial=0))
        order = np.concatenate([np.broadcast_to([0, 1], (len(columns), 2)), order[:, :width]], axis=1)
        return DriftStates(
            columns=np.take_along_axis(columns, order, axis=1),
            slopes=np.take_along_axis(np.where(dropped, 0.0, self.slopes), order, axis=1),
            own=self.own + np.sum(np.where(dropped, self.slopes, 0.0) ** 2, axis=1),
            prior_columns=np.where(self.prior_columns < 0, -1, number[self.prior_columns])[retained],
            prior_slopes=self.prior_slopes[retained],
            strength=self.strength[retained[first:]],
            neglected=float(self.strength[~retained[first:]].max()),
        )

    def of(self, keep: np.ndarray) -> "DriftStates":
        """States of selected shots, (m,) bool."""
        return replace(self, columns=self.columns[keep], slopes=self.slopes[keep], own=self.own[keep])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (m, m) of the errors, rad^2.

        For some thousands of shots at most.
        """
        s, m = self.count, len(self.own)
        prior, design = np.zeros((s, s + 1)), np.zeros((m, s + 1))
        np.add.at(prior, (np.arange(s)[:, None], self.prior_columns), self.prior_slopes)
        np.add.at(design, (np.arange(m)[:, None], self.columns), self.slopes)
        root = np.linalg.solve(prior[:, :s], np.eye(s))
        spread = design[:, :s] @ root
        return np.diag(self.own) + spread @ spread.T


def drift_states(
    reference_time: np.ndarray,
    reference_variance: np.ndarray,
    *,
    time: np.ndarray,
    random_walk: float,
    noise: np.ndarray,
) -> DriftStates:
    """Errors of `drift_at`'s phases as states; exact (`DriftStates.without` reduces them).

    reference_time      (r,) s, any order, at least one
    reference_variance  (r,) rad^2, of the reference phases themselves
    time                (m,) s
    random_walk         growth of the drift, rad per square root of a second
    noise               (m,) rad^2, above 0, independent noise of each shot

    Given its two ends, a walk between them is a straight line and a bridge, independent of all other bridges: variance
    q (t - a)(b - t) / (b - a), which falls off with the square of a mode's number. Before the first reference and after
    the last it is a walk starting there. The ends given the references are a chain of states with a tridiagonal
    precision, here the two diagonals of its Cholesky factor.

    Source: conditioning of a Wiener process, as `drift_at`; Karhunen-Loeve expansion of the bridge, computed
    numerically at the shots.

    >>> one = drift_states(np.array([0.0, 100.0]), np.full(2, 1e-12), time=np.array([50.0]), random_walk=1e-4,
    ...                    noise=np.ones(1))
    >>> f"{one.covariance[0, 0]:.3e}"
    '2.500e-07'
    """
    knot, variance = _knots(np.asarray(reference_time, float), np.asarray(reference_variance, float), random_walk)
    t, noise, q = np.asarray(time, dtype=float), np.asarray(noise, dtype=float), random_walk**2
    r, m = len(knot), len(t)
    prior_columns, prior_slopes = _chain(knot, variance, q)
    preceding = np.searchsorted(knot, t, side="right") - 1
    lower, upper = np.maximum(preceding, 0), np.minimum(preceding + 1, r - 1)
    span = np.where(upper > lower, knot[upper] - knot[lower], 1.0)
    share = np.where(upper > lower, (t - knot[lower]) / span, 0.0)
    columns = [np.stack([lower, np.where((upper > lower) & (share > 0.0), upper, -1)], axis=1)]
    slopes = [np.stack([1.0 - share, share], axis=1)]
    states = r
    strength: list[np.ndarray] = []
    modes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    order = np.argsort(preceding, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(preceding[order])) + 1) if m else []:
        at = int(preceding[rows[0]])
        bridge = q * _bridge(t[rows], knot, at)
        root = np.sqrt(noise[rows])
        values, vectors = np.linalg.eigh(bridge / root[:, None] / root)
        significant = values > 1e-12 * values[-1]
        loading = (root[:, None] * vectors[:, significant] * np.sqrt(values[significant]))[:, ::-1]
        strength.append(values[significant][::-1])
        modes.append((rows, states + np.arange(significant.sum()), loading))
        states += int(significant.sum())
    width = max((len(own_columns) for _, own_columns, _ in modes), default=0)
    mode_columns, mode_slopes = np.full((m, width), -1), np.zeros((m, width))
    for rows, own_columns, loading in modes:
        mode_columns[rows[:, None], np.arange(len(own_columns))] = own_columns
        mode_slopes[rows[:, None], np.arange(len(own_columns))] = loading
    fresh = np.arange(r, states)
    return DriftStates(
        columns=np.concatenate([*columns, mode_columns], axis=1),
        slopes=np.concatenate([*slopes, mode_slopes], axis=1),
        own=np.zeros(m),
        prior_columns=np.concatenate([prior_columns, np.stack([fresh, np.full(len(fresh), -1)], axis=1)]),
        prior_slopes=np.concatenate([prior_slopes, np.stack([np.ones(len(fresh)), np.zeros(len(fresh))], axis=1)]),
        strength=np.concatenate([np.zeros(0), *strength]),
    )


def _knots(time: np.ndarray, variance: np.ndarray, random_walk: float) -> tuple[np.ndarray, np.ndarray]:
    """Sorted distinct reference times, and variances with `drift_at`'s floor."""
    scale = float(np.mean(variance + random_walk**2 * (time - time.min())))
    weight = 1.0 / (variance + 1e-12 * max(scale, random_walk**2, 1e-30))
    knot, which = np.unique(time, return_inverse=True)
    return knot, 1.0 / np.bincount(which, weight)


def _chain(knot: np.ndarray, variance: np.ndarray, q: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns and slopes (r, 2) of independent combinations of states.

    The states are the walk at the references.
    """
    r = len(knot)
    step = np.maximum(q * np.diff(knot), 1e-6 * variance.min())  # without a walk the ends are equal
    diagonal = 1.0 / variance
    diagonal[:-1] += 1.0 / step
    diagonal[1:] += 1.0 / step
    factor, below = np.empty(r), np.zeros(r)
    for k in range(r):
        factor[k] = np.sqrt(diagonal[k] - (below[k - 1] ** 2 if k else 0.0))
        if k < r - 1:
            below[k] = -1.0 / step[k] / factor[k]
    following = np.append(np.arange(1, r), -1)
    return np.stack([np.arange(r), following], axis=1), np.stack([factor, below], axis=1)


def _bridge(t: np.ndarray, knot: np.ndarray, at: int) -> np.ndarray:
    """Bridge covariance (g, g) over q, s, at times t beyond knot `at`, given its ends; -1: before the first."""
    if at < 0:
        return np.minimum(knot[0] - t[:, None], knot[0] - t)
    s = t - knot[at]
    free = np.minimum(s[:, None], s)
    return free if at == len(knot) - 1 else free - np.outer(s, s) / (knot[at + 1] - knot[at])
