"""The solid cube-corner prism: reference point, range constant, and what changes when the light comes in obliquely.

Unfolded, the prism is a slab of glass of thickness `height` with the corner at its far side. A plane wave at incidence
I is delayed by n h cos r down to the corner, sin r = sin I / n. The reference point T lies h/n below the entry face, an
air path of (h/n) cos I: chosen so that the two change alike, and the range hardly depends on how the prism is turned.

`n` is the group index of the glass over that of the air, throughout. Refraction follows the phase index n_p; rigorously
the group path through the slab is h (n n_p - sin^2 I) / sqrt(n_p^2 - sin^2 I). Appendix B bends the ray with n instead.
For BK 7 at 0.780 um and h = 38.4 mm the rigorous path is longer by 0.05 um at 10°, 0.43 um at 30°, 1.05 um at 45°,
2.0 um at 60° and 3.4 um at grazing incidence: under a micrometre as far as 43°.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

COSINE_TOLERANCE = 1e-9  # a dot product of unit vectors may exceed 1 by rounding


def reference_depth(height: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Depth of the prism's reference point T below its entry face, in metres.

    height    m, from the entry face to the corner
    n         group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.9. Exact, a definition.

    >>> round(float(reference_depth(0.0384, 1.527077)), 7)
    0.0251461
    """
    return np.asarray(height, dtype=float) / np.asarray(n, dtype=float)


def range_constant(height: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Distance to add to the measured length for the glass of a prism at normal incidence, negative.

    height    m, from the entry face to the corner
    n         group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.10. Exact at normal incidence.

    >>> round(float(range_constant(0.0384, 1.527077)), 7)
    -0.0334937
    """
    ratio = np.asarray(n, dtype=float)
    return -(ratio - 1.0 / ratio) * np.asarray(height, dtype=float)


def obliquity_correction(height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike) -> NDArray[np.float64]:
    """Distance to add to the measured length, beyond the range constant, for oblique incidence; never positive.

    height           m, from the entry face to the corner
    n                group index of the glass over that of the air, 1.4 to 2
    cos_incidence    cosine of the angle between the face's outward normal and the direction to the ranger, 0 to 1;
                     below 0 the face looks away and the answer is NaN, one shot at a time

    Source: [GOLDMAN00] eq. B.1, in the form -(h/n) (1 - 1/n^2) (1 - c)^2 (1 + c) / ((1 + c_r) (c + c_r)), which is the
    same number without its cancellation. See the module for how good B.1 itself is.

    >>> round(float(obliquity_correction(0.0381, 1.527077, np.cos(0.5))), 9)
    -0.000112581
    """
    h, ratio, c, c_r = _cosines(height, n, cos_incidence)
    return -(h / ratio) * (1.0 - ratio**-2) * (1.0 - c) ** 2 * (1.0 + c) / ((1.0 + c_r) * (c + c_r))


def obliquity_slope(height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike) -> NDArray[np.float64]:
    """Change of the obliquity correction with the angle of incidence, in metres a radian; never positive.

    height           m, from the entry face to the corner
    n                group index of the glass over that of the air, 1.4 to 2
    cos_incidence    cosine of the angle of incidence, 0 to 1 (below 0: NaN, the face looks away)

    Source: [GOLDMAN00] eq. B.1, differentiated. As good as B.1.

    >>> round(float(obliquity_slope(0.0381, 1.527077, np.cos(0.5))), 6)
    -0.000905
    """
    h, ratio, c, c_r = _cosines(height, n, cos_incidence)
    sine = np.sqrt((1.0 - c) * (1.0 + c))
    return -(h / ratio) * (1.0 - ratio**-2) * sine**3 / (c_r * (c + c_r))


def clear_share(
    incidence: ArrayLike, *, aperture: ArrayLike, height: ArrayLike, index: ArrayLike
) -> NDArray[np.float64]:
    """Area of a cube corner that sends light back, over that of its clear face seen straight on; 0 to 1.

    incidence   rad, 0 to a right angle, on the face
    aperture    m, above 0: radius of the clear, round face
    height      m, from the face to the corner
    index       phase index of what fills the corner over that of the air; 1 for a hollow one

    What enters at p leaves at 2 q - p, with q the corner projected on the face along the ray: both must be clear, two
    circles 2 height tan r apart, foreshortened by cos I. Uncoated glass returns less where a face stops reflecting
    totally (BK 7: from some 17 deg on the side of an edge): not counted here.

    Source: geometry of the unfolded corner, as in [GOLDMAN00] appendix B. Exact for a corner that reaches beyond its
    clear face.

    >>> round(float(clear_share(0.0, aperture=0.0254, height=0.0381, index=1.511)), 3)
    1.0
    >>> round(float(clear_share(0.5, aperture=0.0254, height=0.0381, index=1.511)), 3)
    0.341
    """
    angle = np.asarray(incidence, dtype=float)
    sine = np.sin(angle) / np.asarray(index, dtype=float)
    apart = np.asarray(height, dtype=float) * sine / np.sqrt(1.0 - sine**2) / np.asarray(aperture, dtype=float)
    half = np.minimum(apart, 1.0)
    overlap = (np.arccos(half) - half * np.sqrt(1.0 - half**2)) * 2.0 / np.pi
    return overlap * np.maximum(np.cos(angle), 0.0)


def _cosines(height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Height, index, cosine of incidence (NaN where the face looks away) and cosine of refraction."""
    ratio = np.asarray(n, dtype=float)
    c = np.asarray(cos_incidence, dtype=float)
    if np.any(ratio <= 1.0):
        raise ValidityError(f"index ratio {float(ratio.min())} is not above 1: give glass over air, such as 1.527077")
    if np.any(np.abs(c) > 1.0 + COSINE_TOLERANCE):
        worst = float(c.flat[int(np.nanargmax(np.abs(c)))])
        raise ValidityError(f"cosine of incidence {worst} is outside -1 to 1: give unit vectors")
    c = np.where(c < 0.0, np.nan, np.minimum(c, 1.0))
    return np.asarray(height, dtype=float), ratio, c, np.sqrt(1.0 - (1.0 - c) * (1.0 + c) / ratio**2)
