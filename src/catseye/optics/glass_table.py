"""Table of glasses: dispersion, temperature, expansion, with sources.

A new glass is one entry here and one line of tests against its maker's sheet.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

SUPPORT_C = (-100.0, 140.0)  # where the makers' temperature formula holds


@dataclass(frozen=True)
class Thermal:
    """Constants of the makers' temperature formula of the absolute index.

    d0, d1, d2     1/K, 1/K^2, 1/K^3
    e0, e1         um^2/K, um^2/K^2
    resonance_um   lambda_TK
    source         citation
    """

    d0: float
    d1: float
    d2: float
    e0: float
    e1: float
    resonance_um: float
    source: str


@dataclass(frozen=True)
class Glass:
    """Glass with its maker's dispersion formula, over air of 1013.25 hPa.

    formula         "schott": n^2 = A0 + A1 l^2 + A2 l^-2 + A3 l^-4 + A4 l^-6 + A5 l^-8;
                    "sellmeier": n^2 = 1 + sum B_i l^2 / (l^2 - C_i), with l the wavelength in um
    coefficients    A0 to A5, or B1, B2, B3, C1, C2, C3 (C in um^2)
    shortest_um     shortest wavelength at which the formula holds
    longest_um      longest wavelength at which the formula holds
    source          citation
    thermal         change with temperature
    expansion       1/K, linear, -30 to 70 °C
    reference_c     °C, of glass and air, at which the formula gives the index
    what            its use here
    """

    formula: Literal["schott", "sellmeier"]
    coefficients: tuple[float, ...]
    shortest_um: float
    longest_um: float
    source: str
    thermal: Thermal
    expansion: float
    reference_c: float
    what: str


BK7_THERMAL = Thermal(1.86e-6, 1.31e-8, -1.37e-11, 4.34e-7, 6.27e-10, 0.170, "[SCHOTT14]")

GLASSES: Mapping[str, Glass] = MappingProxyType(
    {
        "BK7-old": Glass(
            formula="schott",
            coefficients=(2.2718929, -1.0108077e-2, 1.0592509e-2, 2.0816965e-4, -7.6472538e-6, 4.9240991e-7),
            shortest_um=0.365,
            longest_um=1.014,
            source="[PARKER04] eq. 1.44",
            thermal=BK7_THERMAL,  # of N-BK7, the same crown without arsenic; the notes give none
            expansion=7.1e-6,
            reference_c=20.0,
            what="borosilicate crown of the notes: the GBT's prisms and balls",
        ),
        "N-BK7": Glass(
            formula="sellmeier",
            coefficients=(1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653),
            shortest_um=0.3126,
            longest_um=2.3254,
            source="[SCHOTT14]",
            thermal=BK7_THERMAL,
            expansion=7.1e-6,
            reference_c=20.0,
            what="present borosilicate crown: prisms bought since about 2000",
        ),
        "fused-silica": Glass(
            formula="sellmeier",
            coefficients=(0.6961663, 0.4079426, 0.8974794, 0.0684043**2, 0.1162414**2, 9.896161**2),
            shortest_um=0.21,
            longest_um=3.71,
            source="[MALITSON65]",
            thermal=Thermal(2.06e-5, 2.51e-8, -2.47e-11, 3.12e-7, 4.22e-10, 0.16, "[SCHOTT17], LITHOSIL-Q"),
            expansion=0.5e-6,
            reference_c=20.0,
            what="prisms that resist heat and ultraviolet light",
        ),
        "S-LAH79": Glass(
            formula="sellmeier",
            coefficients=(2.32557148, 0.507967133, 2.43087198, 0.0132895208, 0.0528335449, 161.122408),
            shortest_um=0.37,
            longest_um=2.4,
            source="[OHARA17]",
            thermal=Thermal(6.01e-6, 1.31e-8, -3.15e-11, 1.12e-6, 1.27e-9, 0.26, "[OHARA17]"),
            expansion=6.0e-6,
            reference_c=25.0,
            what="lanthanum flint of index 2: full balls that focus on their own back",
        ),
    }
)
