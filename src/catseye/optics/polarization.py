"""Polarized light as Jones vectors, and reflection in three dimensions.

Time runs as exp(-i w t): a lagging phase has a positive angle, an absorbing index is n + ik. s lies across the plane
of incidence, p = k x s in it, k the direction of travel before or after. So a mirror in air has r_s = -1, r_p = +1, and
straight on r_p = -r_s for every surface: the same field, since p turns with k.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError

Complex = NDArray[np.complex128]
Surface = Callable[[Array], tuple[Complex, Complex]]  # cosine of incidence -> r_s, r_p
STRAIGHT = 1e-9  # sine of an incidence below which any s does: r_p = -r_s there


def reflection(cosine: ArrayLike, *, inside: float, outside: complex) -> tuple[Complex, Complex]:
    """Amplitude reflection coefficients (r_s, r_p) of a surface.

    cosine   (...) of the angle of incidence, 0 to 1
    inside   index of the medium of the incoming light, above 0
    outside  index n + ik of the other medium, k 0 or more; infinite for a perfect conductor

    Source: [BORN99] section 1.5.2, eq. 21 with eq. 13 of section 14.2 for metals; beyond the critical angle the
    same with an imaginary cosine. Exact for a clean flat surface.

    >>> [round(float(r.real), 4) for r in reflection(1.0, inside=1.0, outside=1.5)]
    [-0.2, 0.2]
    """
    c = np.asarray(cosine, dtype=float)
    if not np.all((c >= 0.0) & (c <= 1.0 + 1e-12)):
        wrong = c[~((c >= 0.0) & (c <= 1.0 + 1e-12))].flat[0]
        raise ValidityError(f"cosine of incidence {wrong:g} is outside 0 to 1")
    if not (0.0 < inside < np.inf):
        raise ValidityError(f"index inside {inside:g} is not above 0 and finite")
    one = np.ones(c.shape, dtype=complex)
    if np.isinf(outside):
        return -one, one
    ratio = complex(outside) / inside
    if not (ratio.real >= 0.0 and ratio.imag >= 0.0 and abs(ratio) > 0.0):
        raise ValidityError(f"index behind {outside} has a part below 0 (expected n + ik, both 0 or more)")
    across = ratio**2 - (1.0 - np.minimum(c, 1.0) ** 2)
    inner = np.sqrt(across + 0j)  # (n behind / n inside) cos: real, or imaginary above 0, so that the wave dies out
    return (c - inner) / (c + inner) * one, (ratio**2 * c - inner) / (ratio**2 * c + inner) * one


def surface(*, inside: float, outside: complex) -> Surface:
    """Reflection of one surface as a function of the cosine alone.

    A coating of thin films is another such function.

    inside, outside   as for `reflection`

    Source: as `reflection`.

    >>> [float(r.real) for r in surface(inside=1.0, outside=complex("inf"))(np.array(0.5))]
    [-1.0, 1.0]
    """
    return lambda cosine: reflection(cosine, inside=inside, outside=outside)


def total_reflection_retardance(cosine: ArrayLike, index: ArrayLike) -> Array:
    """Phase (...), rad, by which s lags p in total reflection.

    The angle of r_s/r_p; NaN where reflection is not total.

    cosine   of the angle of incidence inside, 0 to 1
    index    phase index of the glass over that of the medium outside, above 1

    0 at grazing incidence and at the critical angle. A mirror has half a turn in the same axes.

    Source: [BORN99] section 1.5.4, eq. 61, tan(d/2) = cos I sqrt(sin^2 I - 1/n^2) / sin^2 I. Exact. Fresnel's rhomb:
    glass of 1.51 under 54 deg 37' or 48 deg 37' makes an eighth of a wave, [BORN99] there.

    >>> np.degrees(total_reflection_retardance(np.cos(np.radians([54.617, 48.617])), 1.51)).round(1)
    array([45., 45.])
    """
    c, n = np.asarray(cosine, dtype=float), np.asarray(index, dtype=float)
    square = 1.0 - c**2
    with np.errstate(invalid="ignore"):
        return 2.0 * np.arctan2(c * np.sqrt(square - n**-2.0), square)


def reflection_matrix(direction: ArrayLike, normal: ArrayLike, mirror: Surface) -> tuple[Array, Complex]:
    """Direction (..., 3) after a reflection, and field matrix (..., 3, 3).

    direction   (..., 3) unit vectors of travel
    normal      (3,) unit vector, either way
    mirror      what the surface reflects, see `surface`

    The matrix also maps the direction of travel to the new one, so that matrices of successive surfaces multiply.

    Source: [YUN11] eqs. 8 to 11. Exact for plane waves.

    >>> to, p = reflection_matrix([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], surface(inside=1.0, outside=complex("inf")))
    >>> p.real.round(12) + 0.0
    array([[-1.,  0.,  0.], [ 0., -1.,  0.], [ 0.,  0., -1.]])
    """
    k, n = np.asarray(direction, dtype=float), np.asarray(normal, dtype=float)
    along = (k @ n)[..., None]
    to = k - 2.0 * along * n
    s = _across(k, n)
    r_s, r_p = mirror(np.minimum(np.abs(along[..., 0]), 1.0))
    return to, transfer(k, to, s, r_s, r_p)


def transfer(before: Array, after: Array, s: Array, gain_s: ArrayLike, gain_p: ArrayLike) -> Complex:
    """Matrix (..., 3, 3) of a surface from s and p gains.

    It turns `before` into `after` and multiplies the s and p parts of the field.

    before, after    (..., 3) unit vectors of travel
    s                (..., 3) unit vectors across both
    gain_s, gain_p   (...) amplitudes, complex

    Source: [YUN11] eq. 11.

    >>> x, z = np.eye(3)[0], np.eye(3)[2]
    >>> bool(np.allclose(transfer(z, z, x, 1.0, 1.0), np.eye(3)))
    True
    """
    parts = ((s, s, gain_s), (np.cross(after, s), np.cross(before, s), gain_p), (after, before, 1.0))
    return np.sum([_dyad(out, into, gain) for out, into, gain in parts], axis=0)


def linear(azimuth: ArrayLike) -> Complex:
    """Jones vector (..., 2) of linearly polarized light.

    azimuth   (...) rad, of the field from the first axis towards the second

    Source: definition.

    >>> linear(np.pi / 2).real.round(12)
    array([0., 1.])
    """
    a = np.asarray(azimuth, dtype=float)
    return np.stack([np.cos(a), np.sin(a)], axis=-1).astype(complex)


def retarder(retardance: ArrayLike, azimuth: ArrayLike) -> Complex:
    """Jones matrix (..., 2, 2) of a wave plate, in fixed axes.

    The same in both directions.

    retardance   (...) rad, slow axis behind the fast one: pi/2 a quarter, pi a half wave
    azimuth      (...) rad, of the fast axis

    Source: [CHIPMAN18] section 5.4 (with the sign of exp(-i w t)); the common phase of both axes is omitted.

    >>> light = retarder(np.pi / 2, np.pi / 4) @ linear(0.0)  # round
    >>> round(float(np.angle(light[1] / light[0]) / np.pi), 6)
    -0.5
    """
    d, a = np.broadcast_arrays(np.asarray(retardance, dtype=float), np.asarray(azimuth, dtype=float))
    fast, slow = linear(a), linear(a + 0.5 * np.pi)
    return _dyad(fast, fast, np.exp(-0.5j * d)) + _dyad(slow, slow, np.exp(0.5j * d))


def retardance(jones: ArrayLike) -> Array:
    """Retardance (...), rad, 0 to pi, of a lossless matrix.

    The plate is combined with turns before and after.

    jones   (..., 2, 2), unitary but for a factor

    In fixed axes a mirror is not a retarder. In axes (s, k x s), which follow the light, an odd number of
    reflections gives pi less this.

    Source: [PLAYER88]: every lossless matrix is a turn, a linear retarder and a turn. With J = A D B, A and B turns,
    J^T J = B^T D^2 B has the eigenvalues exp(-+i d) of one factor: its trace over 2 det J is cos d. Exact.

    >>> round(float(retardance(retarder(0.4, 1.0))), 12)
    0.4
    """
    j = np.asarray(jones, dtype=complex)
    trace = np.sum(j**2, axis=(-2, -1))  # of J^T J
    return np.arccos(np.clip(np.real(trace / (2.0 * np.linalg.det(j))), -1.0, 1.0))


def ellipse(field: ArrayLike) -> tuple[Array, Array]:
    """Azimuth and ellipticity angle, rad, of Jones vectors.

    Azimuth is within a quarter turn either way, ellipticity within an eighth.

    field   (..., 2)

    The ellipticity is above zero where the field turns from the first axis to the second.

    Source: [BORN99] section 1.4.2, eqs. 29 and 30 with 43, in Stokes' parameters.

    >>> [round(float(a), 6) for a in ellipse([1.0, 1j])]
    [0.0, 0.785398]
    """
    e = np.asarray(field, dtype=complex)
    cross = np.conj(e[..., 0]) * e[..., 1]
    power = np.sum(np.abs(e) ** 2, axis=-1)
    difference = np.abs(e[..., 0]) ** 2 - np.abs(e[..., 1]) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        turning = 0.5 * np.arcsin(np.clip(2.0 * np.imag(cross) / power, -1.0, 1.0))
    return 0.5 * np.arctan2(2.0 * np.real(cross), difference), turning


def _dyad(out: NDArray, into: NDArray, gain: ArrayLike) -> Complex:
    """Jones matrix gain * out into^T."""
    return np.asarray(gain, dtype=complex)[..., None, None] * out[..., :, None] * into[..., None, :]


def _across(k: Array, n: Array) -> Array:
    """Unit vectors across the plane of incidence; any at normal incidence."""
    s = np.cross(k, np.broadcast_to(n, k.shape))
    size = np.linalg.norm(s, axis=-1, keepdims=True)
    spare = np.cross(k, np.eye(3)[np.argmin(np.abs(k), axis=-1)])
    spare = spare / np.linalg.norm(spare, axis=-1, keepdims=True)
    straight = size < STRAIGHT
    return np.where(straight, spare, s / np.where(straight, 1.0, size))
