"""Delay of light in glass, by ray tracing."""

import numpy as np

GLASS_TO_AIR = 1.527077  # group index of BK 7 against air, both as refraction and as delay, as in the campaign


def prism_delay(height, normal, towards_ranger):
    """Optical path that a prism adds to its reference point, air metres.

    One way, positive.

    height           apex below the entry face, m, (...)
    normal           outward normal of the entry face, unit vectors (..., 3)
    towards_ranger   unit vectors (..., 3)

    A ray is refracted into the prism unfolded about its apex, a slab of twice the height. The wavefronts are counted
    from the reference point, height / GLASS_TO_AIR below the face, to the image of that point.

    >>> up = np.array([0.0, 0.0, 1.0])
    >>> round(float(prism_delay(0.038205, up, up)), 7)  # minus the pc_mm of DP001 in night-01
    0.0333236
    """
    n = GLASS_TO_AIR
    h = np.asarray(height, dtype=float)[..., None]
    inward, ray = -normal, -towards_ranger
    cos_in = np.sum(ray * inward, axis=-1, keepdims=True)
    tangential = (ray - cos_in * inward) / n  # conserved by Snell's law
    refracted = tangential + np.sqrt(1.0 - np.sum(tangential**2, axis=-1, keepdims=True)) * inward
    length = 2.0 * h / np.sum(refracted * inward, axis=-1, keepdims=True)
    exit_point = length * refracted  # from the entry point, taken as origin
    reference, image = inward * h / n, inward * (2.0 * h - h / n)
    total = n * length + np.sum(ray * (image - exit_point - reference), axis=-1, keepdims=True)
    return 0.5 * total[..., 0]


def ball_delay(r1, r2):
    """Optical path that a ball of two radii (m) adds to its centre, air metres.

    One way, positive.

    The ray through the centre leaves the air at r1 before it, meets the mirrored shell at r2 beyond it.
    """
    return GLASS_TO_AIR * (r1 + r2) - r1
