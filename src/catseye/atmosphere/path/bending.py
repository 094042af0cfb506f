"""Bending of rays by a gradient: closed forms and a bound.

With an even gradient G of the phase index across a chord d, kappa = G/n, the ray is a parabola on the side of thinner
air: y = -(kappa/2) x (d - x) along G. To the second order in kappa:

    sag kappa d²/8, angle at each end kappa d/2, length of the ray kappa² d³/24 above the chord.

Its optical path: the air on it is thinner, which takes n kappa² d³/12; it is longer, which gives n kappa² d³/24.
Together it is n kappa² d³/24 *shorter* than the integral along the chord, as Fermat's principle requires to first
order. A range reduced with the index averaged along the chord is thus too short by kappa² d³/24.

The bound. Let the index nowhere change across the chord by more than G a metre, and n >= 1. Any curve y(x) whatever has
an optical path of at least  integral n_chord - G |y| + sqrt(1 + y'²) - 1. The integral is least for the arc
of curvature G, for which it is, with theta = 2 arcsin(Gd/2),  d - (theta + sin theta)/2G below that of the chord.
So no air, however it is layered, makes the optical path of a ray differ from that along the chord by more than

    d - (theta + sin theta)/2G = G² d³/24 + ...

and never makes it larger: the ray is the best of all curves, the chord included. This proves that 1 K/m
over 120 m is negligible. It holds for the light. The modulation counts the light's own curve in the group index:
n_g - n is 2 % of n - 1, and with D for the gradient of that difference it adds at most D G d³/12 either way, 4 % of
the bound.
"""

import numpy as np

from catseye.atmosphere.index.air import phase_refractivity
from catseye.atmosphere.limit import ValidInterval
from catseye.constants import DRY_AIR_KG_PER_MOL, GAS_CONSTANT, STANDARD_GRAVITY, ZERO_CELSIUS_K
from catseye.errors import ValidityError

LENGTH = ValidInterval("length", "m", 0.0, 1e5, "the model of a ray in the lower air")
EXCESS = ValidInterval("excess", "m", 0.0, 1.0, "the small-excess approximation", places=1)
GRADIENT = ValidInterval("gradient of the index", "1/m", -0.01, 0.01, "air", places=2)


def index_gradient(temperature_gradient_c_per_m, temperature_c=20.0, pressure_hpa=933.0, *, refractivity=None):
    """Vertical gradient of the phase index in dry air at rest, 1/m.

    Below zero where the air thins upwards.

    temperature_gradient_c_per_m   °C/m upwards; -0.0342 makes it zero, below that the index grows upwards
    temperature_c                  °C
    pressure_hpa                   total pressure, hPa
    refractivity                   n - 1; None: of dry air at 0.780 um

    Source: n - 1 in proportion to p/T with dp/dz = -p g M/(R T), so that dn/dz = -(n - 1)(g M/R + dT/dz)/T.

    >>> round(float(index_gradient(0.0)) * 1e9, 2), round(float(index_gradient(-1.0)) * 1e9, 1)
    (-29.02, 820.5)
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    if refractivity is None:
        refractivity = phase_refractivity(temperature_c, pressure_hpa, 0.0)
    weight = STANDARD_GRAVITY * DRY_AIR_KG_PER_MOL / GAS_CONSTANT  # K/m, 0.0342
    return -np.asarray(refractivity, float) * (weight + np.asarray(temperature_gradient_c_per_m, float)) / kelvin


def curvature(gradient, elevation=0.0, *, index=1.0):
    """Curvature of a ray in level layers, 1/m; positive if concave to the ground.

    gradient    dn/dz, 1/m
    elevation   of the ray above the horizon, rad
    index       phase index there, 1 to 1.001

    Source: 1/radius = -(dn/dz) cos(elevation)/n, the ray equation; k = earth's radius times it.

    >>> round(float(curvature(index_gradient(-0.0065))) * 6_371_000.0, 2)
    0.15
    """
    GRADIENT.check(gradient)
    return -np.asarray(gradient, float) * np.cos(np.asarray(elevation, float)) / np.asarray(index, float)


def sag(curvature_, length):
    """Sag of a ray from its chord at mid-length, m.

    On the side away from the centre of curvature.

    curvature_   of the ray, 1/m
    length       of the chord, m

    Source: derived at the top of this file, kappa d²/8.

    >>> round(float(sag(1e-6, 120.0)) * 1e3, 3)
    1.8
    """
    return np.asarray(curvature_, float) * np.asarray(length, float) ** 2 / 8.0


def pointing_offset(curvature_, length):
    """Angle between the ray and its chord at either end, rad.

    Aim by this angle to the outside of the bend.

    curvature_   of the ray, 1/m
    length       of the chord, m

    Source: derived at the top of this file, kappa d/2. Also the bound for all air whose curvature is nowhere larger.

    >>> round(float(pointing_offset(1e-6, 120.0)) * 206264.806, 2)
    12.38
    """
    return 0.5 * np.asarray(curvature_, float) * np.asarray(length, float)


def excess_bound(gradient, length):
    """Bound on the optical path deficit of a ray against its chord, m.

    No air makes a ray's optical path less than its chord's by more than this, and never larger.

    gradient   largest gradient of the phase index across the chord anywhere near it, 1/m, either sign
    length     of the chord, m; gradient times length below 2

    Source: derived at the top of this file; exact where the gradient is even and n = 1.

    Raises ValidityError for a gradient beyond any air, or a chord so long that the arc closes.

    >>> round(float(excess_bound(index_gradient(-1.0), 120.0)) * 1e6, 3)
    0.048
    """
    GRADIENT.check(gradient)
    LENGTH.check(length)
    g, d = np.abs(np.asarray(gradient, float)), np.asarray(length, float)
    half = 0.5 * g * d
    if np.any(half >= 1.0):
        raise ValidityError(
            f"gradient times length {float(np.max(2 * half)):g} is not below 2: the chord is too long for this bound"
        )
    # d - (theta + sin theta)/2g, u = gd/2; below u = 1e-2 its series, as the difference would lose all digits
    u = np.maximum(half, 1e-2)
    closed = 1.0 - 0.5 * (np.arcsin(u) / u + np.sqrt(1.0 - u**2))
    series = half**2 / 6.0 * (1.0 + 3.0 * half**2 / 20.0)
    return d * np.where(half < 1e-2, series, closed)


def steepest_gradient(excess, length):
    """Gradient of the index at which the excess reaches a limit, 1/m.

    excess   m, 0 to 1
    length   of the chord, m, above 0

    Raises ValidityError outside.

    Source: the first term of `excess_bound`, sqrt(24 excess/d³).

    >>> round(float(steepest_gradient(0.2e-6, 120.0)) * 1e6, 3)
    1.667
    """
    EXCESS.check(excess)
    LENGTH.check(length)
    return np.sqrt(24.0 * np.asarray(excess, float) / np.asarray(length, float) ** 3)
