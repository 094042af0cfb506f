"""Solid cube-corner prism: reference point, range constant, oblique incidence.

Unfolded, the prism is a slab of glass of thickness `height` with the corner at its far side. A plane wave at incidence
I is delayed by n h cos r down to the corner, sin r = sin I / n. The reference point T lies h/n below the entry face, an
air path of (h/n) cos I: chosen so that both change equally, and the range hardly depends on the prism's orientation.

`n` is the group index of the glass over that of the air, throughout. Refraction follows the phase index n_p. With
sin r = sin I / n_p the ray enters h tan r aside of the axis, which saves h tan r sin I of air, and runs h / cos r in
glass; so the group path to the corner, counted from the wavefront through the pole of the face, is

    n h / cos r - h tan r sin I = h (n n_p - sin^2 I) / sqrt(n_p^2 - sin^2 I)

and the three reflections of a real corner only fold it. Appendix B bends the ray with n instead.
For BK 7 at 0.780 um and h = 38.4 mm the rigorous path is longer by 0.05 um at 10°, 0.43 um at 30°, 1.05 um at 45°,
2.0 um at 60° and 3.4 um at grazing incidence: under a micrometre as far as 43°. `obliquity_correction` is appendix B,
which the campaigns used; `oblique_change` is the rigorous one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError

COSINE_TOLERANCE = 1e-9  # a dot product of unit vectors may exceed 1 by rounding


def reference_depth(height: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Depth of the prism's reference point T below its face, m.

    height    m, from the entry face to the corner
    n         group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.9. Exact, a definition.

    >>> round(float(reference_depth(0.0384, 1.527077)), 7)
    0.0251461
    """
    return np.asarray(height, dtype=float) / np.asarray(n, dtype=float)


