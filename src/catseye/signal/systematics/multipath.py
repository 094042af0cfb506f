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


def cats_eye_cyclic(share: float, wavelength: float, orders: int, *, extra_path: float = 0.0) -> tuple[Array, Array]:
    """Cyclic coefficients (K,), cosine and sine, m, of cat's-eye error.

    A wave of the light's own phase x.

    share        returned once more for each return, 0 to below 1
    wavelength   m, the modulation's group wavelength in air
    orders       K
    extra_path   m, the path from detector to target less the distance that x counts: D0, plus mirror to detector

    With psi = 4 pi extra_path/wavelength - x. Raises ValidityError for a share outside these limits.

    Source: Fourier series of -arg(1 - q exp(-i psi)): q^k/k sin(k psi) wavelength/(4 pi). Exact.

    >>> [f"{c:.2e}" for c in cats_eye_cyclic(0.01, 0.2, 2)[1]]
    ['-1.59e-04', '-7.96e-07']
    """
    q = float(_shares(np.array([share]))[0])
    k = np.arange(1, orders + 1)
    size = q**k / k * wavelength / (2.0 * TWO_PI)
    turn = k * 2.0 * TWO_PI * extra_path / wavelength
    return size * np.sin(turn), -size * np.cos(turn)


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
