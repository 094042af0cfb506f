"""Uncertainty budget of one result from its inputs, and its check by Monte Carlo.

A model is a function of an array (n, k) of inputs, one row per evaluation, that returns (n,) results. The budget is
first order: it needs the derivatives of the model at the best values. The Monte Carlo needs no derivatives and includes
nonlinearity; if the two disagree the Monte Carlo is right.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import ValidityError

Model = Callable[[np.ndarray], np.ndarray]
Draw = Callable[[np.random.Generator, int], np.ndarray]

BATCH = 20_000  # draws per batch
SAMPLERS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {  # mean 0, standard deviation 1
    "normal": lambda g, n: g.standard_normal(n),
    "rectangular": lambda g, n: g.uniform(-np.sqrt(3.0), np.sqrt(3.0), n),
    "triangular": lambda g, n: g.triangular(-np.sqrt(6.0), 0.0, np.sqrt(6.0), n),
    "arcsine": lambda g, n: np.sqrt(2.0) * np.sin(g.uniform(0.0, 2.0 * np.pi, n)),
}
STUDENT = "t"  # a mean of few readings: u is its scale; needs degrees of freedom


@dataclass(frozen=True)
class Input:
    """One input of a model.

    name                 unique, for reports
    value                best value, in its own unit
    u                    standard uncertainty, at least 0, same unit; the scale of a t distribution
    distribution         "normal", "rectangular", "triangular", "arcsine" or "t"
    degrees_of_freedom   of u; infinite if u is not an estimate
    """

    name: str
    value: float
    u: float
    distribution: str = "normal"
    degrees_of_freedom: float = float("inf")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.value) and np.isfinite(self.u) and self.u >= 0.0):
            raise ValidityError(f"input {self.name!r}: value {self.value}, u {self.u} (expected finite, u 0 or more)")
        if self.distribution not in (*SAMPLERS, STUDENT):
            distributions = ", ".join((*SAMPLERS, STUDENT))
            raise ValidityError(
                f"input {self.name!r}: distribution {self.distribution!r} (expected one of {distributions})"
            )
        degrees = self.degrees_of_freedom
        if not degrees > 0.0 or (self.distribution == STUDENT and np.isinf(degrees)):
            expected = "above 0, and finite for a t distribution"
            raise ValidityError(f"input {self.name!r}: {degrees} degrees of freedom (expected {expected})")


@dataclass(frozen=True, eq=False)
class Budget:
    """Uncertainty of one result, input by input, in the result's unit unless stated.

    inputs               k of them
    sensitivity          (k,) slope of the result by each input, result's unit over input's
    correlation          (k, k) of the inputs
    value, u             of the result
    contribution         (k,) sensitivity times u of the input, with its sign
    share                (k,) of u squared; they sum to 1, and may be negative with correlation
    degrees_of_freedom   effective, of u
    probability          of the coverage interval
    coverage_factor      k_p of that probability
    expanded             coverage factor times u
    """

    inputs: tuple[Input, ...]
    sensitivity: np.ndarray
    correlation: np.ndarray
    value: float
    u: float
    contribution: np.ndarray
    share: np.ndarray
    degrees_of_freedom: float
    probability: float
    coverage_factor: float
    expanded: float


@dataclass(frozen=True, eq=False)
class Scattered:
    """Result of a Monte Carlo: mean, uncertainty and coverage intervals.

    values            (draws,) of the result
    mean, u           of them; meaningless if an input's t distribution has no variance (2 degrees of freedom)
    low, high         ends of the probabilistically symmetric coverage interval
    shortest          ends of the shortest interval of the same probability
    probability       of both
    """

    values: np.ndarray
    mean: float
    u: float
    low: float
    high: float
    shortest: tuple[float, float]
    probability: float


def propagate(
    inputs: Sequence[Input],
    sensitivity: np.ndarray,
    *,
    value: float,
    correlation: np.ndarray | None = None,
    probability: float = 0.95,
) -> Budget:
    """First-order budget of a result.

    inputs        k of them
    sensitivity   (k,) slope of the result by each
    value         of the result
    correlation   (k, k) of the inputs; uncorrelated if None
    probability   of the coverage interval, 0 to 1

    Raises ValidityError for an invalid correlation, or one between inputs of finite degrees of freedom, for which the
    Welch-Satterthwaite formula does not hold.

    Source: [JCGM100] eqs. 13, 16 and G.2b. Exact for a linear model; the interval is that of a t distribution.

    >>> two = (Input("a", 1.0, 0.3), Input("b", 2.0, 0.2, "rectangular"))
    >>> budget = propagate(two, np.array([1.0, 2.0]), value=5.0)
    >>> round(budget.u, 6), [round(float(s), 2) for s in budget.share], round(budget.expanded, 4)
    (0.5, [0.36, 0.64], 0.98)
    """
    from scipy.stats import t as student

    slopes = np.asarray(sensitivity, dtype=float)
    r = np.eye(len(inputs)) if correlation is None else _checked(np.asarray(correlation, dtype=float), inputs)
    if not 0.0 < probability < 1.0:
        raise ValidityError(f"probability {probability} is not between 0 and 1")
    contribution = slopes * np.array([i.u for i in inputs])
    parts = contribution * (r @ contribution)
    variance = max(float(parts.sum()), 0.0)
    u = float(np.sqrt(variance))
    degrees = effective_degrees_of_freedom(contribution, np.array([i.degrees_of_freedom for i in inputs]), u=u)
    factor = float(student.ppf(0.5 + 0.5 * probability, degrees))
    share = parts / variance if variance > 0.0 else np.full(len(inputs), np.nan)
    return Budget(
        inputs=tuple(inputs),
        sensitivity=slopes,
        correlation=r,
        value=float(value),
        u=u,
        contribution=contribution,
        share=share,
        degrees_of_freedom=degrees,
        probability=probability,
        coverage_factor=factor,
        expanded=factor * u,
    )


def effective_degrees_of_freedom(
    contribution: np.ndarray, degrees_of_freedom: np.ndarray, *, u: float | None = None
) -> float:
    """Effective degrees of freedom (Welch-Satterthwaite) of a combined standard uncertainty.

    Infinite if no input is an estimate.

    contribution         (k,) of each input, in the result's unit, any sign
    degrees_of_freedom   (k,) of each, above 0, infinite allowed
    u                    combined, if correlation makes it differ from the root sum of squares

    Source: [JCGM100] eq. G.2b, for uncorrelated estimates. Not truncated to a whole number.

    >>> float(effective_degrees_of_freedom(np.array([3.0, 4.0]), np.array([4.0, np.inf]))).__round__(3)
    30.864
    """
    parts = np.asarray(contribution, dtype=float)
    total = float(np.sum(parts**2)) if u is None else u**2
    weight = float(np.sum((parts / np.sqrt(total)) ** 4 / degrees_of_freedom)) if total > 0.0 else 0.0
    return 1.0 / weight if weight > 0.0 else float("inf")


def draw_inputs(
    inputs: Sequence[Input], generator: np.random.Generator, draws: int, *, correlation: np.ndarray | None = None
) -> np.ndarray:
    """Draws (draws, k) of the inputs from their distributions.

    correlation   (k, k); only normal inputs can be correlated

    Source: [JCGM101] clauses 6.4.2, 6.4.5-6.4.9 and 5.2, C.5 (multivariate normal).
    """
    k = len(inputs)
    r = np.eye(k) if correlation is None else _checked(np.asarray(correlation, dtype=float), inputs)
    unit = np.empty((draws, k))
    for column, item in enumerate(inputs):
        if item.distribution == STUDENT:
            unit[:, column] = generator.standard_t(item.degrees_of_freedom, draws)
        else:
            unit[:, column] = SAMPLERS[item.distribution](generator, draws)
    joined = np.flatnonzero(np.any(r != np.eye(k), axis=1))
    if len(joined):
        values, vectors = np.linalg.eigh(r[np.ix_(joined, joined)])
        unit[:, joined] = unit[:, joined] @ (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return np.array([i.value for i in inputs]) + unit * np.array([i.u for i in inputs])


def monte_carlo(
    model: Model, draw: Draw, *, draws: int, generator: np.random.Generator, probability: float = 0.95
) -> Scattered:
    """Distribution of a result by a fixed number of draws of its inputs.

    model         (n, k) -> (n,)
    draw          function of a generator and a number n that gives (n, k) inputs
    draws         at least 2; 200 000 give both ends of a 95 % interval to some 1 % of u
    probability   of the coverage intervals, 0 to 1

    Source: [JCGM101] clauses 7.2-7.7.

    >>> result = monte_carlo(lambda x: x[:, 0], lambda g, n: g.uniform(-1.0, 1.0, (n, 1)), draws=200_000,
    ...                      generator=np.random.default_rng(1))
    >>> round(result.u, 2), round(result.high, 2)
    (0.58, 0.95)
    """
    if draws < 2 or not 0.0 < probability < 1.0:
        raise ValidityError(f"{draws} draws, probability {probability} (expected 2 or more, and between 0 and 1)")
    sizes = [min(BATCH, draws - start) for start in range(0, draws, BATCH)]
    return _summary(np.concatenate([model(draw(generator, size)) for size in sizes]), probability)


def numerical_tolerance(u: float, digits: int = 2) -> float:
    """Numerical tolerance: half a unit of the last significant digit of u.

    Source: [JCGM101] clause 7.9.2.

    >>> numerical_tolerance(0.035), numerical_tolerance(0.035, 1)
    (0.0005, 0.005)
    """
    if not u > 0.0:
        return 0.0
    return float(f"5e{int(f'{u:.{digits - 1}e}'.partition('e')[2]) - digits}")


def agrees(budget: Budget, scattered: Scattered, digits: int = 2) -> bool:
    """True if both ends of the budget's interval match the Monte Carlo's, to so many digits of u.

    Source: [JCGM101] clause 8.1.
    """
    ends = np.array([budget.value - budget.expanded - scattered.low, budget.value + budget.expanded - scattered.high])
    return bool(np.all(np.abs(ends) <= numerical_tolerance(budget.u, digits)))


def agreement(budget: Budget, scattered: Scattered, digits: int = 2) -> bool | None:
    """Result of `agrees`.

    None if there are too few draws to decide.

    Source: [JCGM101] clauses 7.9.4 and 8.2: twice an end's standard deviation must be below the tolerance, here with
    that deviation from the binomial scatter of its rank.
    """
    values, n = np.sort(scattered.values), len(scattered.values)
    tail = 0.5 * (1.0 - scattered.probability)
    for rank in (tail, 1.0 - tail):
        low, high = (rank + sign * np.sqrt(tail * (1.0 - tail) / n) for sign in (-1.0, 1.0))
        if low <= 0.0 or high >= 1.0:
            return None
        if values[int(high * n)] - values[int(low * n)] > numerical_tolerance(budget.u, digits):
            return None
    return agrees(budget, scattered, digits)


def _summary(values: np.ndarray, probability: float) -> Scattered:
    """Mean, deviation and intervals of values, reduced by the first one for precision."""
    start = float(values[0])
    reduced = np.sort(values - start)
    n = len(reduced)
    inside = min(max(round(probability * n), 1), n - 1)
    low_index = round(0.5 * (n - inside))
    width = reduced[inside:] - reduced[: n - inside]
    best = int(np.argmin(width))
    return Scattered(
        values=values,
        mean=start + float(reduced.mean()),
        u=float(reduced.std(ddof=1)),
        low=start + float(reduced[low_index]),
        high=start + float(reduced[min(low_index + inside, n - 1)]),
        shortest=(start + float(reduced[best]), start + float(reduced[best + inside])),
        probability=probability,
    )


def _checked(correlation: np.ndarray, inputs: Sequence[Input]) -> np.ndarray:
    """Validated correlation: joins only normal inputs whose u is not an estimate."""
    k = len(inputs)
    wrong = correlation.shape != (k, k) or not np.allclose(correlation, correlation.T, rtol=0.0, atol=1e-12)
    if wrong or np.any(np.diag(correlation) != 1.0) or np.linalg.eigvalsh(correlation).min() < -1e-9:
        raise ValidityError(f"correlation of {k} inputs (expected symmetric, diagonal of ones, no eigenvalue below 0)")
    for joined, item in zip(np.any(correlation != np.eye(k), axis=1), inputs, strict=True):
        if joined and (item.distribution != "normal" or np.isfinite(item.degrees_of_freedom)):
            raise ValidityError(
                f"input {item.name!r} is correlated but {item.distribution} with {item.degrees_of_freedom:g} degrees "
                "of freedom (expected normal, infinite)"
            )
    return correlation
