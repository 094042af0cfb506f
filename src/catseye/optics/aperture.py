"""Effect of a reflector's shape on its gain: half-path errors, Ruze.

A surface displaced by d along its normal, towards the focus, shortens the path from aperture plane over surface to
focus by 2 d cos i, i the incidence: both the incoming and the outgoing ray meet the normal under i. Half of it,
d cos i, is the half-path error. On a paraboloid i is half the angle at the focus, tan i = r/2f, and the displacement
dz along the axis is d / cos i: the half-path error is dz cos^2 i.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

DEEPEST_DB = 60.0  # of an edge taper


def cos_incidence(x: ArrayLike, y: ArrayLike, focal_length: float) -> NDArray[np.float64]:
    """Cosine of incidence on a paraboloid, shaped as x and y.

    The light runs along the axis.

    x, y           m, from the axis
    focal_length   m

    tan i = dz/dr = r/2f. Source: [BAARS07]. Exact.

    >>> round(float(cos_incidence(0.0, 120.0, 60.0)), 6)  # 45 degrees, where light turns by a right angle
    0.707107
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    return 1.0 / np.sqrt(1.0 + (x * x + y * y) / (2.0 * focal_length) ** 2)


def taper(rho: ArrayLike, edge_db: float) -> NDArray[np.float64]:
    """Amplitude of a Gaussian illumination over that at the centre.

    It is 10^(-edge_db rho^2 / 20).

    rho       distance from the aperture's centre over its radius
    edge_db   edge power below that at the centre, 0 to 60 dB

    The amplitude, not the power, is the weight of a phase in the gain: G is |sum A exp(i phi)|^2 / |sum A|^2, which
    for small phases is one less their variance under the weight A. Source: [RUZE66]. Raises ValidityError for
    another edge_db.

    >>> round(float(taper(1.0, 13.0)), 4)
    0.2239
    """
    if not 0.0 <= edge_db <= DEEPEST_DB:
        raise ValidityError(f"an edge taper of {edge_db:g} dB (expected 0 to {DEEPEST_DB:g})")
    return 10.0 ** (-edge_db * np.asarray(rho, dtype=float) ** 2 / 20.0)


def ruze_gain(variance: ArrayLike, wavelength: float) -> NDArray[np.float64]:
    """Gain over that of the perfect surface, exp(-(4 pi / wavelength)^2 variance).

    variance     m^2, of half-path errors under the illumination; may be below zero after subtraction of a noise
                 variance
    wavelength   m

    Source: [RUZE66]. Exact for errors of normal distribution, many and independent over the aperture; for few and
    smooth ones `coherent_gain`.

    >>> round(float(ruze_gain(0.21e-3**2, 2.6e-3)), 3)  # 0.21 mm at 115 GHz
    0.357
    """
    return np.exp(-((4.0 * np.pi / wavelength) ** 2) * np.asarray(variance, dtype=float))


def coherent_gain(error: ArrayLike, weights: ArrayLike, wavelength: float) -> float:
    """Gain over that of the perfect surface, from half-path errors.

    |mean of exp(4 pi i error / lambda)|^2.

    error        (k,) m, half-path
    weights      (k,) amplitude times area; taken as shares of their sum
    wavelength   m

    Source: [RUZE66]. On the axis, with the feed at the focus of the fitted paraboloid.

    >>> round(coherent_gain([1e-4, -1e-4], [1.0, 1.0], 3e-3), 6)
    0.834565
    """
    error, weights = np.asarray(error, dtype=float), np.asarray(weights, dtype=float)
    return float(np.abs(weights @ np.exp(4j * np.pi * error / wavelength) / weights.sum()) ** 2)


def cells(points: ArrayLike, *, edge_db: float, rings: int = 60) -> NDArray[np.float64]:
    """Aperture weights (k,): share of illumination nearest to each point, sum 1.

    points    (k, 2), in units of the aperture's radius, from its centre
    edge_db   of the illumination, as `taper` takes it
    rings     of the quadrature over the circle; 60 make 14 000 nodes

    Dense points have smaller weights; a point beyond the edge has the weight of the part of the aperture nearest to it,
    possibly 0. Raises ValidityError for another edge_db.

    >>> cells([[0.5, 0.0], [-0.5, 0.0]], edge_db=12.0).round(3).tolist()
    [0.5, 0.5]
    """
    from scipy.spatial import cKDTree

    from catseye.optics.zernike import disk_quadrature

    nodes, weight = disk_quadrature(4 * rings - 1)
    lit = weight * taper(np.linalg.norm(nodes, axis=1), edge_db)
    points = np.asarray(points, dtype=float)
    nearest = cKDTree(points).query(nodes)[1]
    share = np.bincount(nearest, weights=lit, minlength=len(points))
    return share / share.sum()
