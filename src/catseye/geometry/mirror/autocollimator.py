"""Autocollimator readings off the mirror and a flat.

Mount axes: z^ from the fixed point to the v-block, y^ up, x^ in the surface plate. The autocollimator stands on the
+z^ side and looks into the mirror. Its light leaves along -c; c, its optical axis, leans by (lean_x, lean_y) from z^
towards +x^ and +y^, and its reticle is turned by `roll` about c, right-handed. Light returned along r reads

    x, y = r.X / r.c, r.Y / r.c,       the beam's angles; a scale of mirror angles shows half of them.

A face with the normal m turns -c into r = 2 (c.m) m - c. In mirror axes the face stands at

    m = Rz(Theta') Rx(kappa) (cos tau sin psi, sin tau, cos tau cos psi)

psi = 2 pi (N_e - N_e0) / 1e5 of the elevation shaft (half the beam's Phi'); tau, the *face tilt*, leans the normal
towards the end of the shaft that looks along +y~ at Theta' = 0; kappa, the *axis tilt*, lifts that end towards +z~.

Near psi = 0 the normal goes round the azimuth axis z~ on a circle of the radius sqrt(psi^2 + (tau - kappa)^2). Seen
from z^ the circle's centre is z~ itself, in mount axes the last row of lambda (eq. 2.11):

    x = +beta2,   y = -beta1        (mirror angles; twice that of the beam)

The notes' step 4 gives beta1 as "approximately the y component": with y up it is minus that, as their own example has
it (z~ rotated up by 2'30", beta1 = -2'30"). tau and kappa appear here only as tau - kappa; in one position of the
azimuth even that is not separable from beta.

The notes' step 6 finds N_a0 where y is zero for a flat on the x~ axis. With the autocollimator still on z^ that is not
Theta = 0: its light comes in off the azimuth axis by beta1, and y vanishes at Theta' = beta1 (ZP3: -727 urad, 11.6
counts). It is right for an autocollimator that looks along z~. A face tilt moves it too, by -(tau - kappa cos psi) /
sin psi, which changes its sign in the prime pointing.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.geometry.frames.rotation import rx, ry, rz
from catseye.geometry.mirror.mount import lambda_


def face_normal(theta: ArrayLike, shaft: ArrayLike, face_tilt: ArrayLike = 0.0, *, axis_tilt: ArrayLike = 0.0) -> Array:
    """Unit normal (..., 3) of the mirror's face in mirror axes.

    theta       (...), rad: the mount's azimuth Theta'
    shaft       (...), rad: turn of the elevation shaft, half the beam's Phi'; below zero in the prime pointing
    face_tilt   (...), rad: the normal towards the shaft's end that looks along +y~ at Theta' = 0
    axis_tilt   (...), rad: that end of the shaft towards +z~

    Source: [PARKER04] sections 2.3 and 2.4 for the axes; derived above. Exact.

    >>> face_normal(0.0, np.pi / 4).round(6).tolist()
    [0.707107, 0.0, 0.707107]
    """
    theta, psi, tau, kappa = np.broadcast_arrays(*(np.asarray(v, float) for v in (theta, shaft, face_tilt, axis_tilt)))
    radial, across, along = np.cos(tau) * np.sin(psi), np.sin(tau), np.cos(tau) * np.cos(psi)
    across, along = (
        np.cos(kappa) * across - np.sin(kappa) * along,
        np.sin(kappa) * across + np.cos(kappa) * along,
    )
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([c * radial - s * across, s * radial + c * across, along], axis=-1)


def reflected(direction: ArrayLike, normal: ArrayLike) -> Array:
    """Direction (..., 3) of a ray after a plane mirror.

    direction   (..., 3), any length, which is preserved
    normal      (..., 3), unit, either sense

    Exact.

    >>> reflected([0.0, 0.0, -1.0], [0.6, 0.0, 0.8]).round(12).tolist()
    [0.96, 0.0, 0.28]
    """
    d, m = np.asarray(direction, dtype=float), np.asarray(normal, dtype=float)
    return d - 2.0 * np.sum(d * m, axis=-1, keepdims=True) * m


def autocollimator_axes(alignment: ArrayLike) -> Array:
    """Autocollimator axes (..., 3, 3) in mount axes: rows X, Y, optical axis c.

    alignment   (..., 3), rad: lean of c towards +x^, towards +y^, and roll about it

    >>> autocollimator_axes([0.0, 0.01, 0.0])[2].round(6).tolist()
    [0.0, 0.01, 0.99995]
    """
    lean_x, lean_y, roll = np.moveaxis(np.asarray(alignment, dtype=float), -1, 0)
    return rz(roll) @ rx(-lean_y) @ ry(lean_x)


def mirror_reading(normal: ArrayLike, beta: ArrayLike, alignment: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Reading (..., 2) off the mirror's face, x and y, rad of the beam.

    normal      (..., 3), of the face in mirror axes, as `face_normal` gives it
    beta        (..., 2), rad: beta1, beta2
    alignment   (..., 3), rad, as for `autocollimator_axes`

    Source: [PARKER04] section 2.2, step 4, with the sign of beta1 and the factor of two derived above. Exact.

    >>> mirror_reading(face_normal(1.0, 0.0), [-727e-6, 121e-6]).round(7).tolist()
    [0.000242, 0.001454]
    """
    axes = autocollimator_axes(alignment)
    face = _in_mount(normal, beta)
    return _read(axes, reflected(-axes[..., 2, :], face))


def flat_reading(
    normal: ArrayLike, beta: ArrayLike, alignment: ArrayLike = (0.0, 0.0, 0.0), *, flat: ArrayLike = (0.0, 0.0)
) -> Array:
    """Reading (..., 2), rad of the beam, off a flat via the mirror.

    The flat stands on the x^ axis.

    normal, beta, alignment   as for `mirror_reading`; the mirror stands near Theta = 0 and Phi = 90 degrees
    flat                      (..., 2), rad: lean of the flat's normal, which is -x^, towards +y^ and +z^

    The light meets the mirror, the flat, and the mirror again: y grows by twice the beam's azimuth.

    Source: [PARKER04] section 2.4, step 6, and section 2.5 (the master square); corrected above. Exact.

    >>> (flat_reading(face_normal(1e-4, np.pi / 4), [0.0, 0.0]).round(7) + 0.0).tolist()
    [0.0, 0.0002]
    """
    axes = autocollimator_axes(alignment)
    face = _in_mount(normal, beta)
    up, along = np.moveaxis(np.asarray(flat, dtype=float), -1, 0)
    plane = np.stack([-np.ones_like(up), up, along], axis=-1)
    plane = plane / np.linalg.norm(plane, axis=-1, keepdims=True)
    return _read(axes, reflected(reflected(reflected(-axes[..., 2, :], face), plane), face))


def _in_mount(normal: ArrayLike, beta: ArrayLike) -> Array:
    """Mount coordinates of a vector of mirror axes."""
    beta1, beta2 = np.moveaxis(np.asarray(beta, dtype=float), -1, 0)
    return np.einsum("...ji,...j->...i", lambda_(beta1, beta2), np.asarray(normal, dtype=float))


def _read(axes: Array, returned: Array) -> Array:
    beam = np.einsum("...ij,...j->...i", axes, returned)
    return beam[..., :2] / beam[..., 2:]
