"""Effects of fabrication and refractivity on a triplet.

The memo's appendices A and D, exact and by its approximations.

Scan point S at s along the prisms, h above their line and Z out of the plate, seen from the mid-point MP; D = |S - MP|.

    spacing D_12 longer by d            D_MP' - D_MP = -d (2 D_12 + d) / (4 (D_MP' + D_MP))         (A.1, A.2)
    ball x along the prisms' line       D_BC^2 - D_MP^2 = x^2 - 2 x s = x^2 + x (D_2^2 - D_1^2)/D_12 (A.5)
    ball y across it, in the plate      D_BC^2 - D_MP^2 = y^2 - 2 y h

The third case is the memo's "Pythagoras ... the same error bound". A right angle at MP means h = 0, where the effect is
y^2/(2D), 0.6 nm, a four-thousandth of that bound; off it the law of cosines gives -y h / D. So the bound
x D_12/(2 D_0) holds while |h| < D_12/2 = 318 mm: always in the laboratory (h is centimetres: 0.4 um), yet not by
Pythagoras. Likewise A.8's |D_2 - D_1| < D_12^2/(2 D_0) says |s| < D_12/2: the perpendicular from S meets the line
between the prisms. "Plate normal to the beam" alone does not give it.

On the telescope s/D and h/D are the sines of an incidence of up to 12 deg: 0.15 mm aside there is 31 um, twelve times
the bound. The appendix is about the calibration only, where it holds.

D.2 and D.3 give D.1's n only with their unrounded values. The D.4 slope by temperature is misprinted: -0.895887e-6
per degree (the memo prints -0.985e-6), and D.3's temperature is 20.0 deg C, not 20.5; see `MEMO_SLOPES`, `SLOPES`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.atmosphere.index.air import air
from catseye.errors import ValidityError
from catseye.names import NOTES_AIR_MODEL

TOLERANCE = 0.15e-3  # m: of the spacing, the ball's place, and of H_corr against the surface plate
D_12 = 0.635  # m: the design's spacing
RATIO = 1.527077  # D.1


class RefractivitySlopes(NamedTuple):
    """Change of air's group refractivity per deg C, per hPa and per % of relative humidity."""

    per_c: float
    per_hpa: float
    per_percent: float


MEMO_SLOPES = RefractivitySlopes(-0.985e-6, 0.272e-6, -0.0096e-6)  # D.4 as printed
# right, by the formula that the memo used, at D.3's weather with the right temperature: 20 deg C, 933 hPa, 50 %
SLOPES = RefractivitySlopes(-0.895887e-6, 0.272048e-6, -0.0096058e-6)


def spacing_effect(d_12: ArrayLike, change: ArrayLike, d_mp: ArrayLike) -> Array:
    """Error of the computed D_MP by a larger assumed spacing, m.

    Below zero: the computed D_MP is shorter.

    d_12     m, between the prisms
    change   m, added to it
    d_mp     m, above half of d_12 + change: to the mid-point, both ranges held

    Source: [GOLDMAN00] eq. A.1, its difference without cancellation. Exact.

    >>> round(float(spacing_effect(0.635, 0.15e-3, 18.0)) * 1e6, 4)
    -1.3231
    """
    base, d, distance = (np.asarray(v, dtype=float) for v in (d_12, change, d_mp))
    fall = 0.25 * d * (2.0 * base + d)
    if np.any(fall >= distance**2):
        raise ValidityError(f"spacing changed by {np.max(d):g} m: no triangle remains; expected metres")
    return -fall / (distance + np.sqrt(distance**2 - fall))


def spacing_effect_memo(d_12: ArrayLike, change: ArrayLike, d_mp: ArrayLike) -> Array:
    """Error of the computed D_MP to first order.

    Arguments as of `spacing_effect`.

    Source: [GOLDMAN00] eq. A.2.

    >>> round(float(spacing_effect_memo(0.635, 0.15e-3, 18.0)) * 1e6, 4)
    -1.3229
    """
    base, d, distance = (np.asarray(v, dtype=float) for v in (d_12, change, d_mp))
    return np.asarray(-base * d / (4.0 * distance))


def along_effect(along: ArrayLike, *, d_1: ArrayLike, d_2: ArrayLike, d_12: ArrayLike) -> Array:
    """Difference D_BC - D_MP of a ball displaced along the prisms' line, m.

    along      m, towards the right prism T_2
    d_1, d_2   m, from the scan point to the left and right prism
    d_12       m, between them

    Source: [GOLDMAN00] eqs. A.3 to A.6 (Stewart's theorem). Exact.

    >>> round(float(along_effect(0.15e-3, d_1=18.0, d_2=18.0112, d_12=0.635)) * 1e6, 4)
    2.6467
    """
    x, one, two, base = (np.asarray(v, dtype=float) for v in (along, d_1, d_2, d_12))
    d_mp = np.sqrt(0.5 * (one**2 + two**2) - 0.25 * base**2)
    gain = x * (two - one) * (two + one) / base + x**2
    return gain / (d_mp + np.sqrt(d_mp**2 + gain))