def range_constant(height: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Range constant of a prism's glass at normal incidence, m, negative.

    It is added to the measured length.

    height    m, from the entry face to the corner
    n         group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.10. Exact at normal incidence.

    >>> round(float(range_constant(0.0384, 1.527077)), 7)
    -0.0334937
    """
    ratio = np.asarray(n, dtype=float)
    return -(ratio - 1.0 / ratio) * np.asarray(height, dtype=float)


def obliquity_correction(
    height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike, *, phase: float | None = None
) -> NDArray[np.float64]:
    """Length correction for oblique incidence, m; never positive.

    Beyond the range constant.

    height           m, from the entry face to the corner
    n                group index of the glass over that of the air, 1.4 to 2
    cos_incidence    cosine of the angle between the face's outward normal and the direction to the ranger, 0 to 1;
                     below 0 the face looks away and the result is NaN, shot by shot
    phase            phase index of the glass over that of the air, which then refracts (`oblique_change`); None: B.1

    Source: [GOLDMAN00] eq. B.1, in the form -(h/n) (1 - 1/n^2) (1 - c)^2 (1 + c) / ((1 + c_r) (c + c_r)), the
    same value without cancellation. See the module for the accuracy of B.1.

    >>> round(float(obliquity_correction(0.0381, 1.527077, np.cos(0.5))), 9)
    -0.000112581
    """
    h, ratio, c, c_r = _cosines(height, n, cos_incidence)
    if phase is not None:
        return _two_index_change(h, ratio, phase, c)
    return -(h / ratio) * (1.0 - ratio**-2) * (1.0 - c) ** 2 * (1.0 + c) / ((1.0 + c_r) * (c + c_r))


def obliquity_slope(
    height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike, *, phase: float | None = None
) -> NDArray[np.float64]:
    """Slope of the obliquity correction by incidence, m/rad; never positive.

    height           m, from the entry face to the corner
    n                group index of the glass over that of the air, 1.4 to 2
    cos_incidence    cosine of the angle of incidence, 0 to 1 (below 0: NaN, the face looks away)
    phase            phase index of the glass over that of the air, which then refracts; None: B.1

    Source: [GOLDMAN00] eq. B.1, or `oblique_change`, differentiated, with the same accuracy.

    >>> round(float(obliquity_slope(0.0381, 1.527077, np.cos(0.5))), 6)
    -0.000905
    """
    h, ratio, c, c_r = _cosines(height, n, cos_incidence)
    sine = np.sqrt((1.0 - c) * (1.0 + c))
    if phase is not None:
        q = np.sqrt(phase**2 - sine**2)
        path = h * sine * c * (ratio * phase + sine**2 - 2.0 * phase**2) / q**3  # of the group path by I
        return -path - h / ratio * sine
    return -(h / ratio) * (1.0 - ratio**-2) * sine**3 / (c_r * (c + c_r))


def oblique_change(
    height: ArrayLike, incidence: ArrayLike, *, group: ArrayLike, phase: ArrayLike
) -> NDArray[np.float64]:
    """Length correction for oblique incidence with two indices, m.

    Beyond the range constant.

    height      m, from the entry face to the corner
    incidence   rad, 0 to pi; beyond a right angle the face looks away and the result is NaN, shot by shot
    group       group index of the glass over that of the air
    phase       phase index of the glass over that of the air; equal to `group` it is `obliquity_correction`, B.1

    About the point T at height / group below the face: -(L(I) - L(0)) - (h/n)(1 - cos I), with L the group path, in
    the form h sin^2 I ((1 - n/(n_p + q))/q - 1/(n (1 + cos I))), q = sqrt(n_p^2 - sin^2 I), without its cancellation.

    Source: derived at the top of this file; against [GOLDMAN00] eq. B.1 it is 0.43 um more negative at 30 deg in a
    38.1 mm prism. Exact for a plane wave.

    >>> round(float(oblique_change(0.0381, np.radians(30.0), group=1.527077, phase=1.510811)) * 1e6, 2)
    -135.95
    """
    h, n_g, n_p, _, cosine = _two_indices(height, incidence, group, phase)
    return _two_index_change(h, n_g, n_p, cosine)


def flat_depth(height: ArrayLike, *, group: ArrayLike, phase: ArrayLike) -> NDArray[np.float64]:
    """Depth of the point insensitive to small turns, m.

    A turn about it leaves the range unchanged to second order.

    height   m, from the entry face to the corner
    group    group index of the glass over that of the air
    phase    phase index of the glass over that of the air

    Source: the second derivative of the group path at normal incidence, h (2 n_p - n_g) / n_p^2. [GOLDMAN00] eq. 3.9 is
    the case n_p = n_g; for BK 7 it lies 3 um deeper in a 38.1 mm prism, by the square of the indices' difference.

    >>> round(float(reference_depth(0.0381, 1.527077) - flat_depth(0.0381, group=1.527077, phase=1.510811)) * 1e6, 2)
    2.89
    """
    n_g, n_p = np.asarray(group, dtype=float), np.asarray(phase, dtype=float)
    return np.asarray(height, dtype=float) * (2.0 * n_p - n_g) / n_p**2


class WrongGlass(NamedTuple):
    """Range error of a prism reduced with another glass, m.

    about_point   to T of each glass: the difference of the range constants
    about_face    to the face, or to any point at a known depth below it
    """

    about_point: NDArray[np.float64]
    about_face: NDArray[np.float64]


def wrong_glass(height: ArrayLike, *, assumed: ArrayLike, true: ArrayLike) -> WrongGlass:
    """Range error, m, from a wrong glass at normal incidence.

    Positive where too long.

    height    m, from the entry face to the corner
    assumed   group index over that of the air, used in the reduction
    true      group index over that of the air, of the actual glass

    The length within the glass is taken too short by (true - assumed) h, and so any point that is fixed in the prism
    lies that much nearer than reduced: `about_face`. The two range constants differ by more, 1 + 1/(n n') times, for
    the true T lies higher in the glass than the assumed one: `about_point`. N-BK7 taken for old BK 7, 1.15e-5 lower,
    gives 0.44 um (face) or 0.63 um (point) in a 38.1 mm prism.

    Source: [GOLDMAN00] eqs. 3.9 and 3.10, their difference. Exact.

    >>> error = wrong_glass(0.0381, assumed=1.5274637, true=1.5274752)
    >>> round(float(error.about_point) * 1e6, 2), round(float(error.about_face) * 1e6, 2)
    (0.63, 0.44)
    """
    h = np.asarray(height, dtype=float)
    n, m = np.asarray(assumed, dtype=float), np.asarray(true, dtype=float)
    return WrongGlass((m - n) * (1.0 + 1.0 / (n * m)) * h, (m - n) * h)


def clear_share(
    incidence: ArrayLike, *, aperture: ArrayLike, height: ArrayLike, index: ArrayLike
) -> NDArray[np.float64]:
    """Returning area of a cube corner over its clear face; 0 to 1.

    incidence   rad, 0 to a right angle, on the face
    aperture    m, above 0: radius of the clear, round face
    height      m, from the face to the corner
    index       phase index of the filling over that of the air; 1 for a hollow one

    Light entering at p leaves at 2 q - p, with q the corner projected on the face along the ray: both must be clear,
    two circles 2 height tan r apart, foreshortened by cos I. Uncoated glass returns less where a face stops reflecting
    totally (BK 7: from 20.3 deg on the side of an edge, see `solid_prism`): not counted here.

    Source: geometry of the unfolded corner, as in [GOLDMAN00] appendix B. Exact for a corner that reaches beyond its
    clear face.

    >>> round(float(clear_share(0.0, aperture=0.0254, height=0.0381, index=1.511)), 3)
    1.0
    >>> round(float(clear_share(0.5, aperture=0.0254, height=0.0381, index=1.511)), 3)
    0.341
    """
    angle = np.asarray(incidence, dtype=float)
    sine = np.sin(angle) / np.asarray(index, dtype=float)
    with np.errstate(divide="ignore"):  # at grazing incidence on a hollow corner the circles are infinitely far apart
        apart = np.asarray(height, dtype=float) * sine / np.sqrt(1.0 - sine**2) / np.asarray(aperture, dtype=float)
    half = np.minimum(apart, 1.0)
    overlap = (np.arccos(half) - half * np.sqrt(1.0 - half**2)) * 2.0 / np.pi
    return overlap * np.maximum(np.cos(angle), 0.0)


def _two_index_change(h: Array, n_g: Array, n_p: Array | float, c: Array) -> Array:
    square = (1.0 - c) * (1.0 + c)
    q = np.sqrt(n_p**2 - square)
    return h * square * ((1.0 - n_g / (n_p + q)) / q - 1.0 / (n_g * (1.0 + c)))


def _two_indices(
    height: ArrayLike, incidence: ArrayLike, group: ArrayLike, phase: ArrayLike
) -> tuple[NDArray[np.float64], ...]:
    """Height, both indices, sine and cosine of incidence.

    NaN where the face looks away.
    """
    n_g, n_p = np.asarray(group, dtype=float), np.asarray(phase, dtype=float)
    for name, value in (("group", n_g), ("phase", n_p)):
        if np.any(value <= 1.0):
            raise ValidityError(
                f"{name} index ratio {float(value.min())} is not above 1: give glass over air, such as 1.527077"
            )
    angle = np.asarray(incidence, dtype=float)
    if np.any((angle < 0.0) | (angle > np.pi)):
        raise ValidityError(f"incidence {float(np.nanmax(np.abs(angle))):g} rad is outside 0 to pi")
    angle = np.where(angle > 0.5 * np.pi, np.nan, angle)
    return np.asarray(height, dtype=float), n_g, n_p, np.sin(angle), np.cos(angle)


def _cosines(height: ArrayLike, n: ArrayLike, cos_incidence: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Height, index, cosines of incidence and refraction.

    NaN where the face looks away.
    """
    ratio = np.asarray(n, dtype=float)
    c = np.asarray(cos_incidence, dtype=float)
    if np.any(ratio <= 1.0):
        raise ValidityError(f"index ratio {float(ratio.min())} is not above 1: give glass over air, such as 1.527077")
    if np.any(np.abs(c) > 1.0 + COSINE_TOLERANCE):
        worst = float(c.flat[int(np.nanargmax(np.abs(c)))])
        raise ValidityError(f"cosine of incidence {worst} is outside -1 to 1: give unit vectors")
    c = np.where(c < 0.0, np.nan, np.minimum(c, 1.0))
    return np.asarray(height, dtype=float), ratio, c, np.sqrt(1.0 - (1.0 - c) * (1.0 + c) / ratio**2)
