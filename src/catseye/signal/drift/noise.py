"""Oscillator test: noise kinds and spectral lines of a series.

The density of a series at equal intervals, one-sided, in unit^2 per cycle a reading, with v the frequency in cycles a
reading and s = sin(pi v):

    S(v) = 2 white^2 + pi flicker^2 / s + walk^2 / (2 s^2)

exact for independent readings and for a walk in steps; flicker in the discrete form that tends to flicker^2 / v.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError

FEWEST = 64  # readings; fewer hold too few independent ordinates for three kinds of noise
FIRST_ORDINATE = 3  # a Hann taper spreads the mean over ordinates 0 and 1, and 2 touches them
TAPER_CORRELATION = 1.0 + 2.0 * (2.0 / 3.0) ** 2 + 2.0 * (1.0 / 6.0) ** 2  # sum of correlations of powers
ITERATIONS = 50
MOST_SPURS = 20
CLIMBS = 100
ROUNDING = 1e-13  # of the largest reading: smaller residuals of lines and drift are rounding, not noise


@dataclass(frozen=True)
class Spur:
    """Spectral line amplitude sin(2 pi frequency t + phase).

    Time t counts from the middle of the series.

    frequency_hz, u_frequency_hz   between 0 and half the sampling rate; faster lines are aliased
    amplitude, u_amplitude         unit of the series
    phase                          rad, at the middle of the series
    false_alarm                    probability of so strong a line from noise alone, anywhere in the spectrum
    """

    frequency_hz: float
    u_frequency_hz: float
    amplitude: float
    u_amplitude: float
    phase: float
    false_alarm: float


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Noise parts, lines and drift of a series.

    squares      (3,) white^2, flicker^2, walk^2, each 0 or more; unit of the series squared
    covariance   (3, 3) of these
    spurs        lines, strongest first
    drift        slope of the straight line removed first, unit of the series a second
    frequency    (k,) Hz; density (k,) of the tapered series with its lines, unit^2/Hz; model (k,) without them
    """

    squares: NDArray[np.float64]
    covariance: NDArray[np.float64]
    spurs: tuple[Spur, ...]
    frequency: NDArray[np.float64]
    density: NDArray[np.float64]
    model: NDArray[np.float64]
    drift: float

    @property
    def white(self) -> float:
        """Standard deviation of a reading, without flicker and walk."""
        return float(np.sqrt(self.squares[0]))

    @property
    def flicker(self) -> float:
        """Square root of the coefficient h of the density h/f."""
        return float(np.sqrt(self.squares[1]))

    @property
    def walk(self) -> float:
        """Standard deviation of a step between readings."""
        return float(np.sqrt(self.squares[2]))


