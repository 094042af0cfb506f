"""Variance components: by group, or as a constant and a distance-dependent part.

Restricted maximum likelihood, its estimating equations exact: for each component k with C = sum of theta_k Q_k,
v' C^-1 Q_k C^-1 v = tr(P_v Q_k). For one factor a group this is [pvv]_k = r_k, Foerstner's fixed point (and Helmert's
strict solution); for rows it needs v, sigma and the redundancy numbers alone.

The engine is one function: `solve(scale)` adjusts with the claimed sigma of each observation multiplied by its scale
(one (m,) array a group, any positive number; within a correlated group one number, for its whole covariance) and
returns one `GroupFit` a group, whose `pvv` and `redundancy` belong to the scaled sigmas and whose `residual` is plain.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome, Status

Scaled = Callable[[Sequence[np.ndarray]], Sequence[GroupFit]]

NOT_CONVERGED = "{name} still moved by {step:.2g} of its standard uncertainty after {iterations} iterations"
INSEPARABLE = "{names} have the same effect on the observations; hold one, or observe over other distances"
LEAST_REDUNDANCY = 1e-6  # sum of redundancy numbers below which a component shows in no residual
STEP = 1e-3  # relative change of a variance in the derivative of the redundancies: its square is lost
WORST_CONDITION = 1e-5  # of the information scaled to a unit diagonal; the derivative is good to 1e-6


class VarianceModel(Protocol):
    """Protocol of a variance model with K components.

    names                  of the components
    start                  (K,) values, all positive or zero
    scales(theta)          argument of `solve`
    equations(fits, theta) observed (K,) v' C^-1 Q_k C^-1 v, expected (K,) tr(P_v Q_k), and bound (K, K), not less
                           than twice the information: sum over the rows of r q_k q_l / sigma^4
    """

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def start(self) -> np.ndarray: ...
    def scales(self, theta: np.ndarray) -> list[np.ndarray]: ...
    def equations(self, fits: Sequence[GroupFit], theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class GroupFactors:
    """One factor on the claimed covariance of each set of groups, correlated or not.

    groups    names of all groups, in the engine's order
    sizes     number of observations per group
    members   (groups,) index of the factor, -1 for groups taken as claimed; by default one factor per group
    """

    groups: tuple[str, ...]
    sizes: tuple[int, ...]
    members: tuple[int, ...] | None = None

    @property
    def _member(self) -> np.ndarray:
        return np.arange(len(self.groups)) if self.members is None else np.asarray(self.members)

    @property
    def names(self) -> tuple[str, ...]:
        sets: list[list[str]] = [[] for _ in range(int(self._member.max(initial=-1)) + 1)]
        for name, k in zip(self.groups, self._member, strict=True):
            if k >= 0:
                sets[k].append(name)
        return tuple("variance factor of " + ", ".join(s) for s in sets)

    @property
    def start(self) -> np.ndarray:
        return np.ones(len(self.names))

    def scales(self, theta: np.ndarray) -> list[np.ndarray]:
        if not np.all(theta > 0.0):
            raise EstimationError(
                f"{self.names[int(np.argmin(theta))]} is zero: all residuals are zero (already adjusted?)"
            )
        factor = np.append(theta, 1.0)[self._member]
        return [np.full(m, np.sqrt(f)) for m, f in zip(self.sizes, factor, strict=True)]

    def equations(self, fits: Sequence[GroupFit], theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        observed, expected = np.zeros(len(theta)), np.zeros(len(theta))
        for fit, k in zip(fits, self._member, strict=True):
            if k >= 0:
                observed[k] += fit.pvv / theta[k]
                expected[k] += np.sum(fit.redundancy[fit.active]) / theta[k]
        return observed, expected, np.diag(expected / theta)


@dataclass(frozen=True, eq=False)
class RowModel:
    """Variances of independent observations per row: fixed + cofactors @ theta.

    names       of the K components
    sigmas      one (m,) array a group: the claimed standard uncertainties that the engine scales
    cofactors   one (m, w) array a group, not negative
    columns     one (w,) array per group: component indices of its cofactors; empty for a group taken as claimed
    start       (K,) first values, in the unit that makes cofactors @ theta a variance
    fixed       one (m,) array a group: part of the variance that is known; default zero
    """

    names: tuple[str, ...]
    sigmas: tuple[np.ndarray, ...]
    cofactors: tuple[np.ndarray, ...]
    columns: tuple[np.ndarray, ...]
    start: np.ndarray
    fixed: tuple[np.ndarray, ...] | None = None

    def variances(self, theta: np.ndarray) -> list[np.ndarray]:
        """Variances (m,) of each group; raises EstimationError if one is zero."""
        fixed = [np.zeros(len(s)) for s in self.sigmas] if self.fixed is None else self.fixed
        variances = [f + q @ theta[c] for f, q, c in zip(fixed, self.cofactors, self.columns, strict=True)]
        for i, variance in enumerate(variances):
            if not np.all(variance > 0.0):
                raise EstimationError(
                    f"group {i}, observation {int(np.argmin(variance))}: its variance is {variance.min():.3g} with "
                    f"{', '.join(self.names)} at {theta}; give it a fixed part"
                )
        return variances

    def scales(self, theta: np.ndarray) -> list[np.ndarray]:
        return [np.sqrt(v) / s for v, s in zip(self.variances(theta), self.sigmas, strict=True)]

    def equations(self, fits: Sequence[GroupFit], theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = len(theta)
        observed, expected, bound = np.zeros(k), np.zeros(k), np.zeros((k, k))
        for fit, q, at, variance in zip(fits, self.cofactors, self.columns, self.variances(theta), strict=True):
            on = fit.active
            squares = np.square(fit.residual[on]) / variance[on]
            if len(at) and abs(squares.sum() - fit.pvv) > 1e-6 * max(fit.pvv, 1e-12):
                raise EstimationError(
                    f"{fit.name}: [pvv] is {fit.pvv:.6g}, of independent rows {squares.sum():.6g}: its observations "
                    "are correlated; give it one factor (GroupFactors), or the engine did not scale its sigmas"
                )
            slope = q[on] / variance[on, None]
            observed[at] += slope.T @ squares
            expected[at] += slope.T @ fit.redundancy[on]
            bound[np.ix_(at, at)] += slope.T @ (slope * fit.redundancy[on, None])
        return observed, expected, bound


@dataclass(frozen=True, eq=False)
class Components:
    """Estimated variance components.

    names        of the K components
    values       (K,) not negative
    covariance   (K, K) the inverse of the expected information; nan if components are not separable
    at_zero      (K,) True: constrained to zero, because a negative value would fit better
    status       "converged", or one line
    iterations   steps taken
    fits         with the sigmas of these components
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    at_zero: np.ndarray
    status: Status
    iterations: int
    fits: tuple[GroupFit, ...]

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (K,) of the values."""
        return np.sqrt(np.diag(self.covariance))

    def roots(self) -> tuple[np.ndarray, np.ndarray]:
        """Roots (K,) of the components, such as a and b, and their standard uncertainties.

        The uncertainties are infinite at zero.
        """
        roots = np.sqrt(self.values)
        with np.errstate(divide="ignore"):
            return roots, self.u / (2.0 * roots)

    def require_converged(self) -> "Components":
        """Return these components, or raise EstimationError with their status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self


