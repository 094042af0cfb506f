"""Field tomography from line means: Gauss-Markov estimation with correlation lengths, no grid.

A scalar field and, optionally, a vector field are Gaussian processes about unknown means; an observation is the mean of
the scalar along a line, plus a multiple of the mean of the vector's component along it, plus systematic parameters with
priors, plus noise. The best linear estimate of any mean along any other line follows from covariances of line means
alone, which are integrals of the correlation along both lines: exact in one (error function), Gauss-Legendre in the
other, to 1e-9. Points are lines of length zero. Lengths of correlation may differ by axis: lines stay lines and their
means stay means when axes are scaled. A field of several scales is a sum.

Source: [TARANTOLA05] section 3.2 (least squares with Gaussian priors), [RASMUSSEN06] sections 2.7 (unknown mean), 5.4
(an observation predicted from the others).
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError, ValidityError

NODES, NODES_PER_LENGTH = 8, 5  # Gauss-Legendre nodes: constant, and per correlation length
LONGEST = 500.0  # correlation lengths: limit of a line's length (number of nodes)
SHORT = 1e-4  # correlation lengths: a shorter line is replaced by its mid-point, accurate to 1e-9
SUSPECT = 3.29  # of a standard normal variable: 1 in 1000
WORST_CONDITION = 1e13


@dataclass(frozen=True)
class Scale:
    """One scale of a field: covariance sigma² exp(-d²/2), d the distance in correlation lengths.

    sigma     standard deviation, in the field's unit
    lengths   correlation lengths along x, y, z, m; infinity for a field that does not change along an axis
    """

    sigma: float
    lengths: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma) and self.sigma >= 0.0):
            raise ValidityError(f"standard deviation {self.sigma:g} of a field's scale is not 0 or more")
        if len(self.lengths) != 3 or not all(length > 0.0 for length in self.lengths):
            raise ValidityError(
                f"correlation lengths {self.lengths} m of a field's scale are not three or are not all above 0"
            )


@dataclass(frozen=True)
class FieldPrior:
    """Prior of a field: mean and scales.

    mean     expected mean, in the field's unit
    u_mean   its standard uncertainty, common to all of space
    scales   of the field's variation about its mean
    """

    mean: float
    u_mean: float
    scales: tuple[Scale, ...] = ()


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines between points, m.

    start, end   (m, 3); equal for a point
    """

    start: np.ndarray
    end: np.ndarray

    @property
    def directions(self) -> np.ndarray:
        """Unit vectors (m, 3) from start to end; zero for points."""
        d = self.end - self.start
        length = np.linalg.norm(d, axis=1, keepdims=True)
        return d / np.where(length > 0.0, length, 1.0)


@dataclass(frozen=True, eq=False)
class LineMeans:
    """Observed line means of the scalar field, with vector and systematic contributions.

    observed = mean of the scalar along each line + along x mean of the vector's component + design x parameters.

    lines        of the m observations
    observed     (m,) in the scalar's unit
    covariance   (m, m) of the noise
    along        (m,) contribution of one unit of the vector along the line's direction; zero without a vector field
    design       (m, q) derivatives by systematic parameters, expected zero
    sigmas       (q,) their prior standard uncertainties
    """

    lines: Lines
    observed: np.ndarray
    covariance: np.ndarray
    along: np.ndarray
    design: np.ndarray
    sigmas: np.ndarray


