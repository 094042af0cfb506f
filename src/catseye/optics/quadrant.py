"""Spot on a quadrant detector: place from the halves' ratio, and the loop that centres it.

`detector.quadrant_signals` are the signals, and `detector.quadrant_position` the place to first order. Far from the
middle the ratio saturates: a spot wholly on one half reads 1 wherever it is. Here are the inverse for a Gaussian spot
and an integrating servo that needs only the ratio's sign and slope.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.optics.detector import quadrant_position, quadrant_signals


def centre_slope(spot: float) -> float:
    """Place over the halves' ratio at the middle, m: spot sqrt(pi/8).

    spot   m, above 0: radius at 1/e^2

    Source: derivative of erf(sqrt(2) x/w) at 0. Exact without a gap.

    >>> round(centre_slope(100e-6) * 1e6, 3)
    62.666
    """
    return float(spot * np.sqrt(np.pi / 8.0))


def place_of_ratio(ratio: ArrayLike, spot: float) -> Array:
    """Place (...), m, along one axis of a Gaussian spot.

    ratio   (...) difference of the halves over their sum; NaN results at and beyond -1 and 1, where it is saturated
    spot    m, above 0: radius at 1/e^2

    Source: erf(sqrt(2) x/w) inverted. Exact without a gap; a gap makes it read too far out.

    >>> float(place_of_ratio(0.6826894921, 100e-6).round(9))
    5e-05
    """
    if not 0.0 < spot < np.inf:
        raise ValidityError(f"spot {spot} m is not above 0 and finite")
    from scipy.special import erfinv

    q = np.asarray(ratio, dtype=float)
    return spot / np.sqrt(2.0) * erfinv(np.where(np.abs(q) < 1.0, q, np.nan))


def place_uncertainty(place: ArrayLike, spot: float, u_signal: float) -> Array:
    """Standard uncertainty (...), m, of `place_of_ratio` along an axis.

    place      (...) m, from the middle
    spot       m, above 0: radius at 1/e^2
    u_signal   noise of each quadrant over the sum of all four, independent

    Source: [JCGM100] eq. 10: the ratio's variance is 4 u^2 (1 + ratio^2), the slope its inverse derivative.

    >>> round(float(place_uncertainty(0.0, 100e-6, 1e-3)) * 1e9, 1)
    125.3
    """
    from scipy.special import erf

    x = np.asarray(place, dtype=float)
    ratio = erf(np.sqrt(2.0) * x / spot)
    return 2.0 * u_signal * np.sqrt(1.0 + ratio**2) * centre_slope(spot) * np.exp(2.0 * (x / spot) ** 2)


def centred_places(
    offset: ArrayLike,
    spot: float,
    *,
    gain: float,
    u_signal: float,
    steps: int,
    rng: np.random.Generator,
    gap: float = 0.0,
) -> Array:
    """Places (steps + 1, 2), m, of a spot that an integrating servo centres.

    offset     (2,) m, at the start
    spot       m, above 0: radius at 1/e^2
    gain       part of the place read that each step takes away; stable above 0 and below 2
    u_signal   noise of each quadrant over the sum of all four
    steps      number of corrections, 1 or more
    rng        draws the noise
    gap        m, 0 or more: dead width between the quadrants

    Each step reads `quadrant_position` to first order. Near the middle the place is a first-order autoregression, whose
    standard deviation is `settled_noise`; from outside the ratio saturates and the spot returns at a constant pace of
    gain times `centre_slope`. A spot wholly in the gap gives no reading, and stays.

    Raises ValidityError for a gain that is not stable.
    """
    if not 0.0 < gain < 2.0:
        raise ValidityError(f"gain {gain:g} of a centring servo is not above 0 and below 2, where it is stable")
    at = np.asarray(offset, dtype=float)
    places, slope = [at], centre_slope(spot)
    for _ in range(steps):
        signals = quadrant_signals(at[0], at[1], spot, gap) + u_signal * rng.normal(size=4)
        read = quadrant_position(signals, slope=slope)[0]
        at = at - gain * np.nan_to_num(read)
        places.append(at)
    return np.array(places)


def settled_noise(spot: float, *, gain: float, u_signal: float) -> float:
    """Standard deviation, m, of a centred spot along one axis.

    spot, gain, u_signal   as for `centred_places`

    Source: variance gain/(2 - gain) of the reading's, that of x' = (1 - gain) x - gain e with independent e. To first
    order, without a gap.

    >>> round(settled_noise(100e-6, gain=1.0, u_signal=1e-3) * 1e9, 1)
    125.3
    """
    return float(2.0 * u_signal * centre_slope(spot) * np.sqrt(gain / (2.0 - gain)))
