"""Cube corner with dihedral errors: six slightly deviated beams.

With edges e_1, e_2, e_3 and faces across them whose normals have N_i . N_j = s_ij (the sine of what the dihedral angle
exceeds a right angle by), light along d that meets the faces in the order i, j, k comes back, to first order, along

    -d + 2 [ s_ij (e_j d_i - e_i d_j) + s_jk (e_k d_j - e_j d_k) + s_ik (e_k d_i - e_i d_k) ]

a rotation about the corner. At normal incidence, all errors equal, that is (4/3) sqrt 6 e along e_i - e_k: straight
away from the axis for angles too wide, towards it for angles too narrow; n times as much behind the face of glass.

The wave of each sector still seems to come from the corner: a lens that gathers all six on the detector sees no change
of range but of second order, distance x deviation^2 / 4 (5 nm at 100 m for 3 arcsec). A bare detector in the
beams has `pupil_offset`.
"""

from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.optics.gaussian_beam import share_within

ORDERS = tuple(permutations(range(3)))
SMALL = 1e-2  # rad: the formula's next order is a hundredth of it
NODES = 64


def deviations(errors: ArrayLike, index: float = 1.0) -> Array:
    """Deviations (6, 2) of the returned beams, rad, at normal incidence.

    x to the first edge, y across.

    errors   (3,) rad: excess of the dihedral angles between faces 2 and 3, 3 and 1, 1 and 2 over a right angle
    index    phase index of the glass over that of the air; 1 for a hollow corner

    Rows in the order of ORDERS, of the faces met first, second, last. Raises ValidityError beyond 0.01 rad.

    Source: [YODER58]; derived at the top of this file. To first order in the errors.

    >>> round(float(np.hypot(*deviations([1e-5, 1e-5, 1e-5])[0])) * 1e5, 4)
    3.266
    """
    e = np.asarray(errors, dtype=float)
    if e.shape != (3,) or not np.all(np.abs(e) <= SMALL):
        raise ValidityError(f"dihedral errors {e.tolist()} rad are not three within {SMALL:g}")
    around = np.arange(3) * 2.0 * np.pi / 3.0
    edges = np.sqrt(2.0 / 3.0) * np.stack([np.cos(around), np.sin(around)], axis=-1)  # their part across the axis
    along = -1.0 / np.sqrt(3.0)  # every component of d
    beams = []
    for i, j, k in ORDERS:
        turned = e[k] * (edges[j] - edges[i]) + e[i] * (edges[k] - edges[j]) + e[j] * (edges[k] - edges[i])
        beams.append(2.0 * along * index * turned)
    return np.array(beams)


def on_axis_share(deviation: float, *, aperture: float, beam_radius: float, wavelength: float) -> float:
    """On-axis far-field intensity over that of a perfect corner.

    All six beams have `deviation`.

    deviation     rad
    aperture      m, above 0: radius of the clear face
    beam_radius   m, above 0, at 1/e^2: of the Gaussian beam that lights it
    wavelength    m, above 0, of the light

    Source: [GOODMAN05] eq. 4-25, Fraunhofer's integral over six sectors of 60 deg, each tilted along its middle. It
    holds far beyond aperture^2 / wavelength, 800 m for 25 mm: nearer by, `collected_share` does.

    >>> round(on_axis_share(1.454e-5, aperture=0.0254, beam_radius=0.010, wavelength=0.78e-6), 3)
    0.768
    """
    radius, angle, weight = _sector(aperture, beam_radius)
    phase = 2.0 * np.pi / wavelength * deviation * radius * np.cos(angle)
    return float(np.abs(np.sum(weight * np.exp(1j * phase)) / np.sum(weight)) ** 2)


def collected_share(deviation: ArrayLike, distance: ArrayLike, *, beam_radius: ArrayLike, receiver: ArrayLike) -> Array:
    """Share of returned light in a centred receiver over a perfect corner.

    For short distances.

    deviation     rad, of all six beams
    distance      m, to the receiver
    beam_radius   m, above 0, of the returned beam at the receiver, at 1/e^2
    receiver      m, above 0: radius

    Source: geometry, each beam a Gaussian moved aside by distance x deviation: valid while that is less than
    the diffraction of a sector.

    >>> round(float(collected_share(1.454e-5, 100.0, beam_radius=0.010, receiver=0.025)), 4)
    1.0
    """
    aside = np.abs(np.asarray(deviation, dtype=float) * np.asarray(distance, dtype=float))
    return np.asarray(share_within(receiver, beam_radius, aside) / share_within(receiver, beam_radius))


def pupil_offset(deviation: float, *, aperture: float, beam_radius: float) -> float:
    """Range error on a bare detector in the six beams, m.

    Without a lens; positive where too long.

    deviation     rad, above 0 for beams that spread (angles too wide)
    aperture      m, above 0: radius of the clear face
    beam_radius   m, above 0, at 1/e^2: of the beam that lights it

    Source: half the mean of deviation x distance from the axis along the tilt; derived at the top of this file. A lens
    removes it.

    >>> round(pupil_offset(1.454e-5, aperture=0.0254, beam_radius=0.010) * 1e6, 3)
    0.044
    """
    radius, angle, weight = _sector(aperture, beam_radius / np.sqrt(2.0))  # of the power, not of the amplitude
    return 0.5 * deviation * float(np.sum(weight * radius * np.cos(angle)) / np.sum(weight))


def _sector(aperture: float, beam_radius: float) -> tuple[Array, Array, Array]:
    """Radii, angles from mid-sector, and amplitude weights, over a sixth of the face."""
    for name, value in (("aperture", aperture), ("beam_radius", beam_radius)):
        if not value > 0.0:
            raise ValidityError(f"{name} = {value} m is not above 0")
    x, w = np.polynomial.legendre.leggauss(NODES)
    radius, angle = 0.5 * aperture * (1.0 + x)[:, None], np.pi / 6.0 * x[None, :]
    return radius, angle, w[:, None] * w[None, :] * radius * np.exp(-((radius / beam_radius) ** 2))