def variance_components(
    solve: Scaled, model: VarianceModel, *, iterations: int = 100, tolerance: float = 1e-4
) -> Components:
    """Non-negative restricted maximum likelihood estimate of variance components.

    solve        the engine, see the top of this file
    model        `GroupFactors`, or a `RowModel`
    iterations   limit
    tolerance    step, in standard uncertainties of each component, that ends the iteration

    Each step is a regression of squared residuals on the cofactors with weights r / sigma^4, which for one factor a
    group is Foerstner's. It uses an upper bound of the information, so its steps are short, and ends
    where the exact equations hold. The information itself is the derivative of the expected squares,
    tr(P_v Q_k), by each component, taken numerically: two solutions a component at the end.
    Raises EstimationError for a component that affects no residual.

    Source: [FOERSTNER79]; [PATTERSON71] (restricted likelihood and its information).
    """
    theta, step = np.array(model.start, dtype=float), np.full(len(model.start), np.inf)
    steps, share, before = 0, 1.0, np.zeros(len(theta))
    while steps < iterations:
        fits = tuple(solve(model.scales(theta)))
        observed, expected, bound = model.equations(fits, theta)
        _require_redundancy(model.names, expected, bound)
        if steps and step.max() < tolerance:
            break
        steps += 1
        new = _least_squares_not_negative(bound, bound @ theta + observed - expected)
        step = np.abs(new - theta) * np.sqrt(0.5 * np.diag(bound))
        # the data may contain more information than expected: an oscillating step is halved
        share = max(0.5 * share, 0.25) if before @ bound @ (new - theta) < 0.0 else min(1.5 * share, 1.0)
        before = new - theta
        theta = np.where(new > 0.0, theta + share * before, 0.0)
    covariance, inseparable = _inverse_information(solve, model, theta, STEP * expected / np.diag(bound))
    status = CONVERGED
    if step.max() >= tolerance:
        worst = int(np.argmax(step))
        detail = NOT_CONVERGED.format(name=model.names[worst], step=step[worst], iterations=steps)
        status = Status(AdjustmentOutcome.NOT_CONVERGED, detail)
        fits = tuple(solve(model.scales(theta)))
    if inseparable:
        names = ", ".join(model.names[k] for k in inseparable)
        status = Status(AdjustmentOutcome.INSEPARABLE, INSEPARABLE.format(names=names))
    return Components(
        names=model.names,
        values=theta,
        covariance=covariance,
        at_zero=theta == 0.0,
        status=status,
        iterations=steps,
        fits=fits,
    )


