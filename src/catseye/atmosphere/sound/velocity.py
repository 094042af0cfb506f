"""Velocity and arc-to-chord corrections from displayed length to straight line.

An electronic distance meter displays d' = c t / 2 n_ref for the time t of a round trip. Air along the whole path gives
the length of the ray; weather is read at its ends, and the ray is bent. Each function gives a correction, to be added.

The second correction, derived: with the coefficient of refraction k the ray's curvature is k/R, and k/R = -dn/dh. Over
level ends the ray runs below the level surface through them, by (1 - k) x (d - x) / 2R at x, in the mean by
(1 - k) d²/12R. There the index is larger, in the mean by (k/R) (1 - k) d²/12R, so that the length is too long by
k (1 - k) d³/12R². With k = 0.13 that is 0.03 um at 510 m, 0.3 mm at 11 km.
"""

import numpy as np

from catseye.atmosphere.limit import ValidInterval

EARTH_RADIUS = 6_371_000.0  # m, mean; 0.3 % of it changes nothing below 10 km
REFRACTION = 0.13  # coefficient k of light by day, well above the ground

COEFFICIENT = ValidInterval("coefficient of refraction", "(ratio)", -5.0, 5.0, "the model of a smoothly bent ray")
RADIUS = ValidInterval("radius of the earth", "m", 6.2e6, 6.6e6, "the earth")
INDEX = ValidInterval("index of air", "(ratio)", 1.0, 1.001, "air", places=3)


def first_velocity_correction(displayed, reference_index, group_index):
    """First velocity correction: from displayed length to the air along the path, m.

    displayed         length as displayed, without any correction for weather, m
    reference_index   group index n_ref for which the instrument displays lengths, 1 to 1.001
    group_index       group index of the air along the path, 1 to 1.001

    Exact: d = d' n_ref/n; the common form d'(n_ref - n) is larger by 0.03 % of itself.
    Source: [RUEGER90], first velocity correction; follows from d' = c t / 2 n_ref.

    Raises ValidityError for an index outside its limits.

    >>> round(float(first_velocity_correction(1000.0, 1.000286338, 1.000276338)), 6)
    0.009997
    """
    INDEX.check(reference_index)
    INDEX.check(group_index)
    reference, index = np.asarray(reference_index, float), np.asarray(group_index, float)
    return np.asarray(displayed, float) * (reference - index) / index


def second_velocity_correction(length, *, refraction=REFRACTION, radius=EARTH_RADIUS):
    """Second velocity correction: ray below its ends' level surface, m.

    The index is that at the ends; negative for 0 < k < 1.

    length       of the ray, m
    refraction   coefficient k: radius of the earth over that of the ray, above zero for a ray concave to the ground
    radius       of the earth, m

    Source: derived at the top of this file; [RUEGER90], second velocity correction, -(k - k²) d³/12R².

    Raises ValidityError for a coefficient or a radius outside its limits.

    >>> round(float(second_velocity_correction(10_000.0)) * 1e3, 3)
    -0.232
    """
    COEFFICIENT.check(refraction)
    RADIUS.check(radius)
    k = np.asarray(refraction, float)
    return -k * (1.0 - k) * np.asarray(length, float) ** 3 / (12.0 * np.asarray(radius, float) ** 2)


def arc_to_chord_correction(length, *, refraction=REFRACTION, radius=EARTH_RADIUS):
    """Correction from the bent ray's length to the straight line, m.

    Never positive.

    length       of the ray, m
    refraction   coefficient k: radius of the earth over that of the ray
    radius       of the earth, m

    Source: an arc of radius R/k less its chord, first term, k² d³/24R²; [RUEGER90].

    Raises ValidityError for a coefficient or a radius outside its limits.

    >>> round(float(arc_to_chord_correction(10_000.0)) * 1e3, 3)
    -0.017
    """
    COEFFICIENT.check(refraction)
    RADIUS.check(radius)
    k = np.asarray(refraction, float)
    return -(k**2) * np.asarray(length, float) ** 3 / (24.0 * np.asarray(radius, float) ** 2)
