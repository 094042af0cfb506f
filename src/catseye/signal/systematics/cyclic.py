"""Cyclic deviation of a range: causes, and orders that phases can separate.

x is the phase after the electronics', in radians, as measured. It falls by 2 pi for each half wavelength of distance.
A phase read too high by d is a range read too long by -d wavelength/(4 pi).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError

WORST_CONDITION = 1e8  # of columns scaled to unit length: beyond it half of the digits are lost
WORST_INFLATION = 5.0  # of a coefficient's standard uncertainty over that of evenly spread phases


def cyclic_range(phase_fraction: ArrayLike, cosine: ArrayLike, sine: ArrayLike) -> Array:
    """Cyclic range error, m, as a Fourier series of x.

    The sum over k of cosine[k-1] cos(k x) + sine[k-1] sin(k x), positive where the range reads too long.

    phase_fraction   (...) rad, x, phase after the electronics'; any turn
    cosine, sine     (K,) m each, orders 1 to K; empty for none

    Raises ValidityError where cosine and sine differ in length.

    Source: a Fourier series; order 1 is what [RUEGER90] treats as the cyclic error of EDM. A definition: exact.

    >>> round(float(cyclic_range(np.pi / 2, [0.0, 2e-6], [5e-6, 0.0])), 9)
    3e-06
    """
    c, s = _coefficients(cosine, sine)
    return cyclic_design(phase_fraction, len(c)) @ np.concatenate([c, s])


def cyclic_slope(phase_fraction: ArrayLike, cosine: ArrayLike, sine: ArrayLike) -> Array:
    """Derivative of `cyclic_range` by x, m/rad.

    phase_fraction   (...) rad, x
    cosine, sine     (K,) m each

    Raises ValidityError where cosine and sine differ in length.

    >>> float(cyclic_slope(0.0, [1e-6], [3e-6]))
    3e-06
    """
    c, s = _coefficients(cosine, sine)
    k = np.arange(1, len(c) + 1)
    return cyclic_design(phase_fraction, len(c)) @ np.concatenate([k * s, -k * c])


def cyclic_design(phase_fraction: ArrayLike, orders: int | Sequence[int]) -> Array:
    """Derivatives (..., 2K) of `cyclic_range`: all cosines, then all sines.

    phase_fraction   (...) rad, x
    orders           K for orders 1 to K, or the orders themselves, each at least 1

    Raises ValidityError for an order that is not a whole number above 0.

    >>> cyclic_design(0.0, 2).tolist()
    [1.0, 1.0, 0.0, 0.0]
    """
    angle = np.asarray(phase_fraction, dtype=float)[..., None] * _orders(orders)
    return np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)


def leakage_range(phase_fraction: ArrayLike, relative_leakage: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from unsubtracted leakage, m, positive too long.

    A wave of the measured phase.

    phase_fraction     rad, x, of light and leakage together
    relative_leakage   complex, leakage phasor over the light's amplitude, turned back by the electronics' phase;
                       magnitude below 1
    wavelength         m, the modulation's group wavelength in air

    The sine rule in the triangle of light, leakage and their sum gives x - x_light = arcsin(r sin(a - x)), a the angle
    of the leakage. It has odd orders only: 1 with r wavelength/(4 pi), 3 with r^3/24 in place of r. As a wave of the
    light's own phase the same deviation has every order k with r^k/k. The effect of the leakage on the reference is a
    constant, not included here.

    Raises ValidityError where the leakage is not smaller than the light.

    Source: [PARKER04] sec. 5.2.1 asks for it; derived here. Exact.

    >>> f"{float(leakage_range(0.0, 0.001j, 0.2)):.3e}"
    '-1.592e-05'
    """
    leakage = np.asarray(relative_leakage, dtype=complex)
    if np.any(np.abs(leakage) >= 1.0):
        raise ValidityError(f"leakage {np.abs(leakage).max():.3g} of the light is not below 1: it dominates the phase")
    turned = leakage * np.exp(-1j * np.asarray(phase_fraction, dtype=float))
    return -np.arcsin(turned.imag) * np.asarray(wavelength, dtype=float) / (2.0 * TWO_PI)


