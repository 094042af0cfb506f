"""Adjustment of readings that depend non-linearly on the parameters.

`fit_readings` about the latest values, iterated to convergence.

A parameter is free, or has a prior value and standard uncertainty (a systematic effect, a value from
another calibration); all have one joint covariance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.reduction.calibrations.calibration import Quantity
from catseye.reduction.calibrations.fit import (
    EVERY_VALUE,
    REJECTED,
    SUSPECT,
    USED,
    CalibrationFit,
    Effect,
    FitOptions,
    ObservedScatter,
    fit_readings,
)
from catseye.reduction.calibrations.kind import quantities

ROUNDS = 40
SETTLED = 1e-4  # of a standard uncertainty: change by a further round


@dataclass(frozen=True)
class ModelParameter:
    """Parameter of a model.

    name     for messages
    start    start of the search; the prior value if there is one
    step     of the numerical derivatives, in its unit
    u        standard uncertainty of that value; infinite for a free parameter, zero holds it
    unit     of it, for the certificate
    """

    name: str
    start: float
    step: float
    u: float = np.inf
    unit: str = ""


@dataclass(frozen=True, eq=False)
class CurvedFit:
    """Result of `fit_curved` over p parameters.

    parameters    of the input
    values        (p,) of all of them
    covariance    (p, p); rows and columns of fixed ones are zero
    fit           the last linear one: residuals, tests; `predicted` is the values' prediction
    """

    parameters: tuple[ModelParameter, ...]
    values: np.ndarray
    covariance: np.ndarray
    fit: CalibrationFit

    def index(self, name: str) -> int:
        """Index of a parameter; ValueError for another name."""
        return [p.name for p in self.parameters].index(name)

    @property
    def uncertain(self) -> list[int]:
        """Numbers of the parameters that the fit has, in its order: free ones, then those with a prior."""
        free = [k for k, p in enumerate(self.parameters) if np.isinf(p.u)]
        return free + [k for k, p in enumerate(self.parameters) if 0.0 < p.u < np.inf]

    def value(self, name: str) -> float:
        """Estimate of a parameter by its name."""
        return float(self.values[self.index(name)])

    def u(self, name: str) -> float:
        """Standard uncertainty of a parameter by its name."""
        k = self.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def quantities(
        self, selection: Sequence[tuple[str, str, str, str, float]]
    ) -> tuple[tuple[Quantity, ...], np.ndarray]:
        """Quantities and their covariance.

        Each selected by (parameter, key, unit, meaning, size of the unit).
        """
        at = [self.index(name) for name, *_ in selection]
        scale = np.array([1.0 / size for *_, size in selection])
        covariance = self.covariance[np.ix_(at, at)] * np.outer(scale, scale)
        turn = np.array([[s * (k == j) for j in self.uncertain] for k, s in zip(at, scale, strict=True)])
        keys = [(key, unit, meaning) for _, key, unit, meaning, _ in selection]
        return quantities(keys, self.values[at] * scale, covariance, fit=self.fit, turn=turn), covariance


def fit_curved(
    observed: np.ndarray,
    predict: Callable[[np.ndarray], np.ndarray],
    parameters: Sequence[ModelParameter],
    *,
    scatter: ObservedScatter,
    options: FitOptions = EVERY_VALUE,
) -> CurvedFit:
    """Best-fitting parameters of a non-linear model.

    observed     (m,)
    predict      function of the values (p,) of the parameters -> (m,)
    parameters   p, each free or with a prior standard uncertainty
    scatter      of the observed values
    options      used values, and the tests

    Raises EstimationError where the readings do not determine every free parameter (it names them), where too many
    would be rejected, or without convergence.

    Source: [FOERSTNER16] chapter 4 (Gauss-Newton with priors); derivatives by central differences.
    """
    values = np.array([p.start for p in parameters], dtype=float)
    sought = np.array([np.isinf(p.u) for p in parameters], dtype=bool)
    acting = np.array([not np.isinf(p.u) and p.u > 0.0 for p in parameters], dtype=bool)
    start, rejecting = values.copy(), False
    for _ in range(ROUNDS):
        slopes = _slopes(predict, values, parameters)
        back = np.where(acting, values - start, 0.0)  # priors stay about their own values
        fit = fit_readings(
            observed - predict(values) + slopes @ back,
            slopes[:, sought],
            scatter,
            names=[p.name for p in parameters if np.isinf(p.u)],
            effects=[
                Effect(p.name, slopes[:, k], p.u, p.unit) for k, p in enumerate(parameters) if acting[k]
            ],
            options=replace(options, reject=rejecting),
        )  # fmt: skip
        latest = values.copy()
        latest[sought] += fit.x
        latest[acting] = start[acting] + [fit.effects[p.name][0] for k, p in enumerate(parameters) if acting[k]]
        covariance = _covariance(slopes, scatter, fit, parameters)
        u = np.sqrt(np.diag(covariance))
        moved = np.max(np.abs(latest - values) / np.where(u > 0.0, u, np.inf), initial=0.0)
        values = latest
        if not np.isfinite(values).all():
            break
        if moved < SETTLED:
            if rejecting or not options.reject:
                return CurvedFit(tuple(parameters), values, covariance, replace(fit, predicted=predict(values)))
            rejecting = True  # far from the solution every reading looks wrong
    raise EstimationError(
        f"the values did not settle in {ROUNDS} rounds: check the sheet's nominal values, and the columns' signs"
    )


def _slopes(
    predict: Callable[[np.ndarray], np.ndarray], values: np.ndarray, parameters: Sequence[ModelParameter]
) -> np.ndarray:
    """Derivatives of the predicted values, (m, p)."""
    columns = []
    for k, p in enumerate(parameters):
        aside = np.zeros(len(values))
        aside[k] = p.step
        columns.append((predict(values + aside) - predict(values - aside)) / (2.0 * p.step))
    return np.column_stack(columns)


def _covariance(
    slopes: np.ndarray, scatter: ObservedScatter, fit: CalibrationFit, parameters: Sequence[ModelParameter]
) -> np.ndarray:
    """Covariance (p, p) of all parameters together.

    `fit_readings` gives that of the free ones alone.
    """
    total = scatter.claimed + sum(
        (fit.components[name] ** 2 * matrix for name, matrix in scatter.unknown.items()), np.zeros_like(scatter.claimed)
    )
    block = np.ix_(fit.active, fit.active)
    free = np.array([k for k, p in enumerate(parameters) if p.u > 0.0], dtype=int)
    wide = slopes[np.ix_(fit.active, free)]
    prior = np.array([0.0 if np.isinf(parameters[k].u) else parameters[k].u ** -2.0 for k in free])
    normal = wide.T @ np.linalg.solve(total[block], wide) + np.diag(prior)
    size = 1.0 / np.sqrt(np.diag(normal))
    answer = np.zeros((len(parameters), len(parameters)))
    answer[np.ix_(free, free)] = np.linalg.inv(normal * np.outer(size, size)) * np.outer(size, size)
    return answer


def row_ends(fit: CalibrationFit, reasons: Sequence[str], row_size: int) -> list[tuple[float, str]]:
    """Statistic and state of the worst value in each row of a table.

    A row gave `row_size` observed values, one after the other.

    reasons   reason that a row was left out beforehand, "" for none
    """
    states = fit.state([reason for reason in reasons for _ in range(row_size)])
    order = (USED, SUSPECT, REJECTED)
    ends = []
    for k in range(0, len(states), row_size):
        statistic = max(fit.statistic[k : k + row_size], key=abs)
        state = max(states[k : k + row_size], key=lambda s: order.index(s) if s in order else len(order))
        ends.append((float(statistic), state))
    return ends
