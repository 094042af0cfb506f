"""Mean refractivity along a line of sight, and pressure at other heights.

Along a straight line the height is linear in the distance run, so that the mean over the height is the mean over the
path; over 1 km the Earth's curvature departs from that by 2 cm.
"""

from functools import cache

import numpy as np

from catseye.constants import DRY_AIR_KG_PER_MOL, GAS_CONSTANT, STANDARD_GRAVITY, WATER_OVER_AIR, ZERO_CELSIUS_K

LAPSE_HPA_PER_M = 0.11  # [PARKER04] section 1.4.2, at 20 °C and 800 m


def pressure_at(pressure_hpa, z_from, z_to, *, lapse_hpa_per_m=LAPSE_HPA_PER_M):
    """Pressure at another height by a constant lapse, hPa, as in the notes.

    pressure_hpa      total pressure at `z_from`, 500 to 1100 hPa
    z_from            height of the barometer, m
    z_to              target height, m, within 150 m of it
    lapse_hpa_per_m   fall of pressure with height, 0.08 to 0.13 hPa/m

    Source: [PARKER04] section 1.4.2. Good to 0.2 hPa over 100 m at 20 °C, 1.5 hPa at -20 °C: `hydrostatic_pressure_hpa`
    is better everywhere.

    >>> round(float(pressure_at(933.0, 803.8, 807.4)), 3)
    932.604
    """
    return np.asarray(pressure_hpa, float) - lapse_hpa_per_m * (np.asarray(z_to, float) - np.asarray(z_from, float))


def hydrostatic_pressure_hpa(
    pressure_hpa, temperature_c, z_from, *, z_to, vapour_pressure_hpa=0.0, gravity=STANDARD_GRAVITY
):
    """Pressure at another height in isothermal air at rest, hPa.

    pressure_hpa          total pressure at `z_from`, 500 to 1100 hPa
    temperature_c         mean temperature of the air between, -40 to 50 °C
    z_from                height of the barometer, m
    z_to                  target height, m, within 1 km of it
    vapour_pressure_hpa   partial pressure of water vapour at `z_from`, 0 to 100 hPa (moist air is lighter)
    gravity               local gravity, m/s²

    Source: [CIDDOR96] appendix A, ideal gas in hydrostatic balance. Good to 0.01 hPa over 100 m when the mean
    temperature is known to 0.2 °C.

    >>> round(float(hydrostatic_pressure_hpa(933.0, 20.0, 0.0, z_to=100.0)), 3)
    922.19
    """
    p = np.asarray(pressure_hpa, float)
    lightness = 1.0 - (1.0 - WATER_OVER_AIR) * np.asarray(vapour_pressure_hpa, float) / p
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    rise = np.asarray(z_to, float) - np.asarray(z_from, float)
    return p * np.exp(-gravity * DRY_AIR_KG_PER_MOL * lightness * rise / (GAS_CONSTANT * kelvin))


def mean_over_height(refractivity_of_height, z_a, z_b, *, nodes=5):
    """Mean refractivity along the straight line between two heights.

    refractivity_of_height   function of an array of heights in m, one trailing axis of nodes added, giving refractivity
    z_a                      height of one end, m
    z_b                      height of the other, m; equal heights give the value there
    nodes                    Gauss-Legendre nodes, 1 to 100: exact for polynomials of degree 2 nodes - 1

    Source: [PARKER04] section 1.3 (a range depends on the mean), Gauss-Legendre quadrature. Five nodes are good to
    1e-12 for air with straight profiles of temperature and pressure over 200 m.

    >>> round(float(mean_over_height(lambda z: 250e-6 - 25e-9 * z, 0.0, 100.0)) * 1e6, 6)
    248.75
    """
    heights, share = nodes_along(z_a, z_b, nodes)
    return np.sum(share * refractivity_of_height(heights), axis=-1)


def nodes_along(z_a, z_b, nodes):
    """Heights (..., nodes) of Gauss-Legendre nodes between z_a and z_b, m.

    Also returns their weights (nodes,).

    z_a, z_b   heights of the ends, m
    nodes      1 to 100

    Source: Gauss-Legendre quadrature; the weights' sum is one.

    >>> [part.round(4).tolist() for part in nodes_along(0.0, 10.0, 2)]
    [[2.1132, 7.8868], [0.5, 0.5]]
    """
    x, weight = _legendre(nodes)
    z_a, z_b = np.asarray(z_a, float)[..., None], np.asarray(z_b, float)[..., None]
    return 0.5 * (z_a + z_b) + 0.5 * (z_b - z_a) * x, 0.5 * weight


@cache
def _legendre(nodes):
    return np.polynomial.legendre.leggauss(nodes)
