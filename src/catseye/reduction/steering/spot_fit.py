"""Fit of the spot in a scan over a retroreflector.

Its centre, in counts, with uncertainty.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.mirror.search_pattern import count_size, counts_of_offsets, offsets_of_counts
from catseye.optics.spot import gaussian_spot

FOUND = "found"
UNIFORM = 1.0 / np.sqrt(12.0)  # standard uncertainty of a value rounded to a whole count
FEWEST = 8  # readings for six parameters, with some to test them
FLAT_PRIOR = 1.5  # of the root of flatness - 1: real spots have 0 to 2
SINGULAR = 1e-10  # least eigenvalue of the parameters' correlations
FEWEST_LIT = 3  # readings of a spot
TIMES_NOISE = 5.0  # above the background: such a reading is lit
BOUNDS = np.array([20.0, 20.0, 3.0, np.inf, np.inf, 3.0])  # of x, y, ln radius, peak, background, g
FEW_SIGMAS = 3.0  # beyond, a residual counts in proportion (Huber)
ROUNDS = 3  # of the readings' weights
NODES = 4  # of each axis within a count


@dataclass(frozen=True)
class SearchHead:
    """Parameters of a ranger and its spot for a search.

    zeros             (na0, ne0) counts
    azimuth_limits    counts, low and high
    radius            rad: of the expected spot, at 1/e^2 of its Gaussian
    threshold_volt    V: a return above it is light from the target
    noise_volt        V, standard uncertainty of one amplitude
    full_scale_volt   V: an amplitude not below it is clipped
    scintillation     relative standard uncertainty of an amplitude, of air and laser
    u_counts          of a shaft's place at a reading of a whole count, uniform
    misfit            standard deviation of a real spot's shape from the model's, relative to the peak
    """

    zeros: tuple[float, float]
    azimuth_limits: tuple[float, float]
    radius: float
    threshold_volt: float
    noise_volt: float
    full_scale_volt: float = 10.0
    scintillation: float = 0.02
    u_counts: float = UNIFORM
    misfit: float = 0.01

    def __post_init__(self) -> None:
        positive = {"radius": self.radius, "threshold_volt": self.threshold_volt, "noise_volt": self.noise_volt}
        for name, value in (*positive.items(), ("full_scale_volt", self.full_scale_volt)):
            if not 0.0 < value < np.inf:
                raise ValidityError(f"{name} = {value} is not above 0 and finite")
        for name in ("scintillation", "u_counts", "misfit"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValidityError(f"{name} = {getattr(self, name)} is not 0 or more and finite")
        if self.threshold_volt >= self.full_scale_volt:
            raise ValidityError(f"threshold {self.threshold_volt} V is not below full scale {self.full_scale_volt} V")


@dataclass(frozen=True, eq=False)
class Spot:
    """Fitted spot; NaN where none was found.

    status            text: "found", or the searched area and what to do
    counts            (2,) of its centre, real; finite for a spot that was found
    covariance        (2, 2) counts^2
    amplitude         V of the centre, above the background
    radius            rad, at 1/e^2
    background        V
    flatness          1 a Gaussian, more a flat top
    variance_factor   of the readings that determine the centre, expectation 1; above 1 it multiplies the covariance
    readings          number used
    looked_at         (n, 2) counts in order, of the whole search
    seen              (n,) V there
    joint             (6, 6) covariance of azimuth and elevation counts, radius rad, amplitude V, background V, flatness
    """

    status: str
    counts: Array = field(default_factory=lambda: np.full(2, np.nan))
    covariance: Array = field(default_factory=lambda: np.full((2, 2), np.nan))
    amplitude: float = np.nan
    radius: float = np.nan
    background: float = np.nan
    flatness: float = np.nan
    variance_factor: float = np.nan
    readings: int = 0
    looked_at: Array = field(default_factory=lambda: np.zeros((0, 2)))
    seen: Array = field(default_factory=lambda: np.zeros(0))
    joint: Array = field(default_factory=lambda: np.full((6, 6), np.nan))

    @property
    def found(self) -> bool:
        """True for a spot with a centre."""
        return bool(np.isfinite(self.counts).all())

    @property
    def u_counts(self) -> Array:
        """Standard uncertainties (2,) of the counts."""
        return np.sqrt(np.diag(self.covariance))


def fit_spot(counts: ArrayLike, amplitude: ArrayLike, head: SearchHead) -> Spot:
    """Least-squares fit of a round spot on a background.

    Gaussian or flatter, to amplitudes at counts.

    counts       (n, 2) counts (Na, Ne), all in one pointing
    amplitude    (n,) V; NaN is missing, not below full scale is clipped
    head         the ranger: noise, expected radius, full scale

    The prediction is the spot's mean over the shafts' possible places within a count; a reading's variance is that of
    the noise, the scintillation, the spot's variation over these places, and the misfit of shape. A clipped reading
    counts only while the spot is below full scale there. The start is the centroid of the readings above the lower
    half. A retroreflector wider than the beam makes a spot with a flat top: its flatness is a parameter with a prior
    that begins at the Gaussian. Residuals beyond three standard deviations count less, as at steep sides and where a
    bird flies by. Any further misfit is in the variance factor, which multiplies the covariance.

    Source: least squares with the weights of [HUBER09] on the model of `optics.spot.gaussian_spot`; covariance
    [JCGM100] 5.2 of independent readings. Against scatter, on spots made by diffraction, the mean of e' C^-1 e is 2.3
    where 2 is expected: u is some 7 % too small, since a spot's steep sides make errors that are not normal.
    """
    n, a = np.asarray(counts, dtype=float).reshape(-1, 2), np.asarray(amplitude, dtype=float)
    if a.shape != (len(n),):
        raise ValidityError(f"amplitude has shape {a.shape}, expected ({len(n)},), one for each pair of counts")
    good = np.isfinite(a) & np.isfinite(n).all(axis=1)
    n, a = n[good], a[good]
    clipped = a >= head.full_scale_volt
    if np.sum(~clipped) < FEWEST:
        return Spot(f"not found: {np.sum(~clipped)} readings without clipping are too few (expected {FEWEST})")
    dark = float(np.median(np.sort(a)[: max(1, len(a) // 4)]))
    lit = int(np.sum(a > dark + TIMES_NOISE * head.noise_volt))
    if lit < FEWEST_LIT:
        return Spot(f"not found: no significant spot, {lit} of {len(a)} readings are lit (expected {FEWEST_LIT})")
    middle = n[int(np.argmax(a))]
    xy = offsets_of_counts(middle, head.zeros, n) / head.radius
    size = count_size(middle, head.zeros) / head.radius * head.u_counts
    sheet = SpotModel(xy, a, clipped, head, size)
    p, q, factor = sheet.fitted()
    if not np.isfinite(p).all() or not np.isfinite(q).all():
        return Spot(
            "not found: the readings do not determine a spot's centre, radius and height (expected a wider scan)"
        )
    background, peak = p[4], p[3]
    if not _surrounded(xy, p[:2]):
        edge = counts_of_offsets(middle, head.zeros, p[None, :2] * head.radius)[0]
        return Spot(f"not found: the spot's centre {edge[0]:.1f}, {edge[1]:.1f} lies outside the scan")
    centre, slope = _in_counts(middle, head, p[:2])
    by_fit = shape_slopes(p, head.radius)
    by_fit[:2, :2] = slope
    return Spot(
        status=FOUND,
        counts=centre,
        covariance=slope @ q[:2, :2] @ slope.T,
        amplitude=float(peak),
        radius=float(np.exp(p[2]) * head.radius),
        background=float(background),
        flatness=float(1.0 + p[5] ** 2),
        variance_factor=factor,
        readings=len(a),
        joint=by_fit @ q @ by_fit.T,
    )


def shape_slopes(p: Array, radius: float) -> Array:
    """Derivatives (6, 6) of x, y, radius, peak, background and flatness by the parameters of `SpotModel`.

    p        parameters of the fit
    radius   rad, its unit of length; the places stay in that unit
    """
    return np.diag([1.0, 1.0, float(np.exp(p[2])) * radius, 1.0, 1.0, 2.0 * float(p[5])])


@dataclass(frozen=True, eq=False)
class SpotModel:
    """Readings in units of the expected radius, and their fit.

    Parameters x, y, ln radius, peak, background, g; flatness is 1 + g^2.

    xy        (n, 2) places
    a         (n,) V
    clipped   (n,) bool
    head      ranger
    size      (2,) standard uncertainty of a place, of each axis
    free      (6,) bool: parameters to fit; the others stay where they start: y, along the line of a scan of one axis
    """

    xy: Array
    a: Array
    clipped: NDArray[np.bool_]
    head: SearchHead
    size: Array
    free: NDArray[np.bool_] = field(default_factory=lambda: np.ones(6, dtype=bool))

    @cached_property
    def around(self) -> tuple[Array, Array]:
        """Offsets (n, k, 2) of the shafts within a count, and weights (k).

        Anywhere within their uncertainty.
        """
        node, weight = np.polynomial.legendre.leggauss(NODES)
        dx, dy = np.meshgrid(node * np.sqrt(3.0) * self.size[0], node * np.sqrt(3.0) * self.size[1])
        return self.xy[:, None] + np.stack([dx.ravel(), dy.ravel()], axis=-1), 0.25 * np.outer(weight, weight).ravel()

    def shapes(self, p: Array) -> Array:
        """Spot (n, k) at height 1, without background."""
        d = self.around[0] - p[:2]
        size = {"radius": np.exp(p[2]), "flatness": 1.0 + p[5] ** 2}
        return gaussian_spot(d[..., 0], d[..., 1], peak=1.0, background=0.0, **size)

    def model(self, p: Array) -> Array:
        """Mean (n,), V, over the shafts' possible places."""
        return np.asarray(p[4] + p[3] * (self.shapes(p) @ self.around[1]))

    def jacobian(self, p: Array) -> Array:
        """Derivatives by the six parameters, (n, 6)."""
        places, weight = self.around
        d, s2, f = places - p[:2], np.exp(2.0 * p[2]), 1.0 + p[5] ** 2
        u, shape = np.sum(d**2, axis=-1) / s2, self.shapes(p)
        log = np.log(np.where(u > 0.0, u, 1e-300))
        power = np.exp(np.minimum(f * log, 6.0))
        slope = p[3] * shape * 4.0 * f * power * np.exp(-log)
        by_g = -4.0 * p[3] * p[5] * shape * power * log
        moved = np.einsum("nk,nki,k->ni", slope, d / s2, weight)
        ones = np.ones(len(d))
        return np.column_stack([moved, (slope * u) @ weight, shape @ weight, ones, by_g @ weight])

    def sigma(self, p: Array) -> Array:
        """Standard uncertainty of each sample, (n,) V."""
        shape = self.shapes(p)
        mean = shape @ self.around[1]
        stands = np.maximum(shape**2 @ self.around[1] - mean**2, 0.0)
        shares = stands + (self.head.scintillation * mean) ** 2 + self.head.misfit**2
        return np.asarray(np.sqrt(self.head.noise_volt**2 + p[3] ** 2 * shares))

    def residual(self, p: Array) -> Array:
        """Observed minus predicted.

        Zero for a clipped reading if the prediction is above full scale too.
        """
        v = self.a - self.model(p)
        return np.where(self.clipped, np.maximum(self.head.full_scale_volt - self.model(p), 0.0), v)

    def start(self) -> Array:
        low, high = float(np.min(self.a)), float(np.max(self.a))
        weight = np.maximum(self.a - 0.5 * (low + high), 0.0)
        centre = np.where(self.free[:2], weight @ self.xy / weight.sum() if weight.sum() > 0.0 else 0.0, 0.0)
        return np.array([*centre, 0.0, max(high - low, self.head.noise_volt), low, 0.7])

    def fitted(self) -> tuple[Array, Array, float]:
        """Parameters, their covariance (6, 6), zero for fixed ones, and the variance factor."""
        from scipy.optimize import least_squares

        free = self.free
        p, prior = self.start(), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / FLAT_PRIOR])[free]

        def whole(x: Array) -> Array:
            full = p.copy()
            full[free] = x
            return full

        for _ in range(ROUNDS):
            sigma = self.sigma(p)

            def active(x: Array) -> Array:
                return np.where(self.clipped & (self.residual(x) == 0.0), 0.0, 1.0)

            def slopes(x: Array, s: Array = sigma) -> Array:
                rows = -self.jacobian(whole(x)) * (active(whole(x)) / s)[:, None]
                return np.vstack([rows[:, free], prior])

            solution = least_squares(
                lambda x, s=sigma: np.append(self.residual(whole(x)) / s, x[-1] / FLAT_PRIOR),
                np.clip(p, -BOUNDS, BOUNDS)[free],
                bounds=(-BOUNDS[free], BOUNDS[free]),
                jac=slopes,
                x_scale=np.array([1.0, 1.0, 0.5, max(p[3], 1e-6), max(p[3], 1e-6), 1.0])[free],
                max_nfev=60,
                loss="huber",
                f_scale=FEW_SIGMAS,
            )
            p = whole(solution.x)
        on = active(p) > 0.0
        sigma = self.sigma(p)[on]
        v = self.residual(p)[on] / sigma
        rows = self.jacobian(p)[on][:, free] / sigma[:, None]
        weight = FEW_SIGMAS / np.maximum(np.abs(v), FEW_SIGMAS)
        dof = int(on.sum()) - int(free.sum()) + 1  # the prior counts
        normal = (weight * rows.T) @ rows + np.outer(prior, prior)
        scale = np.sqrt(np.diag(normal))
        if (
            dof < 1
            or abs(p[2]) > 0.99 * BOUNDS[2]
            or not np.all(scale > 0.0)
            or _singular(normal / np.outer(scale, scale))
        ):
            return np.full(6, np.nan), np.full((6, 6), np.nan), np.nan
        q = np.asarray(np.linalg.inv(normal))
        leverage = np.minimum(np.einsum("ni,ij,nj,n->n", rows, q, rows, weight), 0.9)
        # of the readings that determine the centre, not of the dark ones around: leave-one-out values
        factor = float(np.sum(leverage * (v / (1.0 - leverage)) ** 2 * (1.0 - leverage)) / np.sum(leverage))
        joint = np.zeros((6, 6))
        joint[np.ix_(free, free)] = q * max(factor, 1.0)
        return p, joint, factor


def _singular(correlations: Array) -> bool:
    """True for parameters that the readings cannot separate."""
    return not bool(np.linalg.eigvalsh(correlations)[0] > SINGULAR)


def _surrounded(xy: Array, centre: Array) -> bool:
    """True if readings lie on all sides of the centre.

    No half of directions is empty.
    """
    around = np.sort(np.arctan2(*(xy - centre).T[::-1]))
    gaps = np.diff(np.append(around, around[0] + 2.0 * np.pi))
    return bool(gaps.max() < np.pi)


def _in_counts(middle: Array, head: SearchHead, at: Array) -> tuple[Array, Array]:
    """Place as counts, and derivatives (2, 2) by the place.

    The place is in units of the radius.
    """
    step = 1e-4
    probes = at + step * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    n = counts_of_offsets(middle, head.zeros, probes * head.radius)
    return n[0], np.column_stack([n[1] - n[2], n[3] - n[4]]) / (2.0 * step)
