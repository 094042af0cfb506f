"""A field known at some points, foretold at others with its uncertainty: trend and Gaussian process (kriging).

    field(x) = trend(x) coefficients + smooth(x) + own(x)        measured = field + noise

The trend's coefficients are free. `smooth` has the covariance of Matern, s^2 (1 + r) exp(-r) with r = sqrt(3) distance
/ length; `own` is what each point has for itself (a panel's corner), p^2, independent; the noise's covariance is given.
s, length and p are found by restricted likelihood, in which the trend takes no part.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError

MOST = 300  # points for the search of the three numbers; of more an even choice
SPARE = 6  # points beyond the trend's coefficients, at least
LEAST = 1e-8  # m: below it a standard deviation is nothing
LONGEST = 4.0  # length over the size of the set
EVALUATIONS = 120


@dataclass(frozen=True, eq=False)
class Roughness:
    """What a field does beside its trend.

    smooth   m, standard deviation of the smooth part
    length   m, over which it changes
    own      m, standard deviation of what each point has for itself
    """

    smooth: float
    length: float
    own: float

    def covariance(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """(n, m) m^2 of the smooth part between places (n, 2) and (m, 2) m.

        Source: [STEIN99], Matern's family at 3/2.
        """
        delta = first[:, None, :] - second[None, :, :]
        r = np.sqrt(3.0) * np.sqrt(np.einsum("nmi,nmi->nm", delta, delta)) / self.length
        return self.smooth**2 * (1.0 + r) * np.exp(-r)


@dataclass(frozen=True, eq=False)
class Foretold:
    """The field at m places, from k measured ones.

    value        (m,) m
    covariance   (m, m) m^2 of foretold less true
    weights      (m, k) by which the measured values enter
    roughness    that was used
    """

    value: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    roughness: Roughness


def find_roughness(places: np.ndarray, values: np.ndarray, noise: np.ndarray, *, trend: np.ndarray) -> Roughness:
    """Smooth part, length and own part by restricted maximum likelihood.

    places   (k, 2) m
    values   (k,) m, measured
    noise    (k, k) m^2, covariance of the measurement
    trend    (k, q), of full rank

    Of more than 300 points an even choice of them counts. Their own uncertainty is not carried on.
    Source: [PATTERSON71]. Raises EstimationError for fewer points than coefficients and six.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import minimize

    k, q = trend.shape
    if k < q + SPARE:
        raise EstimationError(f"{k} points beside {q} coefficients of a trend (expected {q + SPARE} points at least)")
    if k > MOST:
        chosen = np.unique(np.linspace(0, k - 1, MOST).round().astype(int))
        places, values, trend = places[chosen], values[chosen], trend[chosen]
        noise = noise[np.ix_(chosen, chosen)]
    size = float(np.ptp(places, axis=0).max())
    # error contrasts: what the trend cannot touch
    contrast = np.linalg.qr(trend, mode="complete")[0][:, q:]
    contrasts, contrast_noise = contrast.T @ values, contrast.T @ noise @ contrast
    spread = max(float(np.std(contrasts)), LEAST)
    least, most = np.log(LEAST / spread), np.log(1e3)
    shortest = size / (2.0 * np.sqrt(len(places)))
    span = (np.log(shortest / size), np.log(LONGEST))

    def cost(parameters: np.ndarray) -> float:
        guess = _roughness(parameters, spread, size)
        matrix = contrast.T @ guess.covariance(places, places) @ contrast + contrast_noise
        matrix[np.diag_indices_from(matrix)] += guess.own**2 + LEAST**2
        try:
            factor = np.linalg.cholesky(matrix / spread**2)
        except np.linalg.LinAlgError:
            return 1e12
        white = solve_triangular(factor, contrasts / spread, lower=True)
        return float(np.sum(np.log(np.diag(factor))) + 0.5 * white @ white)

    starts = [(np.log(0.7), np.log(share), np.log(0.7)) for share in (0.1, 0.5)]
    minima = [
        minimize(
            cost, start, method="L-BFGS-B", bounds=((least, most), span, (least, most)),
            options={"maxfun": EVALUATIONS},
        )
        for start in starts
    ]  # fmt: skip
    return _roughness(min(minima, key=lambda f: float(f.fun)).x, spread, size)


def _roughness(parameters: np.ndarray, spread: float, size: float) -> Roughness:
    smooth, length, own = np.exp(parameters)
    return Roughness(float(smooth) * spread, float(length) * size, float(own) * spread)


@dataclass(frozen=True, eq=False)
class MeasuredField:
    """A field as it was measured at k points.

    places   (k, 2) m
    values   (k,) m: what is left when a design and its gain have taken their part
    noise    (k, k) m^2, covariance of the measurement, before that
    trend    (k, q), whose columns span those of the design too
    """

    places: np.ndarray
    values: np.ndarray
    noise: np.ndarray
    trend: np.ndarray


def foretell(
    measured: MeasuredField,
    wanted: np.ndarray,
    wanted_trend: np.ndarray,
    *,
    roughness: Roughness,
    same: np.ndarray,
    design: np.ndarray | None = None,
    gain: np.ndarray | None = None,
    wanted_design: np.ndarray | None = None,
) -> Foretold:
    """Best linear unbiased prediction (universal kriging), with the covariance of what it misses.

    measured       what is known, at k points
    wanted         (m, 2) m
    wanted_trend   (m, q)
    roughness      of the field
    same           (m,) the measured point that a wanted one is, which shares its own part; -1 for none
    design, gain   (k, p), (p, k): values = (1 - design gain) raw; the field is wanted less what the gain would find in
                   the true field, wanted_design gain field
    wanted_design  (m, p)

    Source: [STEIN99]; value = trend* b + c^T V^-1 (values - trend b), V = smooth + own + noise. With the weights K the
    prediction misses by (K field - field*) + (K - wanted_design gain) noise, which gives its covariance whatever the
    roughness is. Raises EstimationError where the points do not hold the trend.
    """
    places, values, noise, trend = measured.places, measured.values, measured.noise, measured.trend
    smooth = roughness.covariance(places, places)
    smooth[np.diag_indices_from(smooth)] += roughness.own**2
    between = roughness.covariance(wanted, places)
    shared = np.flatnonzero(same >= 0)
    between[shared, same[shared]] += roughness.own**2
    beyond = roughness.covariance(wanted, wanted)
    beyond[np.diag_indices_from(beyond)] += roughness.own**2
    whole = smooth + noise
    whole[np.diag_indices_from(whole)] += LEAST**2  # a rounding's worth, where neither noise nor own part is
    try:
        factor = np.linalg.cholesky(whole)
    except np.linalg.LinAlgError as problem:
        raise EstimationError(
            f"the covariance of {len(places)} measured points is not positive definite; is a point there twice?"
        ) from problem
    from scipy.linalg import cho_solve

    solved = cho_solve((factor, True), trend)
    square = trend.T @ solved
    if not np.linalg.cond(square / np.sqrt(np.outer(np.diag(square), np.diag(square)))) < 1e14:
        raise EstimationError(f"{len(places)} points do not hold the {trend.shape[1]} coefficients of the trend")
    simple = cho_solve((factor, True), between.T).T  # (m, k)
    weights = simple + (wanted_trend - simple @ trend) @ np.linalg.solve(square, solved.T)
    crossed = weights @ between.T
    missed = weights @ smooth @ weights.T - crossed - crossed.T + beyond
    heard = weights if design is None or gain is None or wanted_design is None else weights - wanted_design @ gain
    return Foretold(weights @ values, missed + heard @ noise @ heard.T, weights, roughness)