def along_effect_memo(along: ArrayLike, *, d_1: ArrayLike, d_2: ArrayLike, d_12: ArrayLike) -> Array:
    """Difference by the memo's shortcut x (D_2 - D_1)/D_12.

    Arguments as of `along_effect`.

    Source: [GOLDMAN00] eq. A.7.

    >>> round(float(along_effect_memo(0.15e-3, d_1=18.0, d_2=18.0112, d_12=0.635)) * 1e6, 4)
    2.6457
    """
    x, one, two, base = (np.asarray(v, dtype=float) for v in (along, d_1, d_2, d_12))
    return np.asarray(x * (two - one) / base)


def along_bound(along: ArrayLike, d_12: ArrayLike, d_0: ArrayLike) -> Array:
    """Upper bound of |D_BC - D_MP|, m.

    While the perpendicular from the scan point falls between the prisms.

    along   m, of the ball beside the mid-point
    d_12    m, between the prisms
    d_0     m, from the scan point to their line

    Source: [GOLDMAN00] eq. A.8; it neglects x^2/(2 D), 0.6 nm.

    >>> round(float(along_bound(0.15e-3, 0.635, 18.0)) * 1e6, 2)
    2.65
    """
    return np.abs(along) * np.asarray(d_12, dtype=float) / (2.0 * np.asarray(d_0, dtype=float))


def across_effect(across: ArrayLike, *, height: ArrayLike, d_mp: ArrayLike) -> Array:
    """Difference D_BC - D_MP of a ball displaced across the line, m.

    In the plate.

    across   m, along the unit's y, normal x axis
    height   m, of the scan point along the same direction: the memo's h_S where the plate is upright
    d_mp     m, from the scan point to the mid-point, at least |height|

    Source: [GOLDMAN00] appendix A, third case, by the law of cosines in place of Pythagoras (see the module). Exact.

    >>> round(float(across_effect(0.15e-3, height=0.05, d_mp=18.0)) * 1e6, 3)
    -0.416
    >>> round(float(across_effect(0.15e-3, height=0.0, d_mp=18.0)) * 1e9, 3)
    0.625
    """
    y, h, distance = (np.asarray(v, dtype=float) for v in (across, height, d_mp))
    if np.any(np.abs(h) > distance):
        raise ValidityError(f"height {np.max(np.abs(h)):g} m is more than the distance {np.min(distance):g} m")
    gain = y * (y - 2.0 * h)
    return gain / (distance + np.sqrt(distance**2 + gain))


def refractivity_slopes(
    temperature_c: float = 20.0, pressure_hpa: float = 933.0, humidity_percent: float = 50.0
) -> RefractivitySlopes:
    """Derivatives of air's group refractivity at 0.780 um by the weather.

    temperature_c, pressure_hpa, humidity_percent   deg C, hPa, %

    Source: [GOLDMAN00] eq. D.4, by the formula that it used, [RUEGER90], relative humidity held: `SLOPES` at 20 deg C.

    >>> [round(s * 1e6, 6) for s in refractivity_slopes()]
    [-0.895887, 0.272048, -0.009606]
    """
    slope = air(temperature_c, pressure_hpa, humidity_percent, model=NOTES_AIR_MODEL).sensitivity
    return RefractivitySlopes(float(slope.temperature_c), float(slope.pressure_hpa), float(slope.humidity_percent))


def refractivity_change(
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    humidity_percent: ArrayLike,
    *,
    slopes: RefractivitySlopes = SLOPES,
) -> Array:
    """Linear change of air's group refractivity by the weather.

    For moderate changes.

    temperature_c, pressure_hpa, humidity_percent   changes, deg C, hPa, %
    slopes                                          D.4, right by default

    Source: [GOLDMAN00] eq. D.5. Over 10 deg C either way good to 0.25e-6, at 0 and 40 deg C to 1.1e-6.

    >>> round(float(refractivity_change(1.0, 0.0, 0.0)) * 1e6, 6)
    -0.895887
    """
    change = slopes.per_c * np.asarray(temperature_c, dtype=float)
    change = change + slopes.per_hpa * np.asarray(pressure_hpa, dtype=float)
    return change + slopes.per_percent * np.asarray(humidity_percent, dtype=float)


def ratio_change(refractivity: ArrayLike, ratio: float = RATIO, index: float = 1.000253247) -> Array:
    """Change of the index ratio n of glass over air.

    As the air's refractivity changes, at constant glass.

    refractivity   change of n_air
    ratio, index   n and n_air before

    Source: [GOLDMAN00] eq. D.1. Exact.

    >>> round(float(ratio_change(-17.9e-6)) * 1e6, 3)
    27.328
    """
    change = np.asarray(refractivity, dtype=float)
    return -ratio * change / (index + change)


def glass_effect(glass: ArrayLike, refractivity: ArrayLike, ratio: float = RATIO) -> Array:
    """Error of a range to a point in glass with the tabulated P_c, m.

    Positive: too long.

    glass          m, one way: height of a prism, R_1 + R_2 of the ball
    refractivity   change of n_air since the table
    ratio          n of the table

    Source: [GOLDMAN00] appendix D, last paragraph ("insignificant"): 1 um for a prism and 4 um for the ball in air of
    40 deg C, -2 and -8 um at -15 deg C. Exact at normal incidence.

    >>> [round(float(glass_effect(g, -17.9e-6)) * 1e6, 2) for g in (0.0384, 0.1465)]
    [1.05, 4.0]
    """
    return np.asarray(glass, dtype=float) * ratio_change(refractivity, ratio)
