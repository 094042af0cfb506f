"""Prediction of a field from measured points, with uncertainty: trend and Gaussian process (kriging).

    field(x) = trend(x) coefficients + smooth(x) + own(x)        measured = field + noise

The trend's coefficients are free. `smooth` has the covariance of Matern, s^2 (1 + r) exp(-r) with r = sqrt(3) distance
/ length; `own` is the independent part of each point (a panel's corner), variance p^2; the noise's covariance is known.
s, length and p are estimated by restricted likelihood, which is independent of the trend.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError

MOST = 300  # points for the estimation of the three parameters; above it an even selection
SPARE = 6  # minimum of points beyond the trend's coefficients
LEAST = 1e-8  # m: lower limit of a standard deviation
LONGEST = 4.0  # maximum length over the size of the set
EVALUATIONS = 120


@dataclass(frozen=True, eq=False)
class Roughness:
    """Covariance parameters of a field beside its trend.

    smooth   m, standard deviation of the smooth part
    length   m, correlation length
    own      m, standard deviation of the independent part of each point
    """

    smooth: float
    length: float
    own: float

    def covariance(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Covariance (n, m) m^2 of the smooth part between places (n, 2) and (m, 2) m.

        Source: [STEIN99], Matern's family at 3/2.
        """
        delta = first[:, None, :] - second[None, :, :]
        r = np.sqrt(3.0) * np.sqrt(np.einsum("nmi,nmi->nm", delta, delta)) / self.length
        return self.smooth**2 * (1.0 + r) * np.exp(-r)


@dataclass(frozen=True, eq=False)
class FieldPrediction:
    """Predicted field at m places, from k measured ones.

    value        (m,) m
    covariance   (m, m) m^2 of predicted less true
    weights      (m, k) of the measured values
    roughness    used
    """

    value: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    roughness: Roughness


def estimate_roughness(places: np.ndarray, values: np.ndarray, noise: np.ndarray, *, trend: np.ndarray) -> Roughness:
    """Smooth part, length and own part by restricted maximum likelihood.

    places   (k, 2) m
    values   (k,) m, measured
    noise    (k, k) m^2, covariance of the measurement
    trend    (k, q), of full rank

    Of more than 300 points an even selection is used. The uncertainty of the estimates is not propagated.
    Source: [PATTERSON71]. Raises EstimationError for fewer points than coefficients and six.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import minimize

    k, q = trend.shape
    if k < q + SPARE:
        raise EstimationError(f"{k} points for {q} coefficients of a trend (expected at least {q + SPARE} points)")
    if k > MOST:
        chosen = np.unique(np.linspace(0, k - 1, MOST).round().astype(int))
        places, values, trend = places[chosen], values[chosen], trend[chosen]
        noise = noise[np.ix_(chosen, chosen)]
    size = float(np.ptp(places, axis=0).max())
    # error contrasts: independent of the trend
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
    """Field measured at k points.

    places   (k, 2) m
    values   (k,) m: residuals after a fit with a design and its gain
    noise    (k, k) m^2, covariance of the measurement, before the fit
    trend    (k, q), whose columns include the span of the design
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
) -> FieldPrediction:
    """Best linear unbiased prediction (universal kriging), with the prediction error's covariance.

    measured       field at k points
    wanted         (m, 2) m
    wanted_trend   (m, q)
    roughness      of the field
    same           (m,) index of the measured point identical with a wanted one, which shares its own part; -1 for none
    design, gain   (k, p), (p, k): values = (1 - design gain) raw; the field is wanted less its fit by the gain,
                   wanted_design gain field
    wanted_design  (m, p)

    Source: [STEIN99]; value = trend* b + c^T V^-1 (values - trend b), V = smooth + own + noise. With the weights K the
    prediction error is (K field - field*) + (K - wanted_design gain) noise, which gives its covariance for any
    roughness. Raises EstimationError if the points do not determine the trend.
    """
    places, values, noise, trend = measured.places, measured.values, measured.noise, measured.trend
    smooth = roughness.covariance(places, places)
    smooth[np.diag_indices_from(smooth)] += roughness.own**2
    between = roughness.covariance(wanted, places)
    shared = np.flatnonzero(same >= 0)
    between[shared, same[shared]] += roughness.own**2
    prior_covariance = roughness.covariance(wanted, wanted)
    prior_covariance[np.diag_indices_from(prior_covariance)] += roughness.own**2
    total = smooth + noise
    total[np.diag_indices_from(total)] += LEAST**2  # regularisation where there is neither noise nor own part
    try:
        factor = np.linalg.cholesky(total)
    except np.linalg.LinAlgError as problem:
        raise EstimationError(
            f"the covariance of {len(places)} measured points is not positive definite; is a point duplicated?"
        ) from problem
    from scipy.linalg import cho_solve

    solved = cho_solve((factor, True), trend)
    square = trend.T @ solved
    if not np.linalg.cond(square / np.sqrt(np.outer(np.diag(square), np.diag(square)))) < 1e14:
        raise EstimationError(f"{len(places)} points do not determine the {trend.shape[1]} coefficients of the trend")
    simple = cho_solve((factor, True), between.T).T  # (m, k)
    weights = simple + (wanted_trend - simple @ trend) @ np.linalg.solve(square, solved.T)
    crossed = weights @ between.T
    missed = weights @ smooth @ weights.T - crossed - crossed.T + prior_covariance
    noise_gain = weights if design is None or gain is None or wanted_design is None else weights - wanted_design @ gain
    return FieldPrediction(weights @ values, missed + noise_gain @ noise @ noise_gain.T, weights, roughness)
