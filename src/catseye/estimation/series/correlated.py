"""Functions of time fitted to many series at once, with noise that lasts from one reading to the next.

    y_t = sum_a F_ta c_a + w_t + x_t,     cov(w_t) = R_t + diag(white^2),
                                          cov(x_s, x_t) = diag(wander^2 exp(-|t - s|/days))

with d components of each reading (a zero: 1, a point: 3, a rigid motion: 6). A Kalman filter turns readings and
functions into innovations, so that the exact weighted least squares takes time proportional to the readings; its
adjoint gives C^-1 times any column, which is what a search for steps needs (`estimation.series.change`).
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import ValidityError

FLOATING = 1e-10  # of a normal matrix scaled to ones: an eigenvalue below it is an undetermined coefficient


@dataclass(frozen=True, eq=False)
class SeriesNoise:
    """Noise of each of d components beyond the claimed covariance.

    white    (d,) standard deviation, new in each reading
    wander   (d,) standard deviation that lasts
    days     (d,) time after which its correlation is 1/e, above 0
    """

    white: Array
    wander: Array
    days: Array

    @classmethod
    def of(cls, d: int, white: float = 0.0, wander: float = 0.0, days: float = 1.0) -> "SeriesNoise":
        """Noise that is the same in d components."""
        return cls(np.full(d, white), np.full(d, wander), np.full(d, days))

    @property
    def lasting(self) -> bool:
        """True if any component has a wander."""
        return bool(np.any(self.wander > 0.0))


@dataclass(frozen=True, eq=False)
class SeriesGroup:
    """Readings of S series at T common times.

    days         (T,) rising
    values       (T, S, d); NaN where there is none (any component: all)
    covariance   (T, S, d, d) claimed; ignored where there is no reading
    """

    days: Array
    values: Array
    covariance: Array

    def __post_init__(self) -> None:
        t, s, d = self.values.shape
        if self.days.shape != (t,) or self.covariance.shape != (t, s, d, d):
            raise ValidityError(
                f"days {self.days.shape}, values {self.values.shape}, covariance {self.covariance.shape}: expected "
                "(T,), (T, S, d), (T, S, d, d)"
            )
        if t > 1 and not np.all(np.diff(self.days) > 0.0):
            raise ValidityError("days of a series do not increase (expected rising times)")

    @property
    def present(self) -> np.ndarray:
        """True (T, S) where there is a reading."""
        return measured(self.values) & measured(self.covariance.reshape(*self.values.shape[:2], -1))

    def part(self, series: np.ndarray) -> "SeriesGroup":
        """Group of some of the series."""
        return SeriesGroup(self.days, self.values[:, series], self.covariance[:, series])


def measured(values: Array) -> np.ndarray:
    """True (...) where all of the last axis is finite.

    >>> measured(np.array([[1.0, 2.0], [np.nan, 0.0]])).tolist()
    [True, False]
    """
    return np.asarray(np.isfinite(values).all(axis=-1), dtype=bool)


@dataclass(frozen=True, eq=False)
class Filtered:
    """Innovations of readings and functions, time first.

    innovations   (T, S, d, 1 + k d): of the readings, then function by function
    inverse       (T, S, d, d) inverse covariance of an innovation; zero without a reading
    gain          (T, S, d, d) of the filter; None without wander
    decay         (T, d) correlation of the wander with the next time
    logarithm     (S,) sum of the log determinants of the innovations' covariances
    """

    innovations: Array
    inverse: Array
    gain: Array | None
    decay: Array
    logarithm: Array


@dataclass(frozen=True, eq=False)
class SeriesFit:
    """Coefficients of the functions of each series.

    coefficients         (S, k, d)
    covariance           (S, k d, k d), function by function
    pvv                  (S,) weighted squares of the residuals
    degrees_of_freedom   (S,)
    logarithm            (S,) restricted log likelihood, without a constant
    likelihood           (S,) log likelihood, without a constant
    residual             (T, S, d); NaN where there is no reading
    """

    coefficients: Array
    covariance: Array
    pvv: Array
    degrees_of_freedom: Array
    logarithm: Array
    likelihood: Array
    residual: Array

    @property
    def u(self) -> Array:
        """Standard uncertainty (S, k, d) of the coefficients."""
        return np.sqrt(np.maximum(np.einsum("saa->sa", self.covariance), 0.0)).reshape(self.coefficients.shape)

    @property
    def variance_factor(self) -> Array:
        """Variance factor (S,) pvv / degrees of freedom, expectation 1; NaN without any."""
        return np.where(self.degrees_of_freedom > 0, self.pvv / np.maximum(self.degrees_of_freedom, 1), np.nan)


def fit_series(group: SeriesGroup, functions: Array, noise: SeriesNoise) -> SeriesFit:
    """Least-squares fit of functions to each of many series.

    group       the series
    functions   (T, k), or (T, S, k) where they differ between series; a column that is zero in a series is left out
    noise       beyond the claimed covariance

    A coefficient that the readings do not determine is NaN, and so are its variances.

    Source: [RAO73] section 4a (least squares with a full covariance); [HARVEY89] chapter 3 (innovations of a Kalman
    filter), [PATTERSON71] for the restricted likelihood.

    >>> days = np.arange(5.0)
    >>> group = SeriesGroup(days, (2.0 + 3.0 * days)[:, None, None], np.ones((5, 1, 1, 1)))
    >>> fit = fit_series(group, np.column_stack([np.ones(5), days]), SeriesNoise.of(1))
    >>> fit.coefficients[0, :, 0].round(9).tolist()
    [2.0, 3.0]
    """
    return solved(group, _by_series(functions, group), filtered(group, _by_series(functions, group), noise))[0]


def solved(group: SeriesGroup, functions: Array, forward: Filtered) -> tuple[SeriesFit, Array]:
    """Fit from innovations, with the inverse (S, k d, k d) normal matrix.

    functions   (T, S, k)
    """
    t, s, d = group.values.shape
    k = functions.shape[2]
    weighted = forward.inverse @ forward.innovations  # (T, S, d, m)
    m = forward.innovations.shape[3]
    flat = np.moveaxis(forward.innovations, 1, 0).reshape(s, t * d, m)
    products = np.swapaxes(flat, 1, 2) @ np.moveaxis(weighted, 1, 0).reshape(s, t * d, m)
    normal, right = products[:, 1:, 1:], products[:, 1:, 0]
    inverse, determined, logarithm = _inverses(normal)
    theta = np.einsum("sab,sb->sa", inverse, right)
    pvv = np.maximum(products[:, 0, 0] - np.einsum("sa,sa->s", right, theta), 0.0)
    present = group.present
    count = determined.sum(axis=1)
    predicted = np.einsum("tsk,skd->tsd", functions, theta.reshape(s, k, d))
    fit = SeriesFit(
        coefficients=np.where(determined, theta, np.nan).reshape(s, k, d),
        covariance=np.where(determined[:, :, None] & determined[:, None, :], inverse, np.nan),
        pvv=pvv,
        degrees_of_freedom=d * present.sum(axis=0) - count,
        logarithm=-0.5 * (forward.logarithm + logarithm + pvv),
        likelihood=-0.5 * (forward.logarithm + pvv),
        residual=np.where(present[:, :, None], group.values - predicted, np.nan),
    )
    return fit, inverse


def filtered(group: SeriesGroup, functions: Array, noise: SeriesNoise) -> Filtered:
    """Innovations of the readings and of the functions (T, S, k)."""
    t, s, d = group.values.shape
    k, present = functions.shape[2], group.present
    columns = np.zeros((t, s, d, 1 + k * d))
    columns[..., 0] = np.where(present[:, :, None], group.values, 0.0)
    for i in range(d):
        columns[:, :, i, 1 + i :: d] = np.where(present[:, :, None], functions, 0.0)
    spread = np.where(present[:, :, None, None], group.covariance, 0.0) + np.diag(noise.white**2)
    spread = np.where(present[:, :, None, None], spread, np.eye(d))
    gaps = np.diff(group.days, append=group.days[-1:] + 1.0)
    decay = np.exp(-gaps[:, None] / noise.days)
    if not noise.lasting:
        inverse, logarithm = inverse_of(spread)
        zero = ~present[:, :, None, None]
        return Filtered(
            innovations=columns,
            inverse=np.where(zero, 0.0, inverse),
            gain=None,
            decay=decay,
            logarithm=np.where(present, logarithm, 0.0).sum(axis=0),
        )
    variance = np.diag(noise.wander**2)
    state, wander = np.zeros((s, d, 1 + k * d)), np.broadcast_to(variance, (s, d, d))
    inverses, gains, total = np.empty((t, s, d, d)), np.empty((t, s, d, d)), np.zeros(s)
    for i in range(t):
        inverse, logarithm = inverse_of(wander + spread[i])
        inverses[i] = np.where(present[i][:, None, None], inverse, 0.0)
        gains[i] = wander @ inverses[i]
        columns[i] -= np.where(present[i][:, None, None], state, 0.0)
        state = decay[i][:, None] * (state + gains[i] @ columns[i])
        pair = decay[i][:, None] * decay[i]
        wander = pair * (wander - gains[i] @ wander) + variance * (1.0 - pair)
        wander = 0.5 * (wander + np.swapaxes(wander, 1, 2))
        total += np.where(present[i], logarithm, 0.0)
    return Filtered(innovations=columns, inverse=inverses, gain=gains, decay=decay, logarithm=total)


def weighted_columns(forward: Filtered) -> Array:
    """Inverse covariance times readings and functions, (T, S, d, 1 + k d), by the filter's adjoint."""
    weighted = forward.inverse @ forward.innovations
    if forward.gain is None:
        return weighted
    size = weighted.shape[1:]
    costate = np.zeros(size)
    for i in range(len(weighted) - 1, -1, -1):
        moved = forward.decay[i][:, None] * costate
        weighted[i], costate = (
            weighted[i] + np.swapaxes(forward.gain[i], 1, 2) @ moved,
            moved - weighted[i] - np.swapaxes(forward.gain[i], 1, 2) @ moved,
        )
    return weighted


