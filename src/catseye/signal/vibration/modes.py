"""Vibration modes from a series of samples, for `filter`."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import EstimationError, ValidityError
from catseye.signal.vibration.filter import Mode, decay_of, driven, driven_within, start, window_gain

DAMPING_PRIOR = (0.01, 1.5)  # ratio, and standard deviation of its logarithm: structures have 0.2 to 5 percent
PASSES = 30  # scoring steps; it takes some ten
SETTLED = 1e-3  # of a standard uncertainty, squared: the last step
SLACK = 0.3  # of the samples' scatter: noise of the filter that removes a mode to find the next
FREQUENCIES = 4000  # upper limit of the first search
MOST_DAMPING = 0.5  # ratio, while searching
DIRECTIONS = 2  # passes over the samples for the direction of each mode
WIDE = 1e3  # times the largest sample: prior of an unknown offset


def find_modes(
    times: ArrayLike,
    samples: ArrayLike,
    *,
    count: int,
    u_sample: float,
    window: float = 0.0,
    near_hz: Sequence[float] | None = None,
    drift_hz: float = 0.0,
) -> tuple[Mode, ...]:
    """Frequencies, dampings, sizes of modes, by maximum likelihood.

    times      (N,) s, rising, any gaps
    samples    (N, A) m; NaN where lost
    count      of modes
    u_sample   m, above 0, white noise of each axis
    window     s, averaging window of each sample
    near_hz    first guesses; without them the highest peaks of the spectrum below half the sampling rate
    drift_hz   walk of the frequencies, passed on to the modes

    The likelihood is that of the Kalman filter (axes separate, offsets free, the force within a window taken as white),
    maximized by Fisher's scoring; the dampings have a wide prior, 1 % within a factor of 4.5, since a short series
    hardly determines them. The direction of each mode (ratio of axes, covariance between them) comes from the filtered
    states; it increases the uncertainties where axes move together. Raises EstimationError with too few samples or
    without convergence.

    Source: [SCHWEPPE65], the likelihood of innovations.

    >>> rng, t = np.random.default_rng(1), np.arange(500) / 50.0
    >>> seen = 1e-3 * np.cos(2 * np.pi * 2.3 * t) + 1e-5 * rng.standard_normal(500)
    >>> round(find_modes(t, seen[:, None], count=1, u_sample=1e-5)[0].frequency_hz, 2)
    2.3
    """
    t, y = np.asarray(times, dtype=float), np.asarray(samples, dtype=float)
    if y.ndim != 2 or len(y) != len(t) or count < 1:
        raise ValidityError(
            f"samples have shape {y.shape}, times {t.shape}, modes {count}: expected (N, A), (N,), 1 up"
        )
    if not np.all(np.diff(t) > 0.0) or not 0.0 < u_sample < np.inf:
        raise ValidityError(f"times do not increase, or u_sample = {u_sample} m is not above 0 and finite")
    if near_hz is not None and (len(near_hz) != count or not all(0.0 < f < np.inf for f in near_hz)):
        raise ValidityError(f"near_hz = {list(near_hz)} for {count} modes (expected one above 0 for each)")
    valid = np.isfinite(y)
    if valid.sum(axis=0).min() < 8 * count:
        raise EstimationError(
            f"{valid.sum(axis=0).min()} samples do not determine {count} modes (expected {8 * count} at least)"
        )
    modes, residual = np.zeros((0, 2 + y.shape[1])), y
    for k in range(count):
        guess = near_hz[k] if near_hz is not None else _peak(t, residual)
        modes = np.vstack([modes, _initial(guess, t, y, u_sample, window)])
        # the next mode is the highest peak left by a loose filter of the modes before it
        slack = max(u_sample, SLACK * float(np.sqrt(np.nanmean(np.nanvar(y, axis=0)))))
        innovations, variances = _innovations(_joined(modes)[None], t, y, slack, window, k + 1)
        residual = np.where(valid, (innovations / np.sqrt(variances)).reshape(y.shape), np.nan)
    theta, information = _climbed(_joined(modes), t, y, u_sample, window, count)
    covariance = np.linalg.inv(information)
    u = np.sqrt(np.diag(covariance))
    frequency, damping = theta[:count] / TWO_PI, np.exp(theta[count : 2 * count])
    sizes = np.exp(theta[2 * count :].reshape(count, -1))
    if np.any(damping >= MOST_DAMPING) or np.any(frequency <= 0.0):
        worst = int(np.argmax(damping))
        raise EstimationError(
            f"the mode at {frequency[worst]:.4g} Hz has the damping ratio {damping[worst]:.3g} (expected below "
            f"{MOST_DAMPING}): not a vibration; look for fewer modes"
        )
    apart = tuple(
        Mode(
            frequency_hz=float(frequency[k]),
            damping_ratio=float(damping[k]),
            covariance=np.diag(sizes[k] ** 2),
            u_frequency_hz=u[k] / TWO_PI,
            u_damping=u[count + k],
            drift_hz=drift_hz,
        )
        for k in range(count)
    )
    return _correlated(apart, t, y, u_sample, window)


def _climbed(theta: Array, t: Array, y: Array, u_sample: float, window: float, count: int) -> tuple[Array, Array]:
    """Maximum-likelihood parameters with damping prior, and information."""
    scale = np.concatenate([np.full(count, 0.1 / (t[-1] - t[0])), np.full(len(theta) - count, 0.05)])
    tried, best, best_information = theta, -np.inf, np.eye(len(theta))
    step: Array = np.zeros(len(theta))
    for _ in range(PASSES):
        value, gradient, information = _scored(tried, scale, t, y, u_sample, window, count)
        if value > best:
            theta, best, best_information = tried, value, information
            full_step = np.asarray(np.linalg.solve(information, gradient), dtype=float)
            reach = np.concatenate([np.full(count, 3.0 / (t[-1] - t[0])), np.full(len(theta) - count, 1.0)])
            step = full_step * min(1.0, float(np.min(reach / np.maximum(np.abs(full_step), 1e-300))))
        else:
            step = 0.5 * step  # overshoot
        if float(step @ best_information @ step) < SETTLED:
            return theta, best_information
        tried = theta + step
    raise EstimationError(f"modes did not converge in {PASSES} passes: give fewer modes, near_hz, or a longer stretch")


def _scored(
    theta: Array, scale: Array, t: Array, y: Array, u_sample: float, window: float, count: int
) -> tuple[float, Array, Array]:
    """Log-likelihood, its gradient and expected information, by differences of innovations."""
    p = len(theta)
    candidates = np.concatenate([theta[None], theta + np.diag(scale), theta - np.diag(scale)])
    v, f = _innovations(candidates, t, y, u_sample, window, count)
    value = -0.5 * float(np.sum(np.log(f[0]) + v[0] ** 2 / f[0]))
    dv = (v[1 : p + 1] - v[p + 1 :]) / (2.0 * scale[:, None])
    df = (f[1 : p + 1] - f[p + 1 :]) / (2.0 * scale[:, None])
    gradient = -0.5 * ((df / f[0]) @ (1.0 - v[0] ** 2 / f[0])) - dv @ (v[0] / f[0])
    information = (dv / f[0]) @ dv.T + 0.5 * (df / f[0]) @ (df / f[0]).T
    off = theta[count : 2 * count] - np.log(DAMPING_PRIOR[0])
    weight = DAMPING_PRIOR[1] ** -2
    at = np.arange(count, 2 * count)
    gradient[at] -= weight * off
    information[at, at] += weight
    return value - 0.5 * weight * float(off @ off), gradient, information


def _innovations(
    candidates: Array, t: Array, y: Array, u_sample: float, window: float, count: int
) -> tuple[Array, Array]:
    """Innovations (P, N A) and variances for P sets of parameters, axes separate; lost ones 0, 1."""
    p, axes = len(candidates), y.shape[1]
    w = candidates[:, :count]
    d = decay_of(w, np.minimum(np.exp(candidates[:, count : 2 * count]), MOST_DAMPING))
    power = np.exp(2.0 * candidates[:, 2 * count :].reshape(p, count, axes)).transpose(0, 2, 1)  # (P, A, m)
    n = 2 * count + 1
    row = np.zeros((p, 1, n))
    for k in range(count):
        averaging = window_gain(w[:, k], d[:, k], window)[0]
        row[:, 0, 2 * k], row[:, 0, 2 * k + 1] = averaging.real, -averaging.imag
    row[:, 0, -1] = 1.0
    noise = u_sample**2 + np.sum(power * driven_within(w, d, window)[:, None, :], axis=-1)
    mean: Array = np.zeros((p, axes, n))
    q: Array = np.zeros((p, axes, n, n))
    q[..., :-1, :-1] = _fresh(w, d, power, np.inf)
    q[..., -1, -1] = (WIDE * float(np.nanmax(np.abs(y)) + u_sample)) ** 2
    innovations, variances = np.zeros((p, len(t), axes)), np.ones((p, len(t), axes))
    previous, last = float(t[0]), 0.0
    move, fresh = np.broadcast_to(np.eye(n), (p, 1, n, n)), np.zeros((p, axes, n - 1, n - 1))
    for i, instant in enumerate(t):
        step = instant - previous
        if step > 0.0:
            if abs(step - last) > 1e-12:
                move, last = _moves(w, d, step), step
                fresh = _fresh(w, d, power, step)
            mean = (move @ mean[..., None])[..., 0]
            q = move @ q @ np.swapaxes(move, -1, -2)
            q[..., :-1, :-1] += fresh
            previous = instant
        qh = (q @ row[..., None])[..., 0]
        f = np.sum(qh * row, axis=-1) + noise
        missing = ~np.isfinite(y[i])
        v = np.where(missing, 0.0, y[i] - np.sum(mean * row, axis=-1))
        gain = np.where(missing[:, None], 0.0, qh / f[..., None])
        mean = mean + gain * v[..., None]
        q = q - gain[..., :, None] * qh[..., None, :]
        innovations[:, i], variances[:, i] = v, np.where(missing, 1.0, f)
    return innovations.reshape(p, -1), variances.reshape(p, -1)


def _fresh(w: Array, d: Array, power: Array, step: float) -> Array:
    """Covariance (P, A, 2m, 2m) added by the force in a step."""
    p, axes, count = power.shape
    blocks = driven(w, d, step)[:, None] * power[..., None, None]  # (P, A, m, 2, 2)
    covariance = np.zeros((p, axes, 2 * count, 2 * count))
    for k in range(count):
        covariance[:, :, 2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = blocks[:, :, k]
    return covariance


def _moves(w: Array, d: Array, step: float) -> Array:
    """Transition matrix (P, 1, n, n) of a step."""
    p, count = w.shape
    move = np.zeros((p, 1, 2 * count + 1, 2 * count + 1))
    size = np.exp(-d * step)
    for k in range(count):
        c, s = size[:, k] * np.cos(w[:, k] * step), size[:, k] * np.sin(w[:, k] * step)
        move[:, 0, 2 * k, 2 * k], move[:, 0, 2 * k, 2 * k + 1] = c, -s
        move[:, 0, 2 * k + 1, 2 * k], move[:, 0, 2 * k + 1, 2 * k + 1] = s, c
    move[:, 0, -1, -1] = 1.0
    return move


def _correlated(modes: tuple[Mode, ...], t: Array, y: Array, u_sample: float, window: float) -> tuple[Mode, ...]:
    """Modes with the direction of their motion from their filtered states, and their size as found.

    The ratio of the axes must be that of the states: a mode that swings along one line has a correlation of 1, and with
    it any other ratio would force its motion onto another line. The second pass knows the direction of the first.
    """
    axes = y.shape[1]
    if axes == 1:
        return modes
    turned = modes
    for _ in range(DIRECTIONS):
        squares = _mean_squares(turned, t, y, u_sample, window)
        turned = tuple(
            replace(mode, covariance=square * float(np.trace(mode.covariance) / np.trace(square)))
            for mode, square in zip(modes, squares, strict=True)
        )
    correlated = []
    for mode in turned:
        size = np.sqrt(np.diag(mode.covariance))
        correlation = mode.covariance / np.outer(size, size)
        # axes taken as independent count shared information twice: use the variance of the scores
        more = float(np.sqrt(np.sum(correlation**2) / axes))
        correlated.append(replace(mode, u_frequency_hz=mode.u_frequency_hz * more, u_damping=mode.u_damping * more))
    return tuple(correlated)


def _mean_squares(modes: tuple[Mode, ...], t: Array, y: Array, u_sample: float, window: float) -> Array:
    """Sums (m, A, A), m^2, over the second half of the samples, of the expected products of the axes' quadratures."""
    axes = y.shape[1]
    state = start(float(t[0]) - 0.5 * window, modes, u_offset=WIDE * float(np.nanmax(np.abs(y))))
    sums = np.zeros((len(modes), axes, axes))
    for instant, sample in zip(t, y, strict=True):
        state = state.updated(float(instant), sample, np.eye(axes) * u_sample**2, window)[0]
        if instant > 0.5 * (t[0] + t[-1]):  # locked by then
            for k in range(len(modes)):
                for first in (2 * axes * k, 2 * axes * k + axes):
                    part = slice(first, first + axes)
                    sums[k] += np.outer(state.mean[part], state.mean[part]) + state.covariance[part, part]
    return sums