def _require_redundancy(names: Sequence[str], expected: np.ndarray, bound: np.ndarray) -> None:
    """Raise EstimationError for a component whose observations have no redundancy."""
    share = np.divide(expected**2, np.diag(bound), out=np.zeros(len(names)), where=np.diag(bound) > 0.0)
    if np.any(share < LEAST_REDUNDANCY):
        k = int(np.argmin(share))
        raise EstimationError(
            f"{names[k]} affects no residual: its observations have redundancy {share[k]:.2g} together; "
            "hold it, or join it with another group"
        )


def _least_squares_not_negative(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Minimum of x' N x / 2 - right' x with non-negative x."""
    from scipy.optimize import nnls

    scale = 1.0 / np.sqrt(np.diag(normal))
    scaled, goal = normal * scale[:, None] * scale, right * scale
    free = np.linalg.lstsq(scaled, goal, rcond=WORST_CONDITION)[0]
    if np.all(free >= 0.0):
        return free * scale
    values, vectors = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(values, WORST_CONDITION * values[-1]))
    return nnls(root[:, None] * vectors.T, (vectors.T @ goal) / root)[0] * scale


def _inverse_information(
    solve: Scaled, model: VarianceModel, theta: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, list[int]]:
    """Covariance of the components, and indices of inseparable ones.

    `size` (K,) is the step of each.

    d tr(P_v Q_k) / d theta_l = -tr(P_v Q_k P_v Q_l), twice the information with the sign turned.
    """
    count = len(theta)
    information = np.empty((count, count))
    for k in range(count):
        ends = np.array([theta, theta])
        ends[:, k] = [max(theta[k] - size[k], 0.0), theta[k] + size[k]]
        low, high = (model.equations(solve(model.scales(t)), t)[1] for t in ends)
        information[k] = -0.5 * (high - low) / (ends[1, k] - ends[0, k])
    information = 0.5 * (information + information.T)
    scale = 1.0 / np.sqrt(np.abs(np.diag(information)))
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    if values[0] < WORST_CONDITION:
        return np.full((count, count), np.nan), np.flatnonzero(np.abs(vectors[:, 0]) > 0.1).tolist()
    return (vectors / values @ vectors.T) * scale[:, None] * scale, []