def noise_spectrum(series: ArrayLike, interval: float, *, false_alarm: float = 0.001) -> NoiseSpectrum:
    """White, flicker and random-walk parts, and spurs, of a series.

    series       (n,) readings at equal intervals, none missing, at least 64; phases unwrapped
    interval     s, above 0, from reading to reading
    false_alarm  probability of calling noise a spur, over the whole spectrum, 0 to 1

    A straight line (oscillators that differ in frequency, warming) is removed first: it is not noise. Likelihood of
    the tapered periodogram's ordinates, each exponential about the model; spurs are found one by one, strongest first,
    fitted together and removed; one that converges to another is invalid and ends the search. A negative
    part is held at zero; its variance in `covariance` is that at zero. The covariance includes the correlation from
    the taper.

    Raises ValidityError for a series that is too short, constant, or has gaps.

    Source: [WHITTLE53] for the likelihood; [RIFE74] for the bounds of a line's frequency and amplitude. Spurs nearer
    than some 4 ordinates (4/(n interval)) are not resolved.

    >>> y = np.random.default_rng(1).normal(size=4096) + 0.2 * np.sin(2 * np.pi * 57.0 * np.arange(4096) / 1000)
    >>> noise = noise_spectrum(y, 0.001)
    >>> round(noise.spurs[0].frequency_hz, 1), round(noise.spurs[0].amplitude, 1), round(noise.white, 1)
    (57.0, 0.2, 1.0)
    """
    y = _checked(series, interval, false_alarm)
    n = y.size
    time = np.arange(n) - 0.5 * (n - 1)
    slope = float(time @ y / (time @ time))
    largest = float(np.max(np.abs(y)))
    y = y - slope * time
    if np.sqrt(np.mean(y**2)) <= ROUNDING * largest:
        raise ValidityError(f"all {n} readings lie on a straight line: no noise (a dead channel?)")
    v = np.arange(FIRST_ORDINATE, (n + 1) // 2) / n
    basis = _basis(v)
    lines: list[float] = []
    first: NDArray[np.float64] | None = None
    chances: list[float] = []
    while True:
        parts, residuals = _fit_lines(y, time, lines)
        ordinates = _periodogram(residuals)[FIRST_ORDINATE : FIRST_ORDINATE + len(v)]
        first = ordinates if first is None else first
        squares, information = _whittle(ordinates, basis)
        model = basis @ squares
        strength = ordinates / model
        top = int(np.argmax(strength))
        chance = float(-np.expm1(len(v) * np.log1p(-np.exp(-min(strength[top], 700.0)))))
        if chance > false_alarm or len(lines) == MOST_SPURS or np.sqrt(np.mean(residuals**2)) <= ROUNDING * largest:
            break
        longer = _refined(y, time, [*lines, float(v[top])])
        if np.any(np.diff(np.sort(longer)) < 1.0 / n):
            break
        lines = longer
        chances.append(chance)
    covariance = TAPER_CORRELATION * np.linalg.inv(information)
    assert first is not None
    spurs = [
        _spur(line, part, float(np.interp(line, v, model)), n, interval, chance)
        for line, part, chance in zip(lines, parts, chances, strict=True)
    ]
    return NoiseSpectrum(
        squares=squares,
        covariance=covariance,
        spurs=tuple(sorted(spurs, key=lambda s: -s.amplitude)),
        frequency=v / interval,
        density=first * interval,
        model=model * interval,
        drift=slope / interval,
    )


def _checked(series: ArrayLike, interval: float, false_alarm: float) -> NDArray[np.float64]:
    y = np.asarray(series, dtype=float)
    if y.ndim != 1 or y.size < FEWEST:
        raise ValidityError(f"a series of shape {y.shape} has too few readings (expected at least {FEWEST})")
    if not np.all(np.isfinite(y)):
        where = int(np.flatnonzero(~np.isfinite(y))[0])
        raise ValidityError(f"reading {where} of the series is {y[where]} (expected numbers at equal intervals)")
    if np.ptp(y) == 0.0:
        raise ValidityError(f"all {y.size} readings are {y[0]}: no noise (a dead channel?)")
    if not 0.0 < interval < np.inf:
        raise ValidityError(f"interval {interval} s is not above 0 and finite")
    if not 0.0 < false_alarm < 1.0:
        raise ValidityError(f"false alarm {false_alarm} is not a probability between 0 and 1")
    return y - y.mean()


def _basis(v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Densities (k, 3) of unit white, flicker and walk."""
    s = np.sin(np.pi * v)
    return np.stack([np.full_like(s, 2.0), np.pi / s, 0.5 / s**2], axis=1)


def _periodogram(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """One-sided density per cycle a reading, Hann taper."""
    n = y.size
    taper = 0.5 - 0.5 * np.cos(TWO_PI * (np.arange(n) + 0.5) / n)
    return 2.0 * np.abs(np.fft.rfft(taper * y)) ** 2 / np.sum(taper**2)


def _whittle(ordinates: NDArray[np.float64], basis: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Squares of the three noises by maximum likelihood, none negative, and the information (3, 3)."""
    from scipy.optimize import minimize

    parts = np.full(3, 1.0 / 3.0)
    for _ in range(CLIMBS):  # each step raises the likelihood and keeps all parts above zero
        weighted = basis / (basis @ parts)[:, None]
        parts = parts * np.sqrt((ordinates / (basis @ parts)) @ weighted / weighted.sum(axis=0))
    scale = np.maximum(parts, 1e-6 * ordinates.mean() / basis.mean(axis=0))
    unit = basis * scale

    def cost(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        density = unit @ x
        return float(np.sum(np.log(density) + ordinates / density)), unit.T @ ((density - ordinates) / density**2)

    least = [(1e-9, None)] * 3  # not zero itself, where the density of a single kind would vanish
    best = minimize(cost, parts / scale, jac=True, method="L-BFGS-B", bounds=least, options={"ftol": 1e-14}).x
    best = np.where(best > 1e-6, best, 0.0) * scale
    weighted = basis / (basis @ best)[:, None]
    return best, weighted.T @ weighted


def _waves(time: NDArray[np.float64], lines: list[float]) -> NDArray[np.float64]:
    """Sines and cosines (n, 2 lines)."""
    turn = TWO_PI * np.outer(time, lines)
    return np.concatenate([np.sin(turn), np.cos(turn)], axis=1)


def _fit_lines(y: NDArray, time: NDArray, lines: list[float]) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Phasors c (lines,) with y = Re(-i c e^{2 pi i v t}) = |c| sin(2 pi v t + arg c), and residuals."""
    if not lines:
        return np.zeros(0, dtype=complex), y
    waves = _waves(time, lines)
    coefficients = np.linalg.lstsq(waves, y, rcond=None)[0]
    return coefficients[: len(lines)] + 1j * coefficients[len(lines) :], y - waves @ coefficients


def _refined(y: NDArray, time: NDArray, lines: list[float]) -> list[float]:
    """Refine frequencies by Gauss-Newton steps of at most half an ordinate."""
    for _ in range(ITERATIONS):
        parts, residuals = _fit_lines(y, time, lines)
        turn = TWO_PI * np.outer(time, lines)
        slope = TWO_PI * time[:, None] * np.real(parts * np.exp(1j * turn))  # d/dv of |c| sin(turn + arg c)
        step = np.linalg.lstsq(np.concatenate([slope, _waves(time, lines)], axis=1), residuals, rcond=None)[0]
        move = np.clip(step[: len(lines)], -0.5 / y.size, 0.5 / y.size)
        lines = [float(np.clip(v + d, 0.5 / y.size, 0.5)) for v, d in zip(lines, move, strict=True)]
        if np.all(np.abs(move) < 1e-6 / y.size):
            break
    return lines


def _spur(line: float, part: complex, density: float, n: int, interval: float, chance: float) -> Spur:
    amplitude = abs(part)
    return Spur(
        frequency_hz=line / interval,
        u_frequency_hz=float(np.sqrt(3.0 * density / n**3) / (np.pi * amplitude)) / interval,
        amplitude=float(amplitude),
        u_amplitude=float(np.sqrt(density / n)),
        phase=float(np.angle(part)),
        false_alarm=chance,
    )
