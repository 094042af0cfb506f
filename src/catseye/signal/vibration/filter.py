"""Phase-locked filter to track and predict structural vibration.

The filter has one or more modes. The observation is a displacement with one or more axes: the spot on a quadrant
detector (two), or a point that ground rangers track (three). Each mode is a damped oscillator, driven by a white force
(wind, motors):

    y(t) = sum_k Re z_k(t) + offset,     dz_k = (-d_k + i w_k) z_k dt - i force_k dt / w_k,

w = 2 pi f the damped frequency and d = zeta w/sqrt(1 - zeta^2) the decay. The real part of z_k (complex for each axis)
is the displacement, its imaginary part holds the velocity, (-d Re z - velocity)/w, where the force enters; but for
terms of the order zeta, |z| is the amplitude and arg z the phase. The force keeps each quadrature at the stationary
covariance S_k between the axes. An extended Kalman filter estimates all z_k, the frequencies (which walk slowly) and
the offsets with their full covariance: its oscillators lock their phases to the observations, start without knowledge
of the phase (z = 0 with the covariance S), coast through lost samples, and predict the displacement with a realistic
uncertainty, because it includes the future force. Kicks larger than S (the start of a slew) are not predicted; the
innovations show them. The damping is held at the mode's value.

A sample may be the mean over a window (a ranger's buffer of 128 ms, sampled some 7 times a second): a mode then shows
with its mean over the window, and a mode above half the sampling rate may be tracked if its frequency is known well
enough beforehand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError

PARTS = 8  # of a window, for the force within it
ROUNDING = 1e-9  # s: rounding overlap of adjacent windows


@dataclass(frozen=True, eq=False)
class Mode:
    """Mode of vibration with which the filter starts.

    frequency_hz        Hz, above 0, damped
    damping_ratio       of critical, above 0, below 1
    covariance          (A, A) m^2, stationary, of each quadrature between the axes; its diagonal is the mean square
    u_frequency_hz      Hz, 0 or more
    u_damping           of the natural logarithm of the damping ratio; information only, the filter holds the damping
    drift_hz            Hz per square root of a second, the walk of the frequency

    Raises ValidityError for a number outside these, and for an invalid covariance.
    """

    frequency_hz: float
    damping_ratio: float
    covariance: Array
    u_frequency_hz: float
    u_damping: float = float("nan")
    drift_hz: float = 0.0

    def __post_init__(self) -> None:
        for name, value, most in (
            ("frequency_hz", self.frequency_hz, np.inf),
            ("damping_ratio", self.damping_ratio, 1.0),
        ):
            if not 0.0 < value < most:
                raise ValidityError(f"{name} = {value} of a mode (expected above 0 and below {most:g})")
        for name, value in (("u_frequency_hz", self.u_frequency_hz), ("drift_hz", self.drift_hz)):
            if not 0.0 <= value < np.inf:
                raise ValidityError(f"{name} = {value} of a mode (expected 0 or more)")
        s = np.asarray(self.covariance, dtype=float)
        if s.ndim != 2 or s.shape[0] != s.shape[1] or not np.all(np.diag(s) > 0.0):
            raise ValidityError(
                f"covariance of a mode has shape {s.shape} or a variance of 0 (expected (A, A), above 0)"
            )
        scaled = s / np.sqrt(np.outer(np.diag(s), np.diag(s)))
        if not np.allclose(scaled, scaled.T, rtol=0.0, atol=1e-9) or np.linalg.eigvalsh(scaled)[0] < -1e-9 * len(s):
            raise ValidityError("covariance of a mode is not symmetric or has a negative eigenvalue")
        object.__setattr__(self, "covariance", s)

    @property
    def angular(self) -> float:
        """Angular frequency of the mode, rad/s."""
        return TWO_PI * self.frequency_hz

    @property
    def decay(self) -> float:
        """Amplitude decay rate without force, 1/s."""
        return float(decay_of(self.angular, self.damping_ratio))


@dataclass(frozen=True, eq=False)
class FilterState:
    """Filter state at one time.

    time         s
    modes        as at the start, m of them
    mean         (n,): for each mode real parts of z (A), imaginary parts (A); then m angular frequencies, rad/s; then
                 A offsets, m; n = m (2 A + 1) + A
    covariance   (n, n)
    offset_walk  m per square root of a second
    """

    time: float
    modes: tuple[Mode, ...]
    mean: Array
    covariance: Array
    offset_walk: float = 0.0

    @property
    def axes(self) -> int:
        return len(self.modes[0].covariance)

    def frequencies_hz(self) -> tuple[Array, Array]:
        """Frequencies (m,) and their standard uncertainties, Hz."""
        at = _frequencies(len(self.modes), self.axes)
        return self.mean[at] / TWO_PI, np.sqrt(np.diag(self.covariance)[at]) / TWO_PI

    def amplitudes(self) -> tuple[Array, Array]:
        """Amplitude (m, A), m, with its standard uncertainty.

        First order, so valid only above u.
        """
        z, q = self.quadratures()
        size = np.maximum(np.linalg.norm(z, axis=-1), np.finfo(float).tiny)
        along = z / size[..., None]
        return size, np.sqrt(np.einsum("mai,maij,maj->ma", along, q, along))

    def phases(self) -> tuple[Array, Array]:
        """Phase (m, A), rad, with standard uncertainty: amplitude cos(phase)."""
        z, q = self.quadratures()
        size = np.maximum(np.linalg.norm(z, axis=-1), np.finfo(float).tiny)
        across = np.stack([-z[..., 1], z[..., 0]], axis=-1) / size[..., None] ** 2
        return np.arctan2(z[..., 1], z[..., 0]), np.sqrt(np.einsum("mai,maij,maj->ma", across, q, across))

    def quadratures(self) -> tuple[Array, Array]:
        """Real and imaginary part (m, A, 2) and their covariance (m, A, 2, 2)."""
        m, axes = len(self.modes), self.axes
        pairs = np.array([[[2 * axes * k + a, 2 * axes * k + axes + a] for a in range(axes)] for k in range(m)])
        return self.mean[pairs], self.covariance[pairs[..., :, None], pairs[..., None, :]]

    def advanced(self, time: float) -> "FilterState":
        """State at a later time, without an observation.

        time    s, not before the state's
        """
        mean, slope, noise = self._moved(time - self.time)
        return replace(self, time=time, mean=mean, covariance=slope @ self.covariance @ slope.T + noise)

    def _moved(self, step: float) -> tuple[Array, Array, Array]:
        """Mean after a step, derivatives, and added covariance.

        Force and walks add covariance.
        """
        if not step >= 0.0:
            raise ValidityError(f"a time lies {-step:.6g} s before the filter's: samples must come in order")
        m, axes = len(self.modes), self.axes
        n, at = len(self.mean), _frequencies(m, axes)
        mean, slope, noise = self.mean.copy(), np.eye(n), np.zeros((n, n))
        for k, mode in enumerate(self.modes):
            block, w = slice(2 * axes * k, 2 * axes * (k + 1)), at[k]
            turn = _turn(np.exp((1j * self.mean[w] - mode.decay) * step), axes)
            mean[block] = turn @ self.mean[block]
            quarter = _turn(1j, axes) @ mean[block]  # derivative by phase
            slope[block, block], slope[block, w] = turn, step * quarter
            fresh, walk = driven(self.mean[w], mode.decay, step), (TWO_PI * mode.drift_hz) ** 2
            noise[block, block] = np.kron(fresh, mode.covariance) + np.outer(quarter, quarter) * walk * step**3 / 3
            noise[block, w] = noise[w, block] = quarter * walk * step**2 / 2
            noise[w, w] = walk * step
        offsets = np.arange(n - axes, n)
        noise[offsets, offsets] = self.offset_walk**2 * step
        return mean, slope, noise

    def expected_sample(self, window: float = 0.0) -> tuple[Array, Array, Array]:
        """Expected displacement (A,) m of a sample, its derivatives (A, n), and the force's part in a window.

        window    s, averaging window of the sample, centred on the state's time; 0 for an instant
        """
        m, axes = len(self.modes), self.axes
        at, rows = _frequencies(m, axes), np.zeros((axes, len(self.mean)))
        value, inner = self.mean[-axes:].copy(), np.zeros((axes, axes))
        rows[:, -axes:] = np.eye(axes)
        for k, mode in enumerate(self.modes):
            gain, by_w = window_gain(self.mean[at[k]], mode.decay, window)
            first = 2 * axes * k
            re, im = slice(first, first + axes), slice(first + axes, first + 2 * axes)
            rows[:, re], rows[:, im] = np.eye(axes) * gain.real, -np.eye(axes) * gain.imag
            rows[:, at[k]] = by_w.real * self.mean[re] - by_w.imag * self.mean[im]
            value += gain.real * self.mean[re] - gain.imag * self.mean[im]
            inner += mode.covariance * driven_within(self.mean[at[k]], mode.decay, window)
        return value, rows, inner

    def updated(
        self, time: float, sample: ArrayLike, noise: ArrayLike, window: float = 0.0
    ) -> tuple["FilterState", Array, Array]:
        """State after a sample; the innovation (A,) m, observed minus predicted; its covariance (A, A).

        time     s, of the sample, the middle of its window
        sample   (A,) m; NaN where lost, and then the innovation is NaN
        noise    (A, A) m^2, covariance of the sample
        window   s, averaging window; it begins at the end of the last one, or later

        The state is then that of the end of the window, but for a half of the last of its PARTS. Within a part the
        mode is taken as undisturbed except for its variance; from part to part the force is propagated exactly.
        """
        parts = PARTS if window > 0.0 else 1
        part, state = window / parts, self
        n, axes = len(self.mean), self.axes
        value, cross, spread = np.zeros(axes), np.zeros((n, axes)), np.asarray(noise, dtype=float)
        for k in range(parts):
            when = time + (k + 0.5) * part - 0.5 * window
            mean, slope, fresh = state._moved(0.0 if abs(when - state.time) < ROUNDING else when - state.time)
            state = replace(state, time=when, mean=mean, covariance=slope @ state.covariance @ slope.T + fresh)
            expected, rows, inner = state.expected_sample(part)
            cross = slope @ cross
            shared = rows @ cross / parts
            spread = spread + shared + shared.T + (rows @ state.covariance @ rows.T + inner) / parts**2
            cross = cross + state.covariance @ rows.T / parts
            value = value + expected / parts
        innovation = np.asarray(sample, dtype=float) - value
        valid = np.isfinite(innovation)
        if not valid.any():
            return state, innovation, spread
        gain = np.linalg.solve(spread[np.ix_(valid, valid)], cross[:, valid].T).T
        q = state.covariance - gain @ cross[:, valid].T
        return (
            replace(state, mean=state.mean + gain @ innovation[valid], covariance=0.5 * (q + q.T)),
            innovation,
            spread,
        )

    def predicted(self, times: ArrayLike) -> tuple[Array, Array]:
        """Predicted displacement (..., A), m, without the offset, and its covariance (..., A, A) m^2.

        times    (...), s, not before the state's
        """
        by_mode, spread = self.predicted_modes(times)
        m, axes = by_mode.shape[-2:]
        blocks = spread.reshape(*spread.shape[:-2], m, axes, m, axes)
        return by_mode.sum(axis=-2), blocks.sum(axis=(-4, -2))

    def predicted_modes(self, times: ArrayLike) -> tuple[Array, Array]:
        """Predicted displacement (..., m, A) of each mode, m, and its covariance (..., m A, m A) m^2.

        times    (...), s, not before the state's
        """
        when = np.asarray(times, dtype=float)
        m, axes = len(self.modes), self.axes
        real = np.concatenate([2 * axes * k + np.arange(axes) for k in range(m)])
        values, spreads = np.empty((*when.shape, m, axes)), np.empty((*when.shape, m * axes, m * axes))
        for i in np.ndindex(when.shape):
            later = self.advanced(float(when[i]))
            values[i] = later.mean[real].reshape(m, axes)
            spreads[i] = later.covariance[np.ix_(real, real)]
        return values, spreads


@dataclass(frozen=True, eq=False)
class FilterTrack:
    """Filter results over a series of samples.

    state         after the last
    innovations   (N, A) m, observed minus predicted; NaN where lost
    spreads       (N, A, A) m^2, their predicted covariance
    """

    state: FilterState
    innovations: Array
    spreads: Array

    @property
    def normalised(self) -> Array:
        """Squared innovations over their covariance (N,), expectation A; NaN where an axis was lost."""
        weighted = np.linalg.solve(self.spreads, self.innovations[..., None])[..., 0]
        return np.sum(self.innovations * weighted, axis=-1)


def start(time: float, modes: Sequence[Mode], *, u_offset: float, offset_walk: float = 0.0) -> FilterState:
    """Filter state before the first sample.

    Unknown phase, amplitudes of stationary size.

    time          s
    modes         one or more, with the same axes
    u_offset      m, of the displacement at rest, whose expectation is 0
    offset_walk   m per square root of a second

    Raises ValidityError for modes of different axes, or no modes.

    >>> start(0.0, [Mode(7.0, 0.01, np.diag([1e-6, 4e-6]), 0.1)], u_offset=0.01).mean.round(6).tolist()
    [0.0, 0.0, 0.0, 0.0, 43.982297, 0.0, 0.0]
    """
    shapes = {mode.covariance.shape for mode in modes}
    if len(shapes) != 1:
        raise ValidityError(
            f"{len(modes)} modes have {len(shapes)} kinds of axes (expected one or more modes, one kind)"
        )
    axes = shapes.pop()[0]
    blocks = [np.kron(driven(mode.angular, mode.decay, np.inf), mode.covariance) for mode in modes]
    blocks.append(np.diag([(TWO_PI * mode.u_frequency_hz) ** 2 for mode in modes]))
    blocks.append(np.eye(axes) * u_offset**2)
    n = sum(len(block) for block in blocks)
    covariance, first = np.zeros((n, n)), 0
    for block in blocks:
        covariance[first : first + len(block), first : first + len(block)] = block
        first += len(block)
    mean = np.zeros(n)
    mean[_frequencies(len(modes), axes)] = [mode.angular for mode in modes]
    return FilterState(time, tuple(modes), mean, covariance, offset_walk)


def follow(
    state: FilterState, times: ArrayLike, samples: ArrayLike, *, noise: ArrayLike, window: float = 0.0
) -> FilterTrack:
    """Run the filter through samples.

    state     before them
    times     (N,) s, in order; of the middle of each window
    samples   (N, A) m; NaN where lost
    noise     (A, A) or (N, A, A) m^2, covariance of a sample; white
    window    s, averaging window of each sample; 0 for an instant

    Source: [JAZWINSKI70], the extended Kalman filter; the model is at the top of this file.

    >>> t = np.arange(400) / 100.0
    >>> swinging = np.cos(2 * np.pi * 7.0 * t)[:, None] * 1e-3
    >>> begun = start(0.0, [Mode(7.05, 0.002, np.eye(1) * 1e-6, 0.1)], u_offset=0.01)
    >>> track = follow(begun, t, swinging, noise=np.eye(1) * 1e-10)
    >>> frequency, u = track.state.frequencies_hz()
    >>> abs(float(frequency[0]) - 7.0) < 2.0 * float(u[0]) < 0.1
    True
    """
    y, when = np.asarray(samples, dtype=float), np.asarray(times, dtype=float)
    if y.ndim != 2 or y.shape != (len(when), state.axes):
        raise ValidityError(f"samples have shape {y.shape}, expected ({len(when)}, {state.axes})")
    r = np.broadcast_to(np.asarray(noise, dtype=float), (*y.shape, state.axes))
    innovations, spreads = np.empty_like(y), np.empty((*y.shape, state.axes))
    for i in range(len(when)):
        state, innovations[i], spreads[i] = state.updated(float(when[i]), y[i], r[i], window)
    return FilterTrack(state, innovations, spreads)


def window_gain(w: ArrayLike, d: ArrayLike, window: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Gain of a mean over a window on a mode, (...), complex, and its derivative by angular frequency.

    w, d      (...), angular frequency, rad/s, and decay, 1/s
    window    s; 0 gives 1

    The mean of exp(s u) over u within half a window of 0, s = -d + i w, which is sinh(x)/x at x = s window/2. Exact.

    >>> round(float(abs(window_gain(2 * np.pi * 7.0, 0.0, 0.128)[0])), 4)  # a mode of 7 Hz in a ranger's buffer
    0.114
    """
    s = 1j * np.asarray(w) - np.asarray(d)
    x = 0.5 * window * s
    small = np.abs(x) < 1e-4
    safe = np.where(small, 1.0, x)
    gain = np.where(small, 1.0 + x * x / 6.0, np.sinh(safe) / safe)
    by_x = np.where(small, x / 3.0, np.cosh(safe) / safe - np.sinh(safe) / safe**2)
    return gain, by_x * 0.5j * window


