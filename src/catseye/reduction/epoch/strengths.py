"""Prior strengths of a campaign's processes, and estimates by the ranges.

A process is a Gaussian of fixed shape and unknown strength. The size and uncertainty of its estimate from the
ranges determine the strength; a strength of experience counts as some observations more, so that a campaign of few
shots keeps it.

Source: restricted maximum likelihood ([PATTERSON71]; variance components in [FOERSTNER16] chapter 4): of a component G
of a prior C with estimate x and covariance Q the score by ln s^2 is (w'Gw - tr(G M)) / 2 and its information
tr((G M)^2) / 2, with w = C^-1 x and M = C^-1 - C^-1 Q C^-1.
"""

from collections.abc import Iterator
from dataclasses import astuple, dataclass

import numpy as np

from catseye.constants import PPM
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, LeastSquaresSolution
from catseye.estimation.observations.kinds import Linear
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.air.process import LEAST, MOST, U_LAG, U_RADIATION, USUAL, WIDE, AirStrength
from catseye.reduction.epoch.motion.telescope_motion import ALIKE, LEAST_WALK, MOST_WALK, PARTS, WALK, TelescopeKnots
from catseye.reduction.epoch.parameter import Parameter, ParameterKind

AIR_BETWEEN = "air between stations and paths"
AIR_ACROSS = "air across the site"
ERRORS = "thermometers' lag and sunshine"
EXPANSION = "telescope's expansion"
PROCESSES = (AIR_BETWEEN, AIR_ACROSS, EXPANSION)  # of estimated strength
EXPERIENCE = 6.0  # equivalent observations of the strength of experience
WIDE_PPM = 0.1  # of eddies, before any estimate
LITTLE_PPM, MOST_PPM = 0.05, 2.0  # limits of eddies: below, little changes; above, no real air
TOLERANCE = 0.25  # relative change of a strength that counts as none
LEAST_SHARE = 1e-3  # of sigma^2 in the variance of a test: below is rounding
BISECTIONS = 40
LONGEST = 2.0  # step in the logarithm of a variance
STEPS = 12  # cap of steps; usually five


@dataclass(frozen=True)
class ProcessStrength:
    """Strengths of a campaign's processes.

    air         between stations and paths
    telescope   of each of `telescope_motion.PARTS`, in units of its `WALK`
    eddies_ppm  of a path's index, independent at each shot: air faster than the knots, or smaller than the site
    """

    air: AirStrength = WIDE
    telescope: tuple[float, ...] = (1.0,) * len(PARTS)
    eddies_ppm: float = WIDE_PPM

    def near(self, strength: "ProcessStrength") -> bool:
        """True if no strength differs by more than a quarter."""
        pairs = [
            *zip(astuple(self.air), astuple(strength.air), strict=True),
            *zip(self.telescope, strength.telescope, strict=True),
            (self.eddies_ppm + LITTLE_PPM, strength.eddies_ppm + LITTLE_PPM),
        ]
        return all(abs(a - b) <= TOLERANCE * max(a, b) for a, b in pairs)