def _peak(t: Array, y: Array) -> float:
    """Frequency of the highest peak of the power summed over axes, Hz."""
    span, highest = t[-1] - t[0], 0.5 / float(np.median(np.diff(t)))
    grid = np.linspace(1.0 / span, highest, min(FREQUENCIES, int(4 * highest * span)))
    power = np.zeros(len(grid))
    for part in np.array_split(np.arange(len(grid)), max(1, len(grid) * len(t) // 2_000_000)):
        power[part] = np.sum(_waves(grid[part], t, y) ** 2, axis=1)
    return float(grid[int(np.argmax(power))])


def _waves(frequencies_hz: Array, t: Array, y: Array) -> Array:
    """Wave amplitude (f, A) of each frequency in the samples, tapered at both ends."""
    taper = np.where(np.isfinite(y), (0.5 - 0.5 * np.cos(TWO_PI * (t - t[0]) / (t[-1] - t[0])))[:, None], 0.0)
    clean = np.where(np.isfinite(y), y - np.nanmean(y, axis=0), 0.0)
    waves = np.exp(-1j * TWO_PI * np.outer(frequencies_hz, t))
    return 2.0 * np.abs(waves @ (clean * taper)) / np.sum(taper, axis=0)


def _initial(frequency_hz: float, t: Array, y: Array, u_sample: float, window: float) -> Array:
    """Initial parameters of a mode (2 + A,): angular frequency, log damping, log size on each axis."""
    gain = abs(complex(window_gain(TWO_PI * frequency_hz, 0.0, window)[0]))
    size = np.maximum(_waves(np.array([frequency_hz]), t, y)[0] / np.sqrt(2.0) / gain, u_sample)
    return np.array([TWO_PI * frequency_hz, np.log(DAMPING_PRIOR[0]), *np.log(size)])


def _joined(modes: Array) -> Array:
    """Mode rows as one vector: frequencies, dampings, sizes."""
    return np.concatenate([modes[:, 0], modes[:, 1], modes[:, 2:].ravel()])
