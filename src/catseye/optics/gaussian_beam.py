"""A Gaussian beam on its way to a retroreflector and back: radius, share that hits, share that returns.

Scalar and paraxial. A retroreflector sends back what falls on its aperture, turned about its centre, with the same
curvature: beyond it the light spreads by what it had spread and by diffraction at the aperture.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

NODES_PER_FRINGE = 12.0  # of the quadrature over an aperture, for each zone of Fresnel
FEWEST_NODES, MOST_NODES = 200, 20_000


def radius(distance: ArrayLike, *, waist: ArrayLike, wavelength: ArrayLike, quality: ArrayLike = 1.0) -> NDArray:
    """Radius at 1/e^2 of the intensity, in metres.

    distance     m from the waist, any sign
    waist        m, above 0: the radius there
    wavelength   m, above 0, of the light
    quality      M^2, at least 1: how much more the beam spreads than an ideal one

    Source: [SIEGMAN86] eq. 17.5, with M^2. Exact for a paraxial beam.

    >>> round(float(radius(100.0, waist=0.010, wavelength=0.78e-6)), 6)
    0.010304
    """
    _positive(waist=waist, wavelength=wavelength)
    spread = np.asarray(distance, float) * np.asarray(quality, float) * np.asarray(wavelength, float)
    return np.hypot(np.asarray(waist, float), spread / (np.pi * np.asarray(waist, float)))


def share_within(aperture: ArrayLike, beam_radius: ArrayLike, offset: ArrayLike = 0.0) -> NDArray:
    """Share of a Gaussian beam's power that falls on a circular aperture.

    aperture      m, its radius, 0 or more
    beam_radius   m, above 0, at 1/e^2
    offset        m, 0 or more: of the beam's axis from the aperture's centre

    Source: [SIEGMAN86] eq. 17.11 for offset 0, else Rice's distribution: distances from a point, of a round normal
    scatter of standard deviation beam_radius/2. Exact.

    >>> round(float(share_within(0.01, 0.01)), 6), round(float(share_within(0.01, 0.01, 0.01)), 6)
    (0.864665, 0.396499)
    """
    _positive(beam_radius=beam_radius)
    for name, value in (("aperture", aperture), ("offset", offset)):
        if not np.all(np.asarray(value, dtype=float) >= 0.0):
            raise ValidityError(f"{name} = {np.min(np.asarray(value, dtype=float))} m is not 0 or more")
    a, w, d = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (aperture, beam_radius, offset)))
    from scipy.stats import ncx2

    centred = -np.expm1(-2.0 * (a / w) ** 2)
    squeezed = np.maximum(d, 1e-12 * w)
    return np.where(d > 0.0, ncx2.cdf(4.0 * (a / w) ** 2, 2, 4.0 * (squeezed / w) ** 2), centred)


def returned_share(distance: float, *, aperture: float, receiver: float, waist: float, wavelength: float) -> float:
    """Share of a beam's power that a centred retroreflector sends back into a centred receiver.

    distance     m, above 0: from the waist, which lies at the receiver, to the retroreflector
    aperture     m, above 0: radius of the retroreflector's
    receiver     m, above 0: radius of the receiving lens
    waist        m, above 0: radius of the beam at 1/e^2
    wavelength   m, above 0

    Source: Fresnel's integral in polar form, [GOODMAN05] eq. 4-17 with the Gaussian field of [SIEGMAN86] eq. 17.4 on
    the aperture. Exact in the paraxial approximation, by Gauss-Legendre quadrature to some 1e-6. Raises ValidityError
    where an aperture is so wide or so near that its Fresnel zones are more than the quadrature follows.

    >>> round(returned_share(100.0, aperture=0.019, receiver=0.05, waist=0.010, wavelength=0.78e-6), 4)
    0.9988
    """
    _positive(distance=distance, aperture=aperture, receiver=receiver, waist=waist, wavelength=wavelength)
    wave_number = 2.0 * np.pi / wavelength
    rayleigh = 0.5 * wave_number * waist**2
    curvature = distance / (distance**2 + rayleigh**2)  # 1/R of the wave that arrives
    here = float(radius(distance, waist=waist, wavelength=wavelength))
    inner, inner_weight = _quadrature(aperture, wave_number * aperture * (aperture + 2.0 * receiver) / distance)
    outer, outer_weight = _quadrature(receiver, 2.0 * wave_number * receiver * aperture / distance)
    field = np.sqrt(2.0 / np.pi) / here * np.exp(-((inner / here) ** 2))
    field = field * np.exp(0.5j * wave_number * inner**2 * (curvature + 1.0 / distance)) * inner * inner_weight
    from scipy.special import j0

    power = 0.0
    for start in range(0, len(outer), 256):  # rows at a time: the kernel is large where zones are many
        part = slice(start, start + 256)
        kernel = j0((wave_number / distance) * outer[part, None] * inner)
        amplitude = np.abs(kernel @ field) * wave_number / distance
        power += float(np.sum(2.0 * np.pi * outer[part] * outer_weight[part] * amplitude**2))
    return power


def _quadrature(edge: float, phase: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes on 0 to `edge` and their weights, dense enough for a phase that runs so far."""
    count = int(FEWEST_NODES + NODES_PER_FRINGE * phase / (2.0 * np.pi))
    if count > MOST_NODES:
        raise ValidityError(
            f"an aperture of {edge} m spans {phase / np.pi:.0f} Fresnel zones, more than the quadrature follows "
            "(expected a smaller one or a longer distance; there the share that hits is what returns)"
        )
    pieces = max(1, count // 64)  # Gauss-Legendre of 64 points piece by piece
    x, w = np.polynomial.legendre.leggauss(64)
    edges = np.linspace(0.0, edge, pieces + 1)
    half = 0.5 * np.diff(edges)
    return ((edges[:-1] + half)[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()


def _positive(**values: ArrayLike) -> None:
    for name, value in values.items():
        given = np.asarray(value, dtype=float)
        if not np.all((given > 0.0) & (given < np.inf)):
            wrong = given[~((given > 0.0) & (given < np.inf))].flat[0]
            raise ValidityError(f"{name} = {wrong} m is not above 0 and finite")
