"""Ranger on its Kelvin mount: axes and scan point.

Mount axes: z from the fixed point to the v-block, y the normal of the mount's plane (up), x completing the right hand.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.geometry.frames.rotation import rx, ry, rz

# Ground axes (east, north, up) to mount axes (x, y up, z) for alpha = 0, where z looks south: eq. 2.4, last factor.
P = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
P.flags.writeable = False


def gamma(alpha1: ArrayLike, alpha2: ArrayLike, alpha3: ArrayLike) -> NDArray[np.float64]:
    """Matrix (..., 3, 3) from ground to mount coordinates.

    alpha1    rad, any: pi minus the survey azimuth of the line fixed point to v-block
    alpha2    rad, small: tip of the mount about its z axis
    alpha3    rad, small: tip of the mount about its x axis

    Source: [PARKER04] eq. 2.4 and 2.5, alpha1 from 2.6. Exact. (The notes' section 2.5 calls the height of the tooling
    ball the y origin; z is meant.)

    >>> gamma(1.0088480, -0.0000242, 0.0001454).round(5)[0].tolist()
    [0.53284, 0.84622, -2e-05]
    """
    return rx(alpha3) @ rz(alpha2) @ ry(alpha1) @ P


def lambda_(beta1: ArrayLike, beta2: ArrayLike) -> NDArray[np.float64]:
    """Matrix (..., 3, 3) from mount to mirror coordinates.

    beta1    rad, small: turn about the mount's x axis (theta in some reports)
    beta2    rad, small: turn about the mount's y axis (phi in some reports)

    Source: [PARKER04] eq. 2.11, without the small-angle shortcut. Exact.

    >>> lambda_(0.0, 0.0).tolist() == np.eye(3).tolist()
    True
    """
    return rx(beta1) @ ry(beta2)


def scan_point(fixed_point: ArrayLike, gamma_matrix: ArrayLike, mirror_offset: ArrayLike) -> NDArray[np.float64]:
    """Scan point of a ranger, ground coordinates (..., 3), m.

    Its two mirror axes meet there.

    fixed_point      (..., 3), m, ground: centre of the Kelvin mount's tooling ball
    gamma_matrix     (..., 3, 3), from `gamma`
    mirror_offset    (..., 3), m, mount axes: (dx, dy, dz) from the tooling ball to the mirror

    Source: [PARKER04] eq. 2.8, solved for the origin of the mirror frame. Exact.

    >>> scan_point([1.0, 2.0, 3.0], gamma(0.0, 0.0, 0.0), [0.0, 0.25, 0.0]).tolist()
    [1.0, 2.0, 3.25]
    """
    offset = np.asarray(mirror_offset, dtype=float)
    return np.asarray(fixed_point, dtype=float) + np.einsum("...ji,...j->...i", np.asarray(gamma_matrix), offset)


def mount_angles(gamma_matrix: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Angles alpha1, alpha2 in [-pi/2, pi/2], alpha3 (...), rad, of any mount.

    gamma_matrix    (..., 3, 3), ground to mount axes, orthonormal

    Source: [PARKER04] eq. 2.5 solved; the factors are removed one by one, so that `gamma` of the result is the matrix
    to 1e-15 also where alpha2 is a quarter turn and the other two angles turn about one axis.

    >>> [round(float(a), 9) for a in mount_angles(gamma(1.008848, -0.000024, 0.000145))]
    [1.008848, -2.4e-05, 0.000145]
    """
    g = np.asarray(gamma_matrix, dtype=float)
    alpha1 = np.arctan2(g[..., 0, 1], g[..., 0, 0])
    tipped = g @ np.swapaxes(ry(alpha1) @ P, -1, -2)  # Rx(alpha3) Rz(alpha2)
    return alpha1, np.arctan2(tipped[..., 0, 1], tipped[..., 0, 0]), np.arctan2(tipped[..., 1, 2], tipped[..., 2, 2])
