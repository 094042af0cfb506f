"""Adjustment of a baseline: pillars, and zero, scale and cyclic terms of an instrument.

observed = (1 + scale) D + zero + cyclic + systematic effects + noise, along the slope. Pillars are nearly in line and
in a plane, x along the line from the first to the last and y to its left; with horizontal directions both are
estimated, without them y stays as given.

Shots on one target from one set-up, a *set*, share pointing, centring and momentary air. The noise of a set's mean over
n shots has the variance shot/n + set + air D², and the three components are estimated from the scatter within sets and
between them. Effects common to all (thermometer, heights, a known scale) are given as one column each, for one standard
uncertainty, and give a full covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.baseline.model import (
    BaselineModel,
    BaselineSights,
    Claim,
    Extra,
    KnownPlaces,
    Normal,
    pillar_label,
)

FLOOR = np.array([1e-7, 1e-7, 1e-9]) ** 2  # m², m², ratio²: no distance meter is better
CEILING = np.array([0.1, 0.1, 1e-3]) ** 2
LEAST_FREEDOM = 4  # between sets; below it the claim is used
SEPARABLE = 1e-3  # smallest singular value of unit columns: below it terms are inseparable
STEP = 1e-9  # m, that ends the iteration
CONTROLLED = 1e-9  # share of a set's variance in its residual; less is rounding
NEARLY = 0.05  # m: minimum advantage of the best order of the pillars
ORDERS = 256  # of the pillars, limit of candidates


@dataclass(frozen=True, eq=False)
class BaselineSolution:
    """Adjusted baseline.

    names        (u,) of the parameters: "x 1", "y 1" by the pillars' numbers, "zero", "scale", extras, "orientation 0"
    values       (u,) m, and rad for orientations
    covariance   (u, u), including the uncertainty of the estimated noise
    x, y         (n,) m
    noise        variance components
    u_noise      (3,) their standard uncertainties; nan if not estimated from these data
    residual     (M,) of the sets' means, observed minus adjusted, m
    redundancy   (M,) redundancy number of each set
    w_set        (M,) standardised residual of each set; nan if unchecked
    alike        (M, M) correlation of these: sets of 1 or -1 are inseparable
    w_shot       (m,) of each shot; nan if single in its set
    freedom_sets, freedom_shots   redundant sets, redundant shots within sets
    sets_squares      weighted squares of all but the scatter within sets; without directions chi² of freedom_sets
    variance_factor   weighted squares of sets and shots over the degrees of freedom; expectation 1 under the noise
    parts        standard deviation of each parameter by cause: cause -> (u,)
    used         the shots
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    x: np.ndarray
    y: np.ndarray
    noise: Claim
    u_noise: np.ndarray
    residual: np.ndarray
    redundancy: np.ndarray
    w_set: np.ndarray
    alike: np.ndarray
    w_shot: np.ndarray
    freedom_sets: int
    freedom_shots: int
    sets_squares: float
    variance_factor: float
    parts: dict[str, np.ndarray]
    used: BaselineSights

    def of(self, name: str) -> tuple[float, float]:
        """Parameter and its standard uncertainty; nan, nan if unknown."""
        if name not in self.names:
            return float("nan"), float("nan")
        at = self.names.index(name)
        return float(self.values[at]), float(np.sqrt(self.covariance[at, at]))

    def freedom_of(self, name: str) -> float:
        """Effective degrees of freedom of a parameter's u (Welch-Satterthwaite).

        Those of the sets for the part from their scatter, infinite for the other parts; infinite if the noise is not
        estimated from these data. Source: [JCGM100] G.4.1, Welch and Satterthwaite.
        """
        at = self.names.index(name)
        if not np.isfinite(self.u_noise).any():
            return float("inf")
        estimated = self.parts["noise"][at] ** 2 + self.parts["noise, as it is estimated"][at] ** 2
        return max(self.freedom_sets, 1) * float(self.covariance[at, at] / max(estimated, 1e-300)) ** 2

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r,) of [x, y] with an uncertainty, as in `KnownPlaces`, and covariance (r, r), m²."""
        at = [i for i, name in enumerate(self.names) if name[:2] in ("x ", "y ")]
        rows = [int(self.names[i][2:]) + (len(self.x) if self.names[i][0] == "y" else 0) for i in at]
        return np.array(rows, int), self.covariance[np.ix_(at, at)]


@dataclass(frozen=True, eq=False)
class BaselineNoise:
    """Prior information on the noise of a baseline.

    noise        variances to use; None: estimate them
    claim        variances to use if the data have too little redundancy to estimate them
    u_centring   of instrument and target across the line, for directions only, m
    """

    noise: Claim | None = None
    claim: Claim | None = None
    u_centring: float = 2e-4


ESTIMATED = BaselineNoise()


def adjust_baseline(
    sights: BaselineSights,
    x,
    y,
    *,
    known: KnownPlaces | None = None,
    scale: bool = False,
    extra: Extra | None = None,
    before: BaselineNoise = ESTIMATED,
) -> BaselineSolution:
    """Pillars and instrument constants by least squares, with variance components.

    sights       shots
    x, y         (n,) approximate positions, see `places_in_line`, m; without directions y is fixed
    known        prior positions; else the pillar of smallest x fixes x and y, the one of largest x its y
    scale        True: estimate the instrument's scale, which needs `known`
    extra        further terms
    before       prior information on the noise; else it is estimated

    Raises EstimationError if the shots do not determine the parameters, or the noise.
    Source: least squares with correlated observations; restricted likelihood of the components, [PATTERSON71].
    """
    x, y = np.array(x, float), np.array(y, float)
    model = BaselineModel(sights, x, y, known, scale, extra, before.u_centring)
    noise, claim = before.noise, before.claim
    start = noise or claim or Claim(1e-8, 1e-7, 1e-12)
    values = np.zeros(len(model.names))
    for _ in range(20):
        step, _ = model.step(values, start)
        values = values + step
        if np.max(np.abs(step[: model.lengths]), initial=0.0) < STEP:
            break
    else:
        raise EstimationError("the pillars' positions do not converge in 20 steps: give better approximate positions")
    freedom = model.freedom_sets
    u_noise = np.full((3, 3), np.nan)
    if noise is None and freedom < LEAST_FREEDOM:
        if claim is None:
            raise EstimationError(
                f"{freedom} redundant sets cannot determine the noise: give the instrument's specification"
            )
        noise = claim
    elif noise is None:
        noise, u_noise = _components(model, values)
    for _ in range(2):
        step, normal = model.step(values, noise)
        values = values + step
    return _solution(model, values, noise, u_noise, normal)


def _components(model: BaselineModel, values: np.ndarray) -> tuple[Claim, np.ndarray]:
    """Restricted maximum likelihood of shot, set and air variances, with lower limits.

    With covariance (3, 3).
    """
    from scipy.optimize import minimize

    y, a = model.rows(values)
    cofactors, m = model.cofactors(), len(model.distance)
    squares = float(np.sum(model.sights.within**2))
    repeats = len(model.sights) - m
    active = np.array([repeats > 0, True, True])
    low, high = np.log(FLOOR), np.log(CEILING)

    def all_of(theta):
        values = np.zeros(3)
        values[active] = np.exp(theta)
        return values

    def criterion(theta):
        values = all_of(theta)
        normal = Normal(y, a, model.variance(Claim(*values)), model.labels)
        py = (normal.p @ y)[:m]
        diagonal = np.diag(normal.p)[:m]
        total = normal.log_v + normal.log_n + float(y @ normal.p @ y)
        slope = cofactors @ (diagonal - py**2)
        if repeats:
            total += repeats * theta[0] + squares / values[0]
            slope[0] += repeats / values[0] - squares / values[0] ** 2
        return total, (slope * values)[active]

    shot = squares / repeats if repeats else 0.0
    spread = float(np.var(Normal(y, a, model.variance(Claim(shot, 1e-7, 1e-12)), model.labels).y[:m])) + 1e-12
    begin = np.log(np.clip([max(shot, 1e-12), spread, 1e-12], FLOOR, CEILING))[active]
    bounds = list(zip(low[active], high[active], strict=True))
    tries = [begin, begin + np.log([0.1, 10.0])[[0] * (len(begin) - 1) + [1]]]
    best = min((minimize(criterion, t, jac=True, method="L-BFGS-B", bounds=bounds) for t in tries), key=lambda r: r.fun)
    components = all_of(best.x)
    return Claim(*components), _component_covariance(model, y, a, components, active, repeats)


def _component_covariance(model, y, a, components, active, repeats):
    """Covariance from the expected information, half the trace of P Q P Q."""
    m = len(model.distance)
    normal = Normal(y, a, model.variance(Claim(*components)), model.labels)
    cofactors = model.cofactors()
    information = 0.5 * cofactors @ normal.p[:m, :m] ** 2 @ cofactors.T
    if repeats:
        information[0, 0] += 0.5 * repeats / components[0] ** 2
    covariance = np.full((3, 3), np.nan)
    part = information[np.ix_(active, active)]
    size = 1.0 / np.sqrt(np.diag(part))
    covariance[np.ix_(active, active)] = np.linalg.pinv(part * size[:, None] * size, rcond=1e-10) * size[:, None] * size
    return covariance


def _of_estimated_noise(model: BaselineModel, noise: Claim, covariance: np.ndarray, normal: Normal) -> np.ndarray:
    """Additional covariance of the parameters due to estimated weights.

    One part is the scatter by wrong weights, the other the bias of weights fitted to the residuals: 2 sum W_ij G Q_i P
    Q_j G', with G the gain, W the components' covariance. Components at their lower limit count as known.

    Source: [KENWARD97], for covariances linear in their components.
    """
    m = len(model.distance)
    values = np.array([noise.shot, 0.0, 0.0]) + np.array([0.0, np.mean(noise.set), noise.air])
    free = np.flatnonzero(np.isfinite(np.diag(covariance)) & (values > 1.001 * FLOOR))
    scaled = normal.gain[:, None, :m] * model.cofactors()[free]
    return 2.0 * np.einsum("aik,kl,bjl,ij->ab", scaled, normal.p[:m, :m], scaled, covariance[np.ix_(free, free)],
                           optimize=True)  # fmt: skip


def _solution(model: BaselineModel, values, noise: Claim, u_noise: np.ndarray, normal: Normal) -> BaselineSolution:
    m, sights = len(model.distance), model.sights
    extra = _of_estimated_noise(model, noise, u_noise, normal)
    misclosure, _ = model.rows(values)
    py, diagonal = normal.p @ misclosure, np.diag(normal.p)
    p = normal.p[:m, :m]
    controlled = diagonal[:m] * np.diag(normal.v)[:m] > CONTROLLED
    size = np.sqrt(np.where(controlled, diagonal[:m], np.nan))
    w_set = py[:m] / size
    repeats = len(sights) - m
    n = model.shots[sights.set]
    w_shot = np.full(len(sights), np.nan)
    squares = 0.0
    if repeats:
        several = n > 1
        top = sights.within / noise.shot + py[:m][sights.set] / n
        bottom = (1.0 - 1.0 / n) / noise.shot + diagonal[:m][sights.set] / n**2
        w_shot[several] = (top / np.sqrt(bottom))[several]
        squares = float(np.sum(sights.within**2)) / noise.shot
    weighed = float(misclosure @ normal.p @ misclosure)
    freedom = len(misclosure) - len(model.names) + repeats
    x, y = model.at(values)
    total = values.copy()
    total[: model.lengths] = np.concatenate([x, y])[model.free]
    return BaselineSolution(
        names=model.names,
        values=total,
        covariance=normal.covariance + extra,
        x=x,
        y=y,
        noise=noise,
        u_noise=np.sqrt(np.diag(u_noise)),
        residual=misclosure[:m],
        redundancy=np.einsum("ij,ji->i", normal.p[:m], normal.v[:, :m]),
        w_set=w_set,
        alike=p / size[:, None] / size,
        w_shot=w_shot,
        freedom_sets=model.freedom_sets,
        freedom_shots=repeats,
        sets_squares=weighed,
        variance_factor=(weighed + squares) / freedom if freedom > 0 else float("nan"),
        parts={**_parts(model, noise, normal), "noise, as it is estimated": np.sqrt(np.diag(extra))},
        used=sights,
    )


def _parts(model: BaselineModel, noise: Claim, normal: Normal) -> dict[str, np.ndarray]:
    m, a = len(model.distance), len(model.aimed)
    v, gain = model.noise_only(noise), normal.gain
    causes = {"noise": np.sqrt(np.einsum("ij,jk,ik->i", gain[:, :m], v[:m, :m], gain[:, :m]))}
    if a:
        aim = gain[:, m : m + a]
        causes["directions"] = np.sqrt(np.einsum("ij,jk,ik->i", aim, v[m : m + a, m : m + a], aim))
    for q, name in enumerate(model.sights.effects):
        causes[name] = np.abs(gain[:, :m] @ model.systematic[:, q])
    if model.known is not None:
        prior = gain[:, m + a :]
        causes["known pillars"] = np.sqrt(np.einsum("ij,jk,ik->i", prior, model.known.covariance, prior))
    return causes


def separation(
    sights: BaselineSights, solution: BaselineSolution, extra: Extra, *, known: KnownPlaces | None, scale: bool
) -> float:
    """Separability of further terms: smallest singular value of weighted unit columns."""
    model = BaselineModel(sights, solution.x, solution.y, known, scale, extra, 2e-4)
    return model.step(np.zeros(len(model.names)), solution.noise)[1].separation


def places_in_line(
    start: Sequence[int], end: Sequence[int], distance, *, count: int, names: Sequence[str] = ()
) -> np.ndarray:
    """Approximate positions (count,) m of pillars along a line, from distances between them.

    start, end   (m,) numbers of pillars
    distance     (m,) m
    count        number of pillars
    names        of the pillars by number, for messages; empty: numbers

    The lower number is on the left. Raises EstimationError for a pillar whose side the distances do not determine.

    Pillars are placed one after the other, on either side of the previous ones; closing distances determine the side.
    >>> places_in_line([0, 0, 1], [1, 2, 2], [20.0, 120.0, 100.0], count=3)
    array([  0.,  20., 120.])
    """
    length: dict[tuple[int, int], float] = {}
    for i, j, d in zip(start, end, distance, strict=True):
        length[(int(i), int(j))] = length[(int(j), int(i))] = float(d)
    for p in range(count):
        ties = sum((p, q) in length for q in range(count))
        if ties < 2 < count:
            raise EstimationError(
                f"{pillar_label(p, names)} has {ties} distances to the others: measure it to at least two"
            )
    (low, high), longest = max(length.items(), key=lambda item: (item[1], -item[0][0]))
    low, high = min(low, high), max(low, high)
    orders = [(0.0, {low: 0.0, high: longest})]
    while len(placed := orders[0][1]) < count:
        tied = {p: [(q, length[(p, q)]) for q in placed if (p, q) in length] for p in range(count) if p not in placed}
        pillar = max(tied, key=lambda p: len(tied[p]))
        if not tied[pillar]:
            ends = f"{pillar_label(pillar, names)} to {pillar_label(low, names)}"
            raise EstimationError(f"no distance joins {ends}: measure one")
        longer = []
        for misfit, place in orders:
            guesses: list[float] = []
            for g in (place[q] + sign * d for q, d in tied[pillar] for sign in (1, -1)):
                if all(abs(g - guess) > NEARLY for guess in guesses):
                    guesses.append(g)
            for g in guesses:
                more = sum(abs(abs(g - place[q]) - d) for q, d in tied[pillar])
                longer.append((misfit + more, {**place, pillar: g}))
        orders = sorted(longer, key=lambda order: order[0])[:ORDERS]
    if len(orders) > 1 and orders[1][0] < orders[0][0] + NEARLY:
        side = next(p for p in range(count) if abs(orders[1][1][p] - orders[0][1][p]) > NEARLY)
        raise EstimationError(
            f"the distances do not determine on which side {pillar_label(side, names)} is: measure more pairs"
        )
    return np.array([orders[0][1][p] for p in range(count)])
