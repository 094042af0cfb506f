"""Paraxial optics in matrices: rays and Gaussian beams through systems.

Through lenses, mirrors, plates and space, plane by plane.

A ray is (height, index times slope): every matrix has determinant 1 and a flat interface is the identity. A beam is
1/q = 1/R - i M^2 wavelength/(pi w^2), with R the wavefront's radius over the index, above zero where it spreads, and
the wavelength that of vacuum. The two planes of an elliptical or astigmatic beam have separate matrices.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError

Complex = NDArray[np.complex128]


def free_space(length: ArrayLike, index: ArrayLike = 1.0) -> Array:
    """Matrix (..., 2, 2) of propagation through a medium.

    length   (...) m
    index    (...) phase index

    Source: [SIEGMAN86] ch. 15, with reduced slopes.

    >>> free_space(0.3, 1.5).round(9).tolist()
    [[1.0, 0.2], [0.0, 1.0]]
    """
    return _matrix(1.0, np.asarray(length, float) / np.asarray(index, float), 0.0, 1.0)


def thin_lens(focal_length: ArrayLike) -> Array:
    """Matrix (..., 2, 2) of a thin lens in air.

    focal_length   (...) m, not 0, above zero for a collecting lens; infinite for none

    Source: [SIEGMAN86] ch. 15.
    """
    f = np.asarray(focal_length, float)
    if np.any(f == 0.0):
        raise ValidityError("focal length 0 m of a lens (expected another, or inf for none)")
    return _matrix(1.0, 0.0, -1.0 / f, 1.0)


def interface(before: ArrayLike, after: ArrayLike, radius: ArrayLike = np.inf) -> Array:
    """Matrix (..., 2, 2) of a spherical interface at normal incidence.

    before, after    (...) phase indices
    radius           (...) m, above zero where the centre lies behind the surface; infinite for a plane

    Source: [SIEGMAN86] ch. 15, with reduced slopes.

    >>> interface(1.0, 1.5, 0.1).round(9).tolist()
    [[1.0, 0.0], [-5.0, 1.0]]
    """
    return _matrix(1.0, 0.0, (np.asarray(before, float) - np.asarray(after, float)) / np.asarray(radius, float), 1.0)


def thick_lens(r1: ArrayLike, r2: ArrayLike, *, thickness: ArrayLike, index: ArrayLike) -> Array:
    """Matrix (..., 2, 2) of a lens in air, vertex to vertex.

    r1, r2      (...) m, radii, above zero where the centre lies behind the surface: a biconvex lens has r1 > 0 > r2
    thickness   (...) m
    index       (...) phase index of the glass over that of the air

    >>> lens = thick_lens(0.1, -0.1, thickness=0.01, index=1.5)
    >>> round(-1 / float(lens[1, 0]), 6)  # focal length by the lens maker's formula: 0.101695
    0.101695
    """
    return interface(index, 1.0, r2) @ free_space(thickness, index) @ interface(1.0, index, r1)


def mirror(radius: ArrayLike = np.inf, incidence: ArrayLike = 0.0, *, in_plane: bool = True) -> Array:
    """Matrix (..., 2, 2) of a mirror in air, unfolded.

    radius      (...) m, above zero for a hollow mirror, which collects; infinite for a flat one
    incidence   (...) rad, 0 to below a right angle
    in_plane    True for rays in the plane of incidence: focal length R cos/2; across it: R/(2 cos)

    Source: [SIEGMAN86] ch. 15.
    """
    c = np.cos(np.asarray(incidence, float))
    if np.any(c <= 0.0):
        raise ValidityError("incidence on a mirror is not below a right angle")
    return thin_lens(0.5 * np.asarray(radius, float) * (c if in_plane else 1.0 / c))


def plate(thickness: ArrayLike, index: ArrayLike, incidence: ArrayLike = 0.0, *, in_plane: bool = True) -> Array:
    """Matrix (..., 2, 2) of a plane-parallel plate in air, along the refracted axis.

    thickness   (...) m, of the plate, not of the path in it
    index       (...) phase index over that of the air
    incidence   (...) rad, 0 to below a right angle
    in_plane    True for rays in the plane of incidence, else across it

    A tilted plate makes a converging beam astigmatic.

    Source: derived: the path in it is t n/root, root = sqrt(n^2 - sin^2); across, the reduced path is t/root; in the
    plane both faces narrow the beam, t cos^2 n^2/root^3.

    >>> round(float(plate(0.003, 1.5)[0, 1]), 9)
    0.002
    """
    t, n, s = np.asarray(thickness, float), np.asarray(index, float), np.sin(np.asarray(incidence, float))
    root = np.sqrt(n**2 - s**2)
    return _matrix(1.0, t * (1.0 - s**2) * n**2 / root**3 if in_plane else t / root, 0.0, 1.0)


def through(*elements: Array) -> Array:
    """Matrix (..., 2, 2) of elements in the order of the light."""
    total = np.eye(2)
    for element in elements:
        total = element @ total
    return total


def beam_at_waist(waist: ArrayLike, wavelength: ArrayLike, quality: ArrayLike = 1.0) -> Complex:
    """Complex parameter q (...), m, of a beam at its waist.

    It is i times the Rayleigh range.

    waist        (...) m, above 0: radius at 1/e^2 of the intensity
    wavelength   m, above 0, in vacuum
    quality      (...) M^2, at least 1

    Source: [SIEGMAN86] eq. 17.4; M^2 as an embedded ideal beam, [ISO05].

    >>> complex(beam_at_waist(0.010, 0.78e-6)).imag.__round__(3)
    402.768
    """
    w, light, m = (np.asarray(v, float) for v in (waist, wavelength, quality))
    if not (np.all((w > 0.0) & (w < np.inf)) and np.all((light > 0.0) & (light < np.inf))):
        raise ValidityError(f"waist {w} m or wavelength {light} m is not above 0 and finite")
    if not np.all(m >= 1.0):
        raise ValidityError(f"beam quality M^2 {m} is below 1, the limit of an ideal beam")
    return 1j * np.pi * w**2 / (m * light)


def onward(q: ArrayLike, matrix: Array) -> Complex:
    """Complex parameter (...), m, after an element or a system.

    q        (...) m
    matrix   (..., 2, 2)

    Source: [SIEGMAN86] ch. 20: (A q + B)/(C q + D), with reduced q.

    >>> q = onward(beam_at_waist(0.010, 0.78e-6), through(free_space(0.5), thin_lens(1.0), free_space(1.0)))
    >>> round(float(radius(q, 0.78e-6)) * 1e6, 2)  # f wavelength/(pi w) in the focal plane
    24.83
    """
    z = np.asarray(q, dtype=complex)
    return (matrix[..., 0, 0] * z + matrix[..., 0, 1]) / (matrix[..., 1, 0] * z + matrix[..., 1, 1])


def radius(q: ArrayLike, wavelength: ArrayLike, quality: ArrayLike = 1.0) -> Array:
    """Radius (...), m, at 1/e^2 of the intensity.

    q            (...) m
    wavelength   m, in vacuum
    quality      (...) M^2

    Source: [SIEGMAN86] eq. 17.4.
    """
    inverse = -np.imag(1.0 / np.asarray(q, dtype=complex))
    return np.sqrt(np.asarray(quality, float) * np.asarray(wavelength, float) / (np.pi * inverse))


def wavefront_curvature(q: ArrayLike) -> Array:
    """Curvature 1/R (...), 1/m, of the wavefront in air.

    Above zero where the beam spreads, 0 at a waist.

    q   (...) m

    Source: [SIEGMAN86] eq. 17.4.
    """
    return np.asarray(np.real(1.0 / np.asarray(q, dtype=complex)))


def waist_ahead(q: ArrayLike) -> Array:
    """Distance (...), m, in air to the waist; below zero behind.

    q   (...) m

    Source: q is real part plus i times the Rayleigh range.
    """
    return -np.real(np.asarray(q, dtype=complex))


def _matrix(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Array:
    parts = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (a, b, c, d)))
    return np.stack([np.stack(parts[:2], axis=-1), np.stack(parts[2:], axis=-1)], axis=-2)
