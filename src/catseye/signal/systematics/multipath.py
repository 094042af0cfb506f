"""Multipath: phase of the sum of several light paths.

Modulation phasors of the paths add. A share is the modulation's amplitude by a further path over that by the direct
one. Powers add here, as of light that does not interfere; where the paths are coherent, see
`feedback.interference_phase`. Delayed light makes the range too long for a short detour, unchanged for half a
modulation wavelength, too short for a longer one.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError


def multipath_error(shares: ArrayLike, excess_paths: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from further light paths, m, positive where too long.

    shares         (..., p) of the direct light, each at least 0, their sum below 1
    excess_paths   (..., p) m, full detour of each path against the direct one (twice a distance, for there and back)
    wavelength     m, the modulation's group wavelength in air

    The phasor over that of the direct light is 1 + sum s exp(-2 pi i e/wavelength), its phase turned into range. For
    detours far below the wavelength this is the mean detour sum(s e)/(1 + sum s), halved.

    Raises ValidityError for shares outside these limits.

    Source: [PARKER04] sec. 5.2.1 ("multiple retroreflector reflections") and chapter 6, item 3. Derived here; exact.

    >>> f"{float(multipath_error([0.001], [0.05], 0.2)):.3e}"
    '1.592e-05'
    """
    s = _shares(shares)
    turn = TWO_PI * np.asarray(excess_paths, dtype=float) / np.asarray(wavelength, dtype=float)[..., None]
    phasor = 1.0 + np.sum(s * np.exp(-1j * turn), axis=-1)
    return -np.angle(phasor) * np.asarray(wavelength, dtype=float) / (2.0 * TWO_PI)


