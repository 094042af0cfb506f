"""Linear adjustment with systematic effects and tests, for all calibrations.

The unknowns are a few parameters of a linear model. Systematic effects are further parameters with mean zero and a
known standard uncertainty. The scatter is either claimed, or estimated from the readings themselves (restricted maximum
likelihood) if not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution, adjust
from catseye.estimation.observations.kinds import Linear
from catseye.estimation.quality.reliability import checked, global_test, single_level, tau_critical, w_critical
from catseye.reduction.calibrations.budget import CovarianceParts
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.scatter import effective_degrees, restricted_likelihood, variance_information

TESTS = 3  # that share the level evenly: scatter, single readings, tests of the kind
SCATTER_LIMIT = 0.05 / TESTS  # level of the test of the variance factor, two-sided
MOST_REJECTED = 1.0 / 3.0  # of the readings: beyond it the model is wrong, not the readings
USED, SUSPECT, REJECTED = "used", "suspect", "rejected"


@dataclass(frozen=True, eq=False)
class Effect:
    """Systematic effect that shifts all readings together.

    name     for the certificate
    column   (m,) change of the observed values for each unit of it
    u        its standard uncertainty, in that unit; zero omits it
    unit     of it, for the certificate
    """

    name: str
    column: np.ndarray
    u: float
    unit: str = ""


@dataclass(frozen=True, eq=False)
class ObservedScatter:
    """Scatter of the observed values: claimed, and unknown components.

    claimed      (m, m) prior covariance
    unknown      component -> (m, m) matrix Q; its variance factor is estimated
    size         of the numbers whose differences are observed: scatter below their rounding counts as none
    """

    claimed: np.ndarray
    unknown: dict[str, np.ndarray] = field(default_factory=dict)
    size: float = 0.0


@dataclass(frozen=True, eq=False)
class CalibrationFit:
    """Result over m observed values and p free parameters.

    x, covariance       (p,), (p, p) of the free parameters, systematic effects included
    scattered           (p, p) the part of it by the scatter alone
    effects             effect -> its value and u after the adjustment
    components          component of scatter -> its estimated standard deviation
    residual, predicted (m,) observed minus predicted, with the estimated effects; prediction of the free parameters
    sigma               (m,) standard uncertainty of the observed value, scatter alone
    statistic           (m,) standardised residual; of a value left out, that of its prediction
    active              (m,) bool
    checked             (m,) bool: an error of it would show in the others
    test, critical      "w" (scatter claimed) or "tau" (scatter estimated), and the limit of a single test
    variance_factor, degrees_of_freedom   NaN and the degrees where the scatter was estimated: it would be 1
    effective         (p,) degrees of freedom of each parameter's scattered variance; infinite where scatter is claimed
    independent       True if the readings' scatters are independent
    parts             the covariance by its causes, effects included
    """

    x: np.ndarray
    covariance: np.ndarray
    scattered: np.ndarray
    effects: dict[str, tuple[float, float]]
    components: dict[str, float]
    residual: np.ndarray
    predicted: np.ndarray
    sigma: np.ndarray
    statistic: np.ndarray
    active: np.ndarray
    checked: np.ndarray
    test: str
    critical: float
    variance_factor: float
    degrees_of_freedom: float
    effective: np.ndarray
    independent: bool
    parts: CovarianceParts

    @property
    def explained(self) -> float:
        """Share of the used values' variance explained by the parameters.

        NaN for identical values.
        """
        observed = (self.predicted + self.residual)[self.active]
        total = float(np.var(observed))
        return 1.0 - float(np.mean(self.residual[self.active] ** 2)) / total if total > 0.0 else float("nan")

    @property
    def suspects(self) -> np.ndarray:
        """True (m,) for used values that the test rejects."""
        return self.active & self.checked & (np.abs(self.statistic) > self.critical)

    def decisions(self, level: float = SCATTER_LIMIT) -> tuple[CheckOutcome, ...]:
        """Tests of the scatter and of the single readings."""
        outcomes = []
        if self.test == "w" and self.degrees_of_freedom > 0.5:
            test = global_test(self.variance_factor * self.degrees_of_freedom, self.degrees_of_freedom, level)
            low, high = test.lower, test.upper
            below = self.variance_factor < 1.0
            outcomes.append(
                CheckOutcome(
                    "scatter: variance factor",
                    self.variance_factor,
                    low if below else high,
                    bool(low <= self.variance_factor <= high),
                    f"{low:.3g} to {high:.3g} is expected {1.0 - level:.1%} of the time if the claimed scatter is true",
                    least=below,
                )
            )
        elif self.test == "tau":
            outcomes.append(
                CheckOutcome(
                    "scatter: variance factor",
                    float("nan"),
                    float("nan"),
                    None,
                    "the scatter was estimated from these readings, so they cannot test it",
                )
            )
        else:
            outcomes.append(
                CheckOutcome("scatter: variance factor", float("nan"), float("nan"), None, "no redundant readings")
            )
        tested = self.active & self.checked
        if tested.any():
            worst = float(np.max(np.abs(self.statistic[tested])))
            count = int(np.count_nonzero(self.suspects))
            text = "no reading stands out" if not count else f"{count} of the values used stand out: look at them"
            outcomes.append(CheckOutcome(f"outliers: largest |{self.test}|", worst, self.critical, not count, text))
        else:
            outcomes.append(
                CheckOutcome("outliers", float("nan"), float("nan"), None, "no reading is checked by the others")
            )
        return tuple(outcomes)

    def state(self, reasons: Sequence[str]) -> tuple[str, ...]:
        """State (m,) of each value: used, suspect, rejected, or a reason.

        The reason why it was left out beforehand.
        """
        suspects = self.suspects
        return tuple(
            f"left out: {reason}" if reason else SUSPECT if s else USED if a else REJECTED
            for reason, s, a in zip(reasons, suspects, self.active, strict=True)
        )


@dataclass(frozen=True, eq=False)
class FitOptions:
    """Used observed values, and their tests.

    active     (m,) bool: used at the start; all if None
    together   (m,) labels: values of one label leave together, as both quadratures of a phasor; each alone if None
    reject     leave out what the test rejects, worst first, one at a time
    level      of the tests together, probability of a false alarm; a third of it is that of the single readings
    """

    active: np.ndarray | None = None
    together: np.ndarray | None = None
    reject: bool = False
    level: float = 0.05


EVERY_VALUE = FitOptions()


def fit_readings(
    observed: np.ndarray,
    design: np.ndarray,
    scatter: ObservedScatter,
    *,
    names: Sequence[str],
    effects: Sequence[Effect] = (),
    options: FitOptions = EVERY_VALUE,
) -> CalibrationFit:
    """Least-squares parameters of a linear model of readings.

    observed   (m,)
    design     (m, p) derivatives by the free parameters
    scatter    of the observed values
    names      (p,) of the parameters, for messages
    effects    systematic, with priors
    options    used values, and the tests

    Raises EstimationError where the readings do not determine every parameter, or where a third of
    them would be rejected.

    Source: [FOERSTNER16] chapter 4 (Gauss-Markov model with priors); [BAARDA68] (w test), [POPE76] (tau test);
    [PATTERSON71] (scatter from the readings).
    """
    m = len(observed)
    on = np.ones(m, dtype=bool) if options.active is None else np.array(options.active, dtype=bool)
    start = int(on.sum())
    labels = np.arange(m) if options.together is None else np.asarray(options.together)
    while True:
        fit = _fitted(observed, design, scatter, names=names, effects=effects, on=on, level=options.level)
        if not options.reject or not fit.suspects.any():
            return fit
        worst = int(np.argmax(np.where(fit.suspects, np.abs(fit.statistic), -1.0)))
        on = on & (labels != labels[worst])
        if start - on.sum() > MOST_REJECTED * start:
            raise EstimationError(
                f"more than {MOST_REJECTED:.0%} of the readings would have to be rejected: they do not follow the "
                "model, or their uncertainties are too small; calibrate without --reject and look at the residuals"
            )


def _fitted(
    observed: np.ndarray,
    design: np.ndarray,
    scatter: ObservedScatter,
    *,
    names: Sequence[str],
    effects: Sequence[Effect],
    on: np.ndarray,
    level: float,
) -> CalibrationFit:
    acting = [e for e in effects if e.u > 0.0]
    p, q = design.shape[1], len(acting)
    wide = np.column_stack([design, *(e.column for e in acting)])
    covariance, components = scatter.claimed, {}
    if scatter.unknown:
        shared = sum((e.u**2 * np.outer(e.column, e.column) for e in acting), np.zeros_like(covariance))
        block = np.ix_(on, on)
        variances = restricted_likelihood(
            observed[on],
            design[on],
            [matrix[block] for matrix in scatter.unknown.values()],
            claimed=(scatter.claimed + shared)[block],
            size=scatter.size,
        )
        components = {name: float(np.sqrt(v)) for name, v in zip(scatter.unknown, variances, strict=True)}
        covariance = covariance + sum(v * matrix for v, matrix in zip(variances, scatter.unknown.values(), strict=True))
    groups = [Linear("readings", observed, covariance, np.arange(p + q), wide)]
    if q:
        variance = np.array([e.u for e in acting]) ** 2
        groups.append(Linear("effects", np.zeros(q), variance, p + np.arange(q), np.eye(q)))
    solution = adjust(
        np.zeros(p + q),
        groups,
        active=[on, np.ones(q, dtype=bool)][: len(groups)],
        names=[*names, *(e.name for e in acting)],
    ).require_converged()
    degrees = np.full(p, np.inf)
    if components:
        block = np.ix_(on, on)
        acting_on = [q[block] for q in scatter.unknown.values()]  # one estimated as zero is no less uncertain
        degrees = effective_degrees(design[on], acting_on, covariance[block])
    parts = _parts(solution.covariance, groups[0], scatter, components, on=on, acting=acting)
    return _outcome(solution, groups[0], parts, components, on=on, level=level, effective=degrees)


def _parts(
    full: np.ndarray,
    readings: Linear,
    scatter: ObservedScatter,
    components: dict[str, float],
    *,
    on: np.ndarray,
    acting: Sequence[Effect],
) -> CovarianceParts:
    """Covariance of parameters and effects by its causes.

    The estimate is linear in the readings and in the effects' priors, which are independent: the parts add up.
    """
    block, wide = np.ix_(on, on), readings.matrix[on]
    gain = full @ np.linalg.solve(readings.covariance[block], wide).T
    u = np.array([e.u for e in acting])
    free = wide.shape[1] - len(acting)
    pulled = {name: scatter.unknown[name][block] for name in components}
    total = readings.covariance[block] + (wide[:, free:] * u**2) @ wide[:, free:].T
    claimed = scatter.claimed[block]
    return CovarianceParts(
        effects=tuple(e.name for e in acting),
        u=u,
        units=tuple(e.unit for e in acting),
        covariance=full,
        claimed=gain @ claimed @ gain.T,
        estimated={name: gain @ matrix @ gain.T for name, matrix in pulled.items()},
        variances=np.array(list(components.values())) ** 2,
        information=variance_information(wide[:, :free], list(pulled.values()), total),
    )


def _outcome(
    solution: LeastSquaresSolution,
    readings: Linear,
    parts: CovarianceParts,
    components: dict[str, float],
    *,
    on: np.ndarray,
    level: float,
    effective: np.ndarray,
) -> CalibrationFit:
    group, p = solution.fits[0], len(effective)
    full = solution.covariance
    block = np.ix_(on, on)
    design = readings.matrix[:, :p]
    weight = np.linalg.inv(readings.covariance[block])
    scattered = np.linalg.inv(design[on].T @ weight @ design[on])
    degrees = float(np.sum(group.redundancy[on]))
    factor = group.pvv / degrees if degrees > 1e-6 else float("nan")
    tested = checked(group) & on
    single = single_level(level / TESTS, max(int(tested.sum()), 1))
    estimated = bool(components) and degrees > 1.5
    critical = tau_critical(single, degrees) if estimated else w_critical(single)
    statistic = group.standardised / (np.sqrt(factor) if estimated and factor > 0.0 else 1.0)
    return CalibrationFit(
        x=solution.x[:p],
        covariance=full[:p, :p],
        scattered=scattered,
        effects={
            name: (float(solution.x[p + k]), float(np.sqrt(full[p + k, p + k]))) for k, name in enumerate(parts.effects)
        },
        components=components,
        residual=group.residual,
        predicted=design @ solution.x[:p],
        sigma=group.sigma,
        statistic=statistic,
        active=on,
        checked=checked(group),
        test="tau" if components else "w",
        critical=critical,
        variance_factor=float("nan") if components else factor,
        degrees_of_freedom=degrees,
        effective=effective,
        independent=not np.any(readings.covariance - np.diag(np.diag(readings.covariance))),
        parts=parts,
    )