def step_products(forward: Filtered) -> tuple[Array, Array]:
    """Products h' C^-1 h of steps h at each time, and of each with the next one: (T, S, d, d) twice.

    A step is 1 from its time on, in one component each. The second is h_t' C^-1 h_(t+1); zero at the last time.
    """
    t, s, d, _ = forward.inverse.shape
    own, following = np.zeros((t, s, d, d)), np.zeros((t, s, d, d))
    quadratic, linear, constant = np.zeros((s, d, d)), np.zeros((s, d, d)), np.zeros((s, d, d))
    for i in range(t - 1, -1, -1):
        weight = forward.inverse[i]
        if forward.gain is None:
            following[i] = constant
            constant = constant + weight
            own[i] = constant
            continue
        decay = forward.decay[i][:, None]
        by_input = decay * forward.gain[i]
        by_state = decay * (np.eye(d) - forward.gain[i])
        back = np.swapaxes(by_input, 1, 2)
        following[i] = constant + back @ linear
        crossed = quadratic @ by_input
        mixed = back @ linear
        constant = weight + back @ crossed + mixed + np.swapaxes(mixed, 1, 2) + constant
        over = np.swapaxes(by_state, 1, 2)
        linear = -weight + over @ (crossed + linear)
        quadratic = weight + over @ quadratic @ by_state
        own[i] = constant
    following[-1:] = 0.0
    return own, following