@dataclass(frozen=True, eq=False)
class Processes:
    """Processes of a campaign, with their parameters' columns.

    air         of the field
    columns     of its levels and slopes, and of east and north (2, j)
    telescope   None where it is taken as at rest, and
    moving      (parts, k) columns of its knots
    errors      columns of lags, and of sunshine where there is any
    """

    air: AirField
    columns: tuple[np.ndarray, np.ndarray]
    errors: np.ndarray
    telescope: TelescopeKnots | None
    moving: np.ndarray

    @staticmethod
    def of(air: AirField, telescope: TelescopeKnots | None, at: dict[Parameter, int]) -> "Processes":
        """Processes by the parameters of a layout."""
        knots = np.array([at[Parameter(ParameterKind.AIR, *label)] for label in air.knots.labels], dtype=int)
        k = len(air.knots.level) + len(air.knots.slope)
        errors = [at[Parameter(kind, station)] for kind in air.errors for station in air.stations]
        count = 0 if telescope is None else len(telescope.knots)
        moving = [at[Parameter(ParameterKind.TELESCOPE, part)] + np.arange(count) for part in PARTS if count]
        return Processes(
            air,
            (knots[:k], knots[k:].reshape(2, -1)),
            np.array(errors, dtype=int),
            telescope,
            np.array(moving, dtype=int).reshape(len(moving), count),
        )

    def priors(self, strength: ProcessStrength) -> list[Linear]:
        """Priors of the processes."""
        between, across = self.air.knots.covariances(strength.air)
        s = len(self.air.heights)
        u = np.repeat([U_LAG, U_RADIATION][: len(self.errors) // s], s)
        priors = [
            _gaussian(AIR_BETWEEN, self.columns[0], between),
            *(_gaussian(AIR_ACROSS, columns, across) for columns in self.columns[1]),
            Linear(ERRORS, np.zeros(len(u)), u**2, self.errors[:, None], np.ones((len(u), 1))),
        ]
        if self.telescope is not None:
            scales = np.array(strength.telescope) * WALK
            priors += [
                _gaussian(EXPANSION, columns, scale**2 * self.telescope.covariance)
                for columns, scale in zip(self.moving, scales, strict=True)
            ]
        return priors

    def estimated(
        self, solution: LeastSquaresSolution, before: ProcessStrength, lengths: list[np.ndarray]
    ) -> ProcessStrength:
        """Strengths by the estimates of an adjustment that used other strengths.

        lengths   (m,) m of each of the first groups' paths
        """
        knots, (*usual, usual_across) = self.air.knots, astuple(USUAL)
        between, across = knots.covariances(before.air)
        shapes, across_shape = knots.shapes()
        *current, current_across = astuple(before.air)
        evidence = _Evidence.of(solution, self.columns[0], between, knots.record_covariance, shapes)
        level = _estimated_strengths(
            [evidence], np.array(current), np.array(usual), low=astuple(LEAST)[:4], high=astuple(MOST)[:4]
        )
        nothing_fixed = np.zeros_like(across)
        directions = [_Evidence.of(solution, c, across, nothing_fixed, [across_shape]) for c in self.columns[1]]
        by_metre = _estimated_strengths(
            directions,
            np.array([current_across]),
            np.array([usual_across]),
            low=(LEAST.across_c_per_m,),
            high=(MOST.across_c_per_m,),
        )
        return ProcessStrength(
            AirStrength(*level, *by_metre),
            tuple(self._moving(solution, before)),
            _eddies(solution, before.eddies_ppm, lengths),
        )

    def _moving(self, solution: LeastSquaresSolution, before: ProcessStrength) -> Iterator[float]:
        if self.telescope is None:
            yield from before.telescope
            return
        shape = self.telescope.covariance
        for together in ALIKE:
            factor = before.telescope[together[0]]
            evidence = [
                _Evidence.of(
                    solution,
                    self.moving[i],
                    (factor * WALK[i]) ** 2 * shape,
                    np.zeros_like(shape),
                    [WALK[i] ** 2 * shape],
                )
                for i in together
            ]
            (factor_new,) = _estimated_strengths(
                evidence, np.array([factor]), np.ones(1), low=(LEAST_WALK,), high=(MOST_WALK,)
            )
            yield from [factor_new] * len(together)


def with_processes(priors: list, processes: Processes, strength: ProcessStrength) -> list:
    """Priors of a network, with its processes at other strengths."""
    new = iter([prior for prior in processes.priors(strength) if prior.name in PROCESSES])
    return [next(new) if prior.name in PROCESSES else prior for prior in priors]


def _gaussian(name: str, columns: np.ndarray, covariance: np.ndarray) -> Linear:
    k = len(columns)
    return Linear(name, np.zeros(k), covariance, columns, np.eye(k))


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Evidence of the ranges alone on a process.

    F of its parameters, and F times their estimate.

    fixed    (k, k) of the prior, the part independent of the strengths
    shapes   of each strength
    """

    information: np.ndarray
    force: np.ndarray
    fixed: np.ndarray
    shapes: list[np.ndarray]

    @staticmethod
    def of(
        solution: LeastSquaresSolution,
        columns: np.ndarray,
        prior: np.ndarray,
        fixed: np.ndarray,
        shapes: list[np.ndarray],
    ) -> "_Evidence":
        """Evidence from an adjustment that took a prior."""
        precision = np.linalg.inv(solution.q.within(columns))
        information = precision - np.linalg.inv(prior)
        return _Evidence(0.5 * (information + information.T), precision @ solution.x[columns], fixed, shapes)

    def scores(self, strength: np.ndarray) -> np.ndarray:
        """Scores (3, s) of each strength.

        w'Gw, tr(G M) and tr((G M)^2) of its part G of the prior.
        """
        parts = [s**2 * shape for s, shape in zip(strength, self.shapes, strict=True)]
        inverse = np.linalg.inv(self.fixed + sum(parts))
        spread = np.linalg.inv(self.information + inverse)
        w = inverse @ (spread @ self.force)
        m = inverse - inverse @ spread @ inverse
        rows = []
        for part in parts:
            product = part @ m
            rows.append((w @ part @ w, np.trace(product), np.sum(product * product.T)))
        return np.array(rows).T


def _estimated_strengths(
    evidence: list[_Evidence],
    strength: np.ndarray,
    usual: np.ndarray,
    *,
    low: tuple[float, ...],
    high: tuple[float, ...],
) -> tuple[float, ...]:
    """Common strengths (s,) of processes of one kind.

    Fisher's scoring in the logarithms of variances.
    """
    for _ in range(STEPS):
        observed, expected, information = np.sum([item.scores(strength) for item in evidence], axis=0)
        step = observed - expected + EXPERIENCE * ((usual / strength) ** 2 - 1.0)
        step = np.clip(step / (information + EXPERIENCE), -LONGEST, LONGEST)
        strength = np.clip(strength * np.exp(0.5 * step), low, high)
        if np.all(np.abs(step) < 0.1):
            break
    return tuple(float(s) for s in strength)


def _eddies(solution: LeastSquaresSolution, before_ppm: float, lengths: list[np.ndarray]) -> float:
    """Random departure of each shot's index, ppm, from the shots' own tests.

    With a variance v more than the sigma^2 of a shot, its w^2 is expected as (sigma^2 + v) / sigma^2, as if all had so
    much more; the likeliest is sought. Shots that nothing checks have no test.
    """
    tested = [f.active & (f.detectable_error < f.sigma * NONCENTRALITY / LEAST_SHARE**0.5) for f in solution.fits]
    fits = list(zip(solution.fits, lengths, tested, strict=False))
    per_ppm = np.concatenate([(PPM * length[on] / f.sigma[on]) ** 2 for f, length, on in fits])
    w2 = np.concatenate([f.standardised[on] ** 2 for f, _, on in fits])
    tried = np.linspace(-(before_ppm**2), MOST_PPM**2, 2)

    def slope(more: float) -> float:
        factor = 1.0 + more * per_ppm
        return float(np.sum(per_ppm / factor - w2 * per_ppm / factor**2))

    low, high = tried
    if not len(w2) or slope(low) >= 0.0:
        more = float(low)
    else:
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if slope(middle) > 0.0 else (middle, high)
        more = float(0.5 * (low + high))
    return float(np.clip(np.sqrt(max(before_ppm**2 + more, 0.0)), 0.0, MOST_PPM))