@dataclass(frozen=True, eq=False)
class Means:
    """Estimated means along t lines, jointly with the systematic parameters.

    value        (t,) in the field's unit
    covariance   (t, t)
    parameters   (q,) estimates of the systematic parameters
    cross        (t, q) covariance of the means with them
    resolution   (t,) 1 - posterior over prior variance: 0 without information, 1 for complete information
    weights      (t, m) of the observations
    """

    value: np.ndarray
    covariance: np.ndarray
    parameters: np.ndarray
    cross: np.ndarray
    resolution: np.ndarray
    weights: np.ndarray

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (t,) of the means."""
        return np.sqrt(np.diag(self.covariance))


def line_covariance(a: Lines, b: Lines, scales: tuple[Scale, ...]) -> np.ndarray:
    """Covariance (m, n) of a field's means along m lines with those along n others.

    a, b     lines
    scales   of the field, its mean not counted

    Source: the double integral of the correlation along both lines over their lengths; derived in this file. Accurate
    to 1e-9 of the variance.

    >>> one = Lines(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    >>> round(float(line_covariance(one, one, (Scale(1.0, (1.0, 1.0, 1.0)),))[0, 0]), 6)
    0.92431
    """
    total = np.zeros((len(a.start), len(b.start)))
    for scale in scales:
        total += scale.sigma**2 * _correlation(a, b, np.asarray(scale.lengths, float))
    return total


@dataclass(frozen=True, eq=False)
class Tomogram:
    """Estimated fields, to be evaluated along lines.

    chi_square           of the observations about their prediction from the priors: expectation m, variance 2 m
    degrees_of_freedom   m
    predicted            (m,) each observation from all others
    standardised         (m,) observed less predicted over its standard deviation: standard normal if the model holds
    suspects             indices of observations that contradict the others, worst first: beyond 3.29 when it and
                         those before it are left out; reported only, all observations are in the estimate
    """

    observations: LineMeans
    scalar: FieldPrior
    vector: FieldPrior | None
    chi_square: float
    degrees_of_freedom: int
    predicted: np.ndarray
    standardised: np.ndarray
    suspects: np.ndarray
    inverse: np.ndarray
    innovation: np.ndarray

    def scalar_along(self, lines: Lines) -> Means:
        """Means of the scalar field along lines, or its values at points."""
        observed = self.observations.lines
        prior = line_covariance(lines, lines, self.scalar.scales) + self.scalar.u_mean**2
        cross = line_covariance(lines, observed, self.scalar.scales) + self.scalar.u_mean**2
        return self._means(np.full(len(prior), self.scalar.mean), prior, cross)

    def vector_along(self, lines: Lines, directions: np.ndarray) -> Means:
        """Means along lines of the vector field's component in given directions, (t, 3) unit vectors.

        Raises EstimationError if no vector field was estimated.
        """
        if self.vector is None:
            raise EstimationError("no vector field was estimated; give its prior")
        observed, u2 = self.observations.lines, self.vector.u_mean**2
        prior = (line_covariance(lines, lines, self.vector.scales) + u2) * (directions @ directions.T)
        cross = (line_covariance(lines, observed, self.vector.scales) + u2) * (directions @ observed.directions.T)
        return self._means(np.zeros(len(prior)), prior, cross * self.observations.along)

    def _means(self, mean: np.ndarray, prior: np.ndarray, cross: np.ndarray) -> Means:
        weights = cross @ self.inverse
        variance = self.observations.sigmas**2
        with_parameters = variance[:, None] * self.observations.design.T  # (q, m) covariance with the observations
        covariance = prior - weights @ cross.T
        before = np.diag(prior)
        return Means(
            value=mean + weights @ self.innovation,
            covariance=0.5 * (covariance + covariance.T),
            parameters=with_parameters @ self.inverse @ self.innovation,
            cross=-weights @ with_parameters.T,
            resolution=1.0 - np.diag(covariance) / np.where(before > 0.0, before, 1.0),
            weights=weights,
        )

    def parameter_covariance(self) -> np.ndarray:
        """Covariance (q, q) of the systematic parameters."""
        variance = self.observations.sigmas**2
        with_parameters = variance[:, None] * self.observations.design.T
        return np.diag(variance) - with_parameters @ self.inverse @ with_parameters.T


def tomogram(observations: LineMeans, scalar: FieldPrior, vector: FieldPrior | None = None) -> Tomogram:
    """Best estimate of the fields from line means, given their priors.

    observations   means along lines, in the scalar's unit
    scalar         prior of the scalar field
    vector         prior of each component of the vector field, expected mean 0; None: no such field

    Source: [TARANTOLA05] section 3.2 in the space of observations; [RASMUSSEN06] eq. 5.12 (each observation from
    the others). Raises EstimationError for exactly contradictory observations, ValidityError for inconsistent shapes.
    """
    _check(observations, vector)
    lines = observations.lines
    total = line_covariance(lines, lines, scalar.scales) + scalar.u_mean**2 + observations.covariance
    total = total + (observations.design * observations.sigmas**2) @ observations.design.T
    if vector is not None:
        k = (line_covariance(lines, lines, vector.scales) + vector.u_mean**2) * (lines.directions @ lines.directions.T)
        total = total + np.outer(observations.along, observations.along) * k
    total = 0.5 * (total + total.T)
    root = np.sqrt(np.diag(total))
    scaled = total / np.outer(root, root)
    values, vectors = np.linalg.eigh(scaled)
    if not values[0] > values[-1] / WORST_CONDITION:
        raise EstimationError(
            "singular covariance: two observations of one line without noise; give their noise, or leave one out"
        )
    inverse = (vectors / values) @ vectors.T / np.outer(root, root)
    innovation = observations.observed - scalar.mean
    weighted = inverse @ innovation
    variance = 1.0 / np.diag(inverse)  # of an observation about its prediction from the others
    standardised = weighted * np.sqrt(variance)
    return Tomogram(
        observations=observations,
        scalar=scalar,
        vector=vector,
        chi_square=float(innovation @ weighted),
        degrees_of_freedom=len(innovation),
        predicted=observations.observed - weighted * variance,
        standardised=standardised,
        suspects=_suspects(inverse, innovation),
        inverse=inverse,
        innovation=innovation,
    )


def _suspects(inverse: np.ndarray, innovation: np.ndarray) -> np.ndarray:
    """Suspect observations, removed one by one (a gross error affects its neighbours), at most half of all."""
    inverse, rejected = inverse.copy(), []
    mask = np.ones(len(innovation), dtype=bool)
    for _ in range(len(innovation) // 2):
        diagonal = np.where(mask, np.diag(inverse), 1.0)
        score = np.where(mask, np.abs(inverse @ np.where(mask, innovation, 0.0)) / np.sqrt(diagonal), 0.0)
        worst = int(np.argmax(score))
        if score[worst] <= SUSPECT:
            break
        rejected.append(worst)
        mask[worst] = False
        inverse -= np.outer(inverse[:, worst], inverse[worst]) / inverse[worst, worst]  # of the matrix without its row
    return np.array(rejected, dtype=int)


def _correlation(a: Lines, b: Lines, lengths: np.ndarray) -> np.ndarray:
    """Mean (m, n) of exp(-d²/2) over both lines: closed form along b, quadrature along a."""
    from scipy.special import erf

    p, u = a.start / lengths, (a.end - a.start) / lengths
    q, v = b.start / lengths, (b.end - b.start) / lengths
    longest = float(np.max(np.linalg.norm(u, axis=1), initial=0.0))
    if not longest <= LONGEST:
        raise ValidityError(
            f"a line of {longest:g} correlation lengths is longer than {LONGEST:g}: shorten the line, or give the "
            "field a longer scale (so small a scale averages out)"
        )
    size = np.linalg.norm(v, axis=1)
    point = size < SHORT
    q, v, size = np.where(point[:, None], q + 0.5 * v, q), np.where(point[:, None], 0.0, v), np.where(point, 1.0, size)
    unit = v / size[:, None]
    x, weight = np.polynomial.legendre.leggauss(NODES + int(np.ceil(NODES_PER_LENGTH * longest)))
    total = np.zeros((len(p), len(q)))
    for at, share in zip(0.5 * (x + 1.0), 0.5 * weight, strict=True):
        r = (p + at * u)[:, None, :] - q  # (m, n, 3)
        foot = np.einsum("mnk,nk->mn", r, unit)
        off = np.maximum(np.einsum("mnk,mnk->mn", r, r) - foot**2, 0.0)
        inside = np.sqrt(np.pi / 2.0) / size * (erf((size - foot) / np.sqrt(2.0)) + erf(foot / np.sqrt(2.0)))
        total += share * np.exp(-0.5 * off) * np.where(point, 1.0, inside)
    return total


def _check(observations: LineMeans, vector: FieldPrior | None) -> None:
    m, q = len(observations.observed), len(observations.sigmas)
    shapes = {
        "start": (observations.lines.start.shape, (m, 3)),
        "end": (observations.lines.end.shape, (m, 3)),
        "covariance": (observations.covariance.shape, (m, m)),
        "along": (observations.along.shape, (m,)),
        "design": (observations.design.shape, (m, q)),
    }
    for name, (got, expected) in shapes.items():
        if got != expected:
            raise ValidityError(f"{name} of {m} line means has the shape {got}, expected {expected}")
    if m == 0:
        raise EstimationError("no observation of a mean along a line")
    if not np.all(np.isfinite(observations.observed)):
        raise ValidityError("an observed mean along a line is not a number; leave it out")
    if vector is None and np.any(observations.along != 0.0):
        raise ValidityError("observations depend on a vector field, but none has a prior")
