"""Prism at a temperature: height, index, range constant and reference point.

A height is measured at 20 °C, the reference temperature of dimensions. At another temperature the glass is longer by
its expansion and slower by its index; both count, and for the same prism they add: 38.1 mm of BK 7 in air of 933 hPa
change their range constant by -0.33 um/K, of which the expansion is -0.24 um/K. The values and their slopes here
are one function, the slope its difference.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.optics.glass import difference_ends, glass_named, index_over_air
from catseye.optics.retroreflector import prism

DIMENSION_C = 20.0  # °C, at which lengths are stated [ISO22]
EXPANSION_C = (-30.0, 70.0)  # °C, for which makers give the mean expansion that the table holds


class WarmPrism(NamedTuple):
    """Prism at a temperature.

    height            m, face to corner
    phase, group      its indices over those of the surrounding air
    range_constant    m, negative
    reference_depth   m, of its point below the face
    """

    height: Array
    phase: Array
    group: Array
    range_constant: Array
    reference_depth: Array


def warm_prism(
    height: ArrayLike,
    glass: str,
    vacuum_um: ArrayLike,
    temperature_c: ArrayLike,
    *,
    air_phase: ArrayLike,
    air_group: ArrayLike,
) -> WarmPrism:
    """Prism of a glass at a temperature, in given air.

    height          m, above 0, at 20 °C
    glass           a name in GLASSES
    vacuum_um       wavelength in vacuum, um
    temperature_c   °C, -100 to 140, of the glass
    air_phase       phase index of the air about it
    air_group       group index of that air

    Source: [GOLDMAN00] eqs. 3.9, 3.10 with height (1 + expansion (t - 20 °C)) and `index_over_air` at t. The expansion
    is the mean of -30 to 70 °C: beyond it is wrong by up to a tenth of itself.

    >>> found = warm_prism(0.0381, "N-BK7", 0.780, -20.0, air_phase=1.0, air_group=1.0)
    >>> round(float(found.height) * 1e3, 5), round(float(found.range_constant) * 1e3, 4)
    (38.08918, -33.2644)
    """
    index = index_over_air(vacuum_um, glass, temperature_c, air_phase=air_phase, air_group=air_group)
    warmer = np.asarray(temperature_c, dtype=float) - DIMENSION_C
    expanded = np.asarray(height, dtype=float) * (1.0 + glass_named(glass).expansion * warmer)
    return WarmPrism(
        expanded,
        index.phase,
        index.group,
        prism.range_constant(expanded, index.group),
        prism.reference_depth(expanded, index.group),
    )


def warm_prism_slopes(
    height: ArrayLike,
    glass: str,
    vacuum_um: ArrayLike,
    temperature_c: ArrayLike,
    *,
    air_phase: ArrayLike,
    air_group: ArrayLike,
) -> WarmPrism:
    """Derivatives of `warm_prism` by glass temperature, per °C.

    The air is unchanged.

    Arguments as of `warm_prism`.

    Source: `warm_prism`, by a difference over half a degree on either side, within the limits: 1e-4 of the slope.

    >>> found = warm_prism_slopes(0.0381, "N-BK7", 0.780, 20.0, air_phase=1.00024848, air_group=1.00025325)
    >>> round(float(found.range_constant) * 1e6, 3)
    -0.334
    """
    t = np.asarray(temperature_c, dtype=float)
    low, high = difference_ends(t, glass)
    air = {"air_phase": air_phase, "air_group": air_group}
    below, above = (warm_prism(height, glass, vacuum_um, end, **air) for end in (low, high))
    return WarmPrism(*((b - a) / (high - low) for a, b in zip(below, above, strict=True)))