def decay_of(w: ArrayLike, damping_ratio: ArrayLike) -> Array:
    """Decay rate of a damped mode, 1/s.

    w               rad/s, damped angular frequency
    damping_ratio   of critical

    Exact.
    """
    zeta = np.asarray(damping_ratio, dtype=float)
    return zeta * np.asarray(w, dtype=float) / np.sqrt(1.0 - zeta**2)


def driven(w: ArrayLike, d: ArrayLike, step: float) -> Array:
    """Covariance (..., 2, 2) of both quadratures added by the force in a step, for S = 1.

    w, d    (...), damped angular frequency, rad/s, and decay, 1/s
    step    s; infinity gives the stationary covariance

    The force enters the imaginary part at the rate 4 d S, and the oscillator turns and damps it: with
    I = (1 - exp(-2 d step))/2d and J = (1 - exp(2 (-d + i w) step))/2(d - i w) the variances are 2 d (I -+ Re J), the
    covariance -2 d Im J. Exact.

    >>> driven(2 * np.pi, 0.05, 1e-4).round(8).tolist()  # in a short step the force changes the velocity alone
    [[0.0, -1e-08], [-1e-08, 2e-05]]
    """
    w, d = np.asarray(w, dtype=float), np.asarray(d, dtype=float)
    if np.isinf(step):
        real, waves = 0.5 / d, 0.5 / (d - 1j * w)
    else:
        real = -np.expm1(-2.0 * d * step) / (2.0 * d)
        waves = -np.expm1(2.0 * (1j * w - d) * step) / (2.0 * (d - 1j * w))
    rows = [[real - waves.real, -waves.imag], [-waves.imag, real + waves.real]]
    return 2.0 * d[..., None, None] * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def driven_within(w: ArrayLike, d: ArrayLike, window: float) -> Array:
    """Variance (...) that the force adds to a window mean, given the state in its middle, for S = 1.

    w, d, window    as for `window_gain`

    Each half brings 4 d times the integral of ((1 - cos w r)/(w window))^2 over it. Its correlation with later
    states is neglected; for the short parts of a window it is small.
    """
    w, d, half = np.asarray(w, dtype=float), np.asarray(d, dtype=float), 0.5 * window
    x = w * half
    safe = np.where(x > 0.05, x, 1.0)
    full = (1.5 * safe - 2.0 * np.sin(safe) + 0.25 * np.sin(2.0 * safe)) / (4.0 * safe**2)
    over_w = np.where(x > 0.05, full, x**3 / 80.0)  # integral over window^2 w^2, times w
    return 8.0 * d * over_w / w


def _frequencies(modes: int, axes: int) -> NDArray[np.intp]:
    """Indices of the angular frequencies in the state."""
    return 2 * axes * modes + np.arange(modes)


def _turn(factor: complex, axes: int) -> Array:
    """Complex factor as a matrix on real parts and imaginary parts."""
    one = np.eye(axes)
    return np.block([[one * factor.real, -one * factor.imag], [one * factor.imag, one * factor.real]])
