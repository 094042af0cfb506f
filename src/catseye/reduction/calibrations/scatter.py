"""Restricted maximum likelihood of one or two variances of scatter."""

from collections.abc import Sequence

import numpy as np

from catseye.errors import EstimationError

ROUNDS = 100
STEP = 1e-8  # relative change of every variance at which the search ends
ROUNDING = 1e-13  # of the largest value: what remains of readings that are all the same
NEGLIGIBLE = 1e-12  # of the total variance: a component below it is none


def restricted_likelihood(
    observed: np.ndarray,
    design: np.ndarray,
    components: Sequence[np.ndarray],
    *,
    claimed: np.ndarray,
    size: float = 0.0,
) -> np.ndarray:
    """Variance factors (k,) of covariance components, none below zero.

    observed     (m,)
    design       (m, p) derivatives by the parameters of the mean
    components   k matrices Q (m, m); the first must be of full rank
    claimed      (m, m) the part of the covariance that is known
    size         of the numbers that `observed` are differences of, for their rounding

    C = claimed + sum of theta_k Q_k; with P the projection C^-1 - C^-1 A (A' C^-1 A)^-1 A' C^-1 the estimate solves
    y' P Q_k P y = tr(P Q_k) for each k, by Fisher scoring with halved steps. Unbiased for one component of white noise.
    Raises EstimationError where nothing is redundant, where readings (or those of each group) agree to the last digit,
    or where the search does not end.

    Source: [PATTERSON71] (restricted maximum likelihood and its information).

    >>> y = np.array([1.0, 2.0, 4.0, 5.0])
    >>> float(restricted_likelihood(y, np.ones((4, 1)), [np.eye(4)], claimed=np.zeros((4, 4)))[0].round(6))
    3.333333
    """
    m, p = design.shape
    if m <= p:
        raise EstimationError(
            f"{m} values for {p} parameters show no scatter; read more, or state the scatter's standard uncertainty"
        )
    # Rows of the null space of A' turn the restricted likelihood into a plain one.
    basis = np.linalg.qr(design, mode="complete")[0][:, np.linalg.matrix_rank(design) :].T
    z = basis @ observed
    parts = [basis @ q @ basis.T for q in components]
    claimed_part = basis @ claimed @ basis.T
    total = float(z @ z) / len(z)
    if np.sqrt(total) <= ROUNDING * max(size, float(np.max(np.abs(observed)))):
        raise EstimationError("the readings do not scatter at all; state the scatter's standard uncertainty")
    theta = np.array([total / len(parts) / max(np.trace(q) / len(z), 1e-300) for q in parts])
    floor = NEGLIGIBLE * theta
    value = _likelihood(z, parts, claimed_part, theta)
    for _ in range(ROUNDS):
        step = _score_step(z, parts, claimed_part, theta, floor)
        for halving in range(30):
            trial = np.maximum(theta + step * 0.5**halving, floor)
            better = _likelihood(z, parts, claimed_part, trial)
            if better >= value - 1e-12 * abs(value):
                break
        moved = np.abs(trial - theta)
        theta, value = trial, better
        if np.all(moved <= STEP * np.maximum(theta, floor)):
            if len(theta) > 1 and theta[0] <= 2.0 * floor[0] and np.linalg.matrix_rank(claimed_part) < len(z):
                raise EstimationError(
                    "readings of one group agree to the last digit, only groups differ; state the standard uncertainty "
                    "of one reading (that of its last digit at least)"
                )
            return np.where(theta <= 2.0 * floor, 0.0, theta) if len(theta) > 1 else theta
    raise EstimationError("the scatter of the readings was not found: state its standard uncertainty in the sheet")


def _likelihood(z: np.ndarray, parts: Sequence[np.ndarray], claimed_part: np.ndarray, theta: np.ndarray) -> float:
    covariance = claimed_part + sum(t * q for t, q in zip(theta, parts, strict=True))
    try:
        lower = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return -np.inf
    return float(-np.sum(np.log(np.diag(lower))) - 0.5 * np.sum(np.linalg.solve(lower, z) ** 2))


def _score_step(
    z: np.ndarray, parts: Sequence[np.ndarray], claimed_part: np.ndarray, theta: np.ndarray, floor: np.ndarray
) -> np.ndarray:
    """Step of Fisher scoring.

    A component at zero with a negative score stays there.
    """
    weight = np.linalg.inv(claimed_part + sum(t * q for t, q in zip(theta, parts, strict=True)))
    pulled = [weight @ q for q in parts]
    score = np.array([z @ w @ weight @ z - np.trace(w) for w in pulled])
    free = ~((theta <= 2.0 * floor) & (score < 0.0))
    step = np.zeros(len(theta))
    if free.any():
        information = np.array([[np.sum(a * b.T) for b in pulled] for a in pulled])
        step[free] = np.linalg.solve(information[np.ix_(free, free)], score[free])
    return step


def effective_degrees(design: np.ndarray, components: Sequence[np.ndarray], covariance: np.ndarray) -> np.ndarray:
    """Degrees of freedom (p,) of each parameter's variance.

    Where the components were estimated.

    design       (m, p)
    components   k matrices Q (m, m) whose factors were estimated
    covariance   (m, m) with these factors

    The variance of a parameter is a function of the factors; nu = 2 variance^2 / var(variance), the factors' own
    covariance being twice the inverse of tr(P Q_k P Q_l). With one component of white noise it is m - p exactly.

    Source: [JCGM100] annex G.4 (Welch and Satterthwaite's formula, here with correlated components).

    >>> effective_degrees(np.ones((4, 1)), [np.eye(4)], np.eye(4)).round(9)
    array([3.])
    """
    weight = np.linalg.inv(covariance)
    inverse = np.linalg.inv(design.T @ weight @ design)
    gain = inverse @ design.T @ weight
    information = variance_information(design, components, covariance)
    slope = np.stack([np.einsum("pi,ij,pj->p", gain, q, gain) for q in components])
    spread = 2.0 * np.einsum("kp,kl,lp->p", slope, np.linalg.pinv(information), slope)
    with np.errstate(divide="ignore"):  # a parameter that no estimated factor touches: infinite degrees
        return 2.0 * np.diag(inverse) ** 2 / spread


def variance_information(design: np.ndarray, components: Sequence[np.ndarray], covariance: np.ndarray) -> np.ndarray:
    """Matrix (k, k) of tr(P Q_k P Q_l): twice its inverse is the factors' covariance.

    design       (m, p)
    components   k matrices Q (m, m) whose factors were estimated
    covariance   (m, m) with these factors

    Source: [PATTERSON71] (information of restricted maximum likelihood).
    """
    weight = np.linalg.inv(covariance)
    projection = weight - weight @ design @ np.linalg.solve(design.T @ weight @ design, design.T @ weight)
    pulled = [projection @ q for q in components]
    return np.array([[np.sum(a * b.T) for b in pulled] for a in pulled])