def two_retroreflectors(share: ArrayLike, separation: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from a second retroreflector in the beam, m.

    Positive where too long.

    share         its return over that of the first, 0 to below 1
    separation    m, its distance beyond the first; below zero where it is nearer
    wavelength    m, the modulation's group wavelength in air

    Raises ValidityError for a share outside these limits.

    >>> f"{float(two_retroreflectors(0.01, -0.025, 0.2)):.3e}"
    '-1.591e-04'
    """
    return multipath_error(
        np.asarray(share, dtype=float)[..., None], 2.0 * np.asarray(separation, dtype=float)[..., None], wavelength
    )


def cats_eye_error(path: ArrayLike, share: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from light sent out again by the detector, m.

    Positive where too long; the detector is at the focus (cat's-eye).

    path         m, one way from detector to target, optical path over the index that is in the wavelength
    share        returned once more for each return, 0 to below 1: see `returned_share_of_pass`
    wavelength   m, the modulation's group wavelength in air

    Each further round turns by -psi, psi = 4 pi path/wavelength, with the share q: the geometric series sums to
    1/(1 - q exp(-i psi)) of the direct light. The range is too long by wavelength/(4 pi) arctan(q sin psi/(1 - q cos
    psi)), q sin psi to first order: period half a wavelength of distance, a cyclic deviation of order 1 and less of
    higher ones (q^k/k), at most arcsin(q). Where the beam is wider than its target, a second round returns less than
    the first: give `multipath_error` its shares.

    Raises ValidityError for a share outside these limits.

    Source: [PARKER04] chapter 6, item 3, names the effect. Derived here; exact for equal shares.

    >>> f"{float(cats_eye_error(100.0 + 0.025, 0.001, 0.2)):.3e}"
    '1.592e-05'
    """
    q = _shares(np.asarray(share, dtype=float)[..., None])[..., 0]
    w = np.asarray(wavelength, dtype=float)
    psi = 2.0 * TWO_PI * np.asarray(path, dtype=float) / w
    return np.arctan2(q * np.sin(psi), 1.0 - q * np.cos(psi)) * w / (2.0 * TWO_PI)


def second_pass_turn(
    phase_fraction: ArrayLike, amplitude: ArrayLike, cosine: ArrayLike, sine: ArrayLike
) -> tuple[Array, Array]:
    """Turn of a phasor by light sent out again by the detector, rad (...), with its derivatives (..., 2).

    Positive where the range is too long: times wavelength/(4 pi) it is the range error. The derivatives are those by
    `cosine` and `sine`, rad V.

    phase_fraction   (...) rad, x, phase after the electronics', which falls as the distance grows
    amplitude        (...) V, of the return
    cosine, sine     1/V, s sin(a) and -s cos(a): s the share of the second pass for each volt of return, a its angle
                     at x = 0

    The share of the second pass grows with the return, as both meet the same target and the same air: q = s amplitude.
    With psi = a - x it is `cats_eye_error`, to which it is equal. Raises ValidityError where the second pass is not
    smaller than the first.

    Source: [PARKER04] chapter 6, item 3, names the effect. Derived here; exact for equal shares.

    >>> turn, _ = second_pass_turn(0.0, 2.0, 0.0005, 0.0)
    >>> f"{float(turn) * 0.2 / (4 * np.pi):.3e}"
    '1.592e-05'
    """
    x, volts = np.asarray(phase_fraction, dtype=float), np.asarray(amplitude, dtype=float)
    c, s = np.asarray(cosine, dtype=float), np.asarray(sine, dtype=float)
    _shares((volts * np.hypot(c, s))[..., None])
    across, along = volts * (c * np.cos(x) + s * np.sin(x)), volts * (c * np.sin(x) - s * np.cos(x))  # q sin, q cos psi
    by_across, by_along = np.stack([np.cos(x), np.sin(x)], axis=-1), np.stack([np.sin(x), -np.cos(x)], axis=-1)
    direct, square = (1.0 - along)[..., None], (1.0 - along) ** 2 + across**2
    slopes = (volts / square)[..., None] * (direct * by_across + across[..., None] * by_along)
    return np.arctan2(across, 1.0 - along), slopes


def second_pass_slopes(
    phase_fraction: ArrayLike, amplitude: ArrayLike, cosine: ArrayLike, sine: ArrayLike
) -> tuple[Array, Array]:
    """Derivatives of `second_pass_turn` by the phase, rad/rad, and by the amplitude, rad/V; arguments as there.

    Raises ValidityError where the second pass is not smaller than the first.

    >>> [f"{float(slope):.1e}" for slope in second_pass_slopes(0.0, 2.0, 5e-4, 5e-4)]
    ['1.0e-03', '5.0e-04']
    """
    x, volts = np.asarray(phase_fraction, dtype=float), np.asarray(amplitude, dtype=float)
    turn, by = second_pass_turn(x, volts, cosine, sine)
    c, s = np.asarray(cosine, dtype=float), np.asarray(sine, dtype=float)
    # the turn depends on the phasor of the pass alone: a change of x turns that, one of the amplitude stretches it
    by_phase = by[..., 0] * s - by[..., 1] * c
    by_share = by[..., 0] * c + by[..., 1] * s
    return by_phase, np.divide(by_share, volts, out=np.zeros_like(turn), where=volts > 0.0)


def returned_share_of_pass(
    detector_reflectance: ArrayLike, recollected: ArrayLike, path_transmission: ArrayLike, *, mirrors: ArrayLike = 1.0
) -> Array:
    """Share of a return that comes back once more.

    Detector, lens and target combined.

    detector_reflectance   of its face and window together, 0 to 1
    recollected            of that, the part that leaves in the beam again, 0 to 1 (1 for a mirror in the focus; for a
                           white scatterer the sine squared of the lens's half angle)
    path_transmission      of that, the part that the target sends back to the detector, 0 to 1
    mirrors                transmission of all other parts, both directions, 0 to 1

    Raises ValidityError for a number outside 0 to 1.

    >>> float(returned_share_of_pass(0.04, 0.02, 0.5)).__round__(6)
    0.0004
    """
    product = np.ones(())
    for name, value in (
        ("reflectance of the detector", detector_reflectance),
        ("recollected part", recollected),
        ("two-way transmission", path_transmission),
        ("transmission of the mirrors", mirrors),
    ):
        factor = np.asarray(value, dtype=float)
        outside = factor[(factor < 0.0) | (factor > 1.0)]
        if outside.size:
            raise ValidityError(f"{name} {float(outside[0]):.4g} is not within 0 to 1")
        product = product * factor
    return product


def largest_share(range_error: ArrayLike, wavelength: ArrayLike) -> Array:
    """Share of a path that shifts no range beyond a limit.

    range_error   m, above 0, at most an eighth of the wavelength
    wavelength    m, the modulation's group wavelength in air

    sin(4 pi error/wavelength): for 10 um at 1500 MHz it is 6.3e-4. The detector may then reflect that much over
    recollected times two-way transmission. Raises ValidityError outside these limits.

    Source: inverse of the bound arcsin(share). Exact.

    >>> f"{float(largest_share(1e-5, 0.199811)):.3e}"
    '6.289e-04'
    """
    error, w = np.asarray(range_error, dtype=float), np.asarray(wavelength, dtype=float)
    if np.any((error <= 0.0) | (error > w / 8.0)):
        raise ValidityError(
            f"a limit of {error.min():.3g} to {error.max():.3g} m is not within 0 to an eighth of a wavelength"
        )
    return np.sin(2.0 * TWO_PI * error / w)


def _shares(shares: ArrayLike) -> Array:
    s = np.asarray(shares, dtype=float)
    if np.any(s < 0.0) or np.any(np.sum(s, axis=-1) >= 1.0):
        raise ValidityError(
            "shares of further paths are below 0 or sum to 1 or more: the direct light is not the strongest"
        )
    return s