def imbalance_range(phase_fraction: ArrayLike, *, gain: ArrayLike, skew: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from unequal quadrature channels, m.

    The channels are cos x and (1 + gain) sin(x + skew).

    phase_fraction   rad, x, as measured by these two channels
    gain             of the sine channel over the cosine channel, less 1; above -1
    skew             rad, departure from quadrature, magnitude below pi/2
    wavelength       m, the modulation's group wavelength in air

    To first order the phase reads (gain/2) sin 2x + (skew/2)(1 + cos 2x) too high: order 2, and a constant that the
    reference shares. The notes' instrument takes both channels from one converter and has none of this; an analogue
    detector of both quadratures, or an image frequency in the mixer, has.

    Raises ValidityError outside these limits.

    Source: derived here by solving both channels for x. Exact.

    >>> f"{float(imbalance_range(np.pi / 4, gain=0.001, skew=0.0, wavelength=0.2)):.2e}"
    '-7.95e-06'
    """
    g, e = np.asarray(gain, dtype=float), np.asarray(skew, dtype=float)
    if np.any(g <= -1.0) or np.any(np.abs(e) >= np.pi / 2):
        raise ValidityError(
            f"gain {g.min():.3g} (above -1) or skew {np.abs(e).max():.3g} rad (below pi/2) is no channel"
        )
    x = np.asarray(phase_fraction, dtype=float)
    true = np.arctan2(np.sin(x) / (1.0 + g) - np.cos(x) * np.sin(e), np.cos(x) * np.cos(e))
    excess = np.angle(np.exp(1j * (x - true)))
    return -excess * np.asarray(wavelength, dtype=float) / (2.0 * TWO_PI)


def cyclic_orders(curve: ArrayLike, orders: int) -> tuple[float, Array, Array]:
    """Mean, cosine and sine coefficients of a deviation sampled at x = 2 pi j/n, j = 0 to n - 1.

    curve    (n,) m
    orders   K, below n/2

    Raises ValidityError where n points do not resolve K orders.

    >>> x = 2 * np.pi * np.arange(8) / 8
    >>> mean, cosine, sine = cyclic_orders(1.0 + 3.0 * np.sin(2 * x), 2)
    >>> round(float(sine[1]), 12)
    3.0
    """
    y = np.asarray(curve, dtype=float)
    if y.ndim != 1 or not 0 < orders < y.size / 2:
        raise ValidityError(f"{y.size} points of a cycle do not resolve {orders} orders (expected over two an order)")
    spectrum = np.fft.rfft(y)[: orders + 1] * (2.0 / y.size)
    return 0.5 * float(spectrum[0].real), spectrum[1:].real, -spectrum[1:].imag


@dataclass(frozen=True, eq=False)
class Separability:
    """Orders that given phases can separate.

    orders      those that can be estimated together, the lowest first
    inflation   (K,) of orders 1 to K: standard uncertainty of the order's worse coefficient, with the orders before it,
                over that of phases spread evenly, sigma sqrt(2/n); infinite where undefined or not requested
    condition   number of the retained columns, scaled to unit length
    """

    orders: tuple[int, ...]
    inflation: Array
    condition: float


def separable_orders(
    phase_fraction: ArrayLike, orders: int, *, nuisance: ArrayLike | None = None, worst: float = WORST_INFLATION
) -> Separability:
    """Orders separable from each other and from nuisance columns.

    phase_fraction   (n,) rad
    orders           K, the highest order requested
    nuisance         (n, q) columns estimated as well: by default one, the constant
    worst            inflation of any coefficient's standard uncertainty beyond which an order is left out

    Orders are added until any coefficient goes beyond `worst`; none is retained above an excluded one, which would be
    mistaken for it. A rail of less than a half wavelength does not separate order 1 from a constant; phases at 2 pi j/n
    do not separate order k from n - k.

    Raises ValidityError for orders below 0.

    >>> separable_orders(np.arange(5) * 2 * np.pi / 5, 3).orders
    (1, 2)
    """
    x = np.asarray(phase_fraction, dtype=float)
    further = np.ones((len(x), 1)) if nuisance is None else np.asarray(nuisance, dtype=float)
    retained: tuple[int, ...] = ()
    inflation = np.full(len(_orders(orders)), np.inf)
    for order in range(1, orders + 1):
        trial = (*retained, order)
        design = np.concatenate([cyclic_design(x, trial), further], axis=1)
        u = _inflation(design)
        if u is None:
            break
        k = len(trial)
        inflation[order - 1] = max(u[k - 1], u[2 * k - 1])
        if max(u[: 2 * k]) > worst:
            break
        retained = trial
    columns = np.concatenate([cyclic_design(x, retained) if retained else np.empty((len(x), 0)), further], axis=1)
    return Separability(retained, inflation, float(np.linalg.cond(columns / np.linalg.norm(columns, axis=0))))


def _inflation(design: Array) -> Array | None:
    """Standard uncertainty of each coefficient over that of a wave at evenly spread phases; None if inseparable."""
    length = np.linalg.norm(design, axis=0)
    count, columns = design.shape
    if count < columns or np.any(length == 0.0) or np.linalg.cond(design / length) > WORST_CONDITION:
        return None
    inverse = np.linalg.pinv(design / length) / length[:, None]
    return np.linalg.norm(inverse, axis=1) * np.sqrt(count / 2.0)


def _coefficients(cosine: ArrayLike, sine: ArrayLike) -> tuple[Array, Array]:
    c, s = np.atleast_1d(np.asarray(cosine, dtype=float)), np.atleast_1d(np.asarray(sine, dtype=float))
    if c.shape != s.shape or c.ndim != 1:
        raise ValidityError(f"{c.size} cosine and {s.size} sine coefficients do not pair (expected as many of each)")
    return c, s


def _orders(orders: int | Sequence[int]) -> NDArray[np.int64]:
    numbers = np.arange(1, orders + 1) if isinstance(orders, int | np.integer) else np.asarray(orders, dtype=np.int64)
    if np.any(numbers < 1) or (isinstance(orders, int | np.integer) and orders < 0):
        raise ValidityError(f"orders {orders} of a cyclic deviation are not whole numbers of at least 1")
    return numbers