def _by_series(functions: Array, group: SeriesGroup) -> Array:
    """Functions (T, S, k) of each series."""
    t, s, _ = group.values.shape
    rows = functions if functions.ndim == 3 else functions[:, None]
    if len(rows) != t or rows.shape[1] not in (1, s) or not np.isfinite(rows).all():
        raise ValidityError(f"functions {np.shape(functions)}: expected ({t}, k) or ({t}, {s}, k), finite")
    return np.broadcast_to(rows, (t, s, rows.shape[2]))


def inverse_of(spread: Array) -> tuple[Array, Array]:
    """Inverses (..., d, d) and log determinants (...)."""
    if spread.shape[-1] == 1:
        return 1.0 / spread, np.log(spread[..., 0, 0])
    if spread.shape[-1] == 3:
        return _inverse_of_three(spread)
    return np.asarray(np.linalg.inv(spread), dtype=float), np.linalg.slogdet(spread)[1]


def _inverse_of_three(q: Array) -> tuple[Array, Array]:
    """Inverses of symmetric (..., 3, 3) by cofactors: some ten times faster than one by one."""
    a, b, c = q[..., 0, 0], q[..., 0, 1], q[..., 0, 2]
    e, f, i = q[..., 1, 1], q[..., 1, 2], q[..., 2, 2]
    result = np.empty_like(q)
    result[..., 0, 0], result[..., 1, 1], result[..., 2, 2] = e * i - f * f, a * i - c * c, a * e - b * b
    result[..., 0, 1] = result[..., 1, 0] = c * f - b * i
    result[..., 0, 2] = result[..., 2, 0] = b * f - c * e
    result[..., 1, 2] = result[..., 2, 1] = b * c - a * f
    determinant = a * result[..., 0, 0] + b * result[..., 0, 1] + c * result[..., 0, 2]
    return result / determinant[..., None, None], np.log(determinant)


def _inverses(normal: Array) -> tuple[Array, np.ndarray, Array]:
    """Inverses of normal matrices (S, n, n), determined unknowns (S, n), log determinants (S,).

    An unknown without a reading, or one of an undetermined combination, has a zero row.
    """
    size = np.sqrt(np.einsum("saa->sa", normal))
    used = size > 0.0
    scale = np.where(used, size, 1.0)
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    unit = 0.5 * (unit + np.swapaxes(unit, 1, 2))
    n = normal.shape[1]
    unit[:, np.arange(n), np.arange(n)] = 1.0
    values, vectors = np.linalg.eigh(unit)
    weak = values < FLOATING
    floating = (weak[:, None, :] & (np.abs(vectors) > 1e-3)).any(axis=2)
    inverse = (vectors / np.where(weak, np.inf, values)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    determined = used & ~floating
    mask = used[:, :, None] & used[:, None, :]
    inverse = np.where(mask, inverse / (scale[:, :, None] * scale[:, None, :]), 0.0)
    logarithm = np.where(weak, 0.0, np.log(np.where(weak, 1.0, values))).sum(axis=1)
    logarithm = logarithm + 2.0 * np.where(used, np.log(scale), 0.0).sum(axis=1)
    return inverse, determined, logarithm
