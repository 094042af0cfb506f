"""Phase and group index of optical glass.

The makers' formulas give the index relative to air at 20 to 22 °C and 1013.25 hPa, not to vacuum. The notes divide it
once more by the index of air; see `phase_index`.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError


@dataclass(frozen=True)
class Glass:
    """A glass and the dispersion formula that its maker gives.

    formula         "schott": n^2 = A0 + A1 l^2 + A2 l^-2 + A3 l^-4 + A4 l^-6 + A5 l^-8;
                    "sellmeier": n^2 = 1 + sum B_i l^2 / (l^2 - C_i), with l the wavelength in um
    coefficients    A0 to A5, or B1, B2, B3, C1, C2, C3
    shortest_um     shortest wavelength at which the formula holds
    longest_um      longest wavelength at which the formula holds
    source          citation
    """

    formula: Literal["schott", "sellmeier"]
    coefficients: tuple[float, ...]
    shortest_um: float
    longest_um: float
    source: str


GLASSES = MappingProxyType(
    {
        "BK7-old": Glass(
            formula="schott",
            coefficients=(2.2718929, -1.0108077e-2, 1.0592509e-2, 2.0816965e-4, -7.6472538e-6, 4.9240991e-7),
            shortest_um=0.365,
            longest_um=1.014,
            source="[PARKER04] eq. 1.44",
        ),
        "N-BK7": Glass(
            formula="sellmeier",
            coefficients=(1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653),
            shortest_um=0.3126,
            longest_um=2.3254,
            source="[SCHOTT14]",
        ),
    }
)


def phase_index(wavelength_um: ArrayLike, glass: str = "BK7-old") -> NDArray[np.float64]:
    """Phase index of a glass, relative to standard air.

    wavelength_um    wavelength in air, um: 0.365 to 1.014 for BK7-old, 0.3126 to 2.3254 for N-BK7
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.40 with 1.44 (BK7-old); [SCHOTT14] (N-BK7). Good to 5e-6 for the glass that was fitted; one
    melt differs from the next by up to 5e-4. The makers' coefficients are relative to air [TIE29], while the notes and
    [GOLDMAN00] take them as relative to vacuum: their n = 1.527463/1.000253 = 1.527077 is 3.9e-4 low by that reading,
    which makes the range constant 21 um too short for a 38.4 mm prism and 57 um for the ball.

    >>> round(float(phase_index(0.780)), 8)
    1.51118682
    """
    return np.sqrt(_square(wavelength_um, glass)[0])


def group_index(wavelength_um: ArrayLike, glass: str = "BK7-old") -> NDArray[np.float64]:
    """Group index of a glass, n - l dn/dl, relative to standard air.

    wavelength_um    wavelength in air, um: 0.365 to 1.014 for BK7-old, 0.3126 to 2.3254 for N-BK7
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.42 and 1.43. The old BK 7 series lies 1.15e-5 below N-BK7 at 0.780 um (and 3.5e-6 above it
    in phase index), which shows what a differentiated fit is worth: 0.63 um in the range constant of a 38.1 mm prism.
    A target's record says which glass it has.

    >>> round(float(group_index(0.780)), 8)
    1.52746375
    """
    square, slope = _square(wavelength_um, glass)
    n = np.sqrt(square)
    return n - slope / (2.0 * n)


def _square(wavelength_um: ArrayLike, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """n^2, and l d(n^2)/dl."""
    if name not in GLASSES:
        raise ValidityError(f"glass '{name}' is not known; known are {', '.join(GLASSES)}")
    glass = GLASSES[name]
    wavelength = np.asarray(wavelength_um, dtype=float)
    outside = ~((wavelength >= glass.shortest_um) & (wavelength <= glass.longest_um))
    if outside.any():
        raise ValidityError(
            f"wavelength {float(wavelength[outside].flat[0]):g} um is outside "
            f"{glass.shortest_um:g}-{glass.longest_um:g} um, where {glass.source} holds for {name}"
        )
    l2 = wavelength**2
    if glass.formula == "schott":
        powers = (0, 1, -1, -2, -3, -4)  # of l^2, eq. 1.40
        terms = [a * l2 ** float(p) for a, p in zip(glass.coefficients, powers, strict=True)]
        return np.sum(terms, axis=0), np.sum([2 * p * t for p, t in zip(powers, terms, strict=True)], axis=0)
    strengths, resonances = glass.coefficients[:3], glass.coefficients[3:]
    pairs = list(zip(strengths, resonances, strict=True))
    square = 1.0 + np.sum([b * l2 / (l2 - c) for b, c in pairs], axis=0)
    return square, -2.0 * np.sum([b * c * l2 / (l2 - c) ** 2 for b, c in pairs], axis=0)
