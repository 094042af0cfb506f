"""Phase and group index of optical glass over air or vacuum.

The reference is standard air, vacuum or the actual air. The makers' formulas give the index relative to air at 20 to 25
°C and 1013.25 hPa, at the wavelength in that air. The notes and the memo take them as relative to vacuum and divide by
the index of air once more: n = 1.527463/1.00025324 = 1.527077, 4.3e-4 below what `index_over_air` gives for the same
glass and air. That makes the range constant of a 38.4 mm prism 24 um and of the ball 63 um less negative than it is,
and a range too long by that. A campaign keeps the values of its certificates; a zero from a baseline with the same kind
of target absorbs its part.

In glass the phase travels at c over the phase index, the modulation at c over the group index. Going from air to
vacuum multiplies both: k_glass = n_rel(k_air) k_air gives dk_glass/dk = n_g,rel n_g,air, exactly.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ValidityError
from catseye.optics.glass_table import GLASSES, SUPPORT_C, Glass

__all__ = [
    "GLASSES",
    "Glass",
    "GlassSlopes",
    "Index",
    "absolute_index",
    "difference_ends",
    "glass_named",
    "group_index",
    "group_wavelength",
    "index_over_air",
    "phase_index",
    "reference_air",
    "slopes",
    "temperature_slopes",
    "wavelength_in_air_um",
]

STEP_C = 0.5  # of the central difference by temperature: the formula is a cubic, its error is 1e-11 a kelvin


class Index(NamedTuple):
    """Phase and group index of one medium."""

    phase: Array
    group: Array


class GlassSlopes(NamedTuple):
    """Derivatives of phase and group index, by the variable of the function."""

    phase: Array
    group: Array


def phase_index(wavelength_um: ArrayLike, glass: str = "BK7-old") -> Array:
    """Phase index of a glass, relative to standard air.

    wavelength_um    wavelength in air, um, within the glass's limits: 0.365 to 1.014 for BK7-old
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.40 with 1.44 (BK7-old); each glass's own in GLASSES. Good to 5e-6 for the glass that was
    fitted (fused silica 1e-5); one melt differs from the next by up to 5e-4. The makers' coefficients are relative to
    air [TIE29]: see the module for their use in the notes.

    >>> round(float(phase_index(0.780)), 8)
    1.51118682
    """
    return np.sqrt(_series(wavelength_um, glass)[0])


def group_index(wavelength_um: ArrayLike, glass: str = "BK7-old") -> Array:
    """Group index of a glass, n - l dn/dl, relative to standard air.

    wavelength_um    wavelength in air, um, within the glass's limits: 0.365 to 1.014 for BK7-old
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.42 and 1.43. The old BK 7 series lies 1.15e-5 below N-BK7 at 0.780 um (and 3.5e-6 above it
    in phase index), which shows the limit of a differentiated fit: `retroreflector.prism.wrong_glass` gives its
    effect. A target's record names its glass.

    >>> round(float(group_index(0.780)), 8)
    1.52746375
    """
    square, first, _ = _series(wavelength_um, glass)
    n = np.sqrt(square)
    return n - first / (2.0 * n)


def slopes(wavelength_um: ArrayLike, glass: str = "BK7-old") -> GlassSlopes:
    """Derivatives of both indices over standard air by wavelength, 1/um.

    wavelength_um    wavelength in air, um
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.40 and 1.42, differentiated: dn_g/dl = -l d2n/dl2. Exact.

    >>> [round(float(s), 5) for s in slopes(0.780)]
    [-0.02087, -0.04315]
    """
    square, first, second = _series(wavelength_um, glass)
    n, wavelength = np.sqrt(square), np.asarray(wavelength_um, dtype=float)
    n1 = first / (2.0 * n)  # l dn/dl
    n2 = second / (2.0 * n) - first**2 / (4.0 * n**3)  # (l d/dl) twice
    return GlassSlopes(n1 / wavelength, (n1 - n2) / wavelength)


def group_wavelength(frequency: ArrayLike, wavelength_um: ArrayLike, glass: str = "BK7-old") -> Array:
    """Wavelength of the modulation in a glass, m.

    frequency        Hz, above 0, of the modulation
    wavelength_um    wavelength of the light in air, um
    glass            a name in GLASSES

    Source: [PARKER04] eq. 1.47. The half of it, eq. 1.48, is printed 65.422 mm, truncated from 65.422 711 mm.

    >>> round(float(group_wavelength(1.5e9, 0.780)) / 2 * 1e3, 6)
    65.422711
    """
    f = np.asarray(frequency, dtype=float)
    if not np.all((f > 0.0) & (f < np.inf)):
        raise ValidityError(f"frequency = {float(np.min(f)):g} Hz is not above 0 and finite")
    return SPEED_OF_LIGHT / (group_index(wavelength_um, glass) * f)


def reference_air(vacuum_um: ArrayLike, temperature_c: ArrayLike = 20.0) -> Index:
    """Index of the makers' reference air, dry at 1013.25 hPa.

    vacuum_um       wavelength in vacuum, um, 0.2 to 4
    temperature_c   °C, -40 to 80

    Source: [TIE19], the makers' own air (Edlén's dispersion of 1953). Within 2e-7 of [CIDDOR96] and
    [CIDDOR99]; it is their reference, hence used here instead of a better one.

    >>> [round(float(n - 1) * 1e6, 2) for n in reference_air(0.780)]
    [270.46, 275.56]
    """
    x = np.asarray(vacuum_um, dtype=float) ** 2
    first, second = 146.0 * x - 1.0, 41.0 * x - 1.0
    phase = 6432.8 + 2949810.0 * x / first + 25540.0 * x / second
    group = phase + 2.0 * x * (2949810.0 / first**2 + 25540.0 / second**2)
    thinner = 1e-8 / (1.0 + 3.4785e-3 * (np.asarray(temperature_c, dtype=float) - 15.0))
    return Index(1.0 + phase * thinner, 1.0 + group * thinner)


def absolute_index(vacuum_um: ArrayLike, glass: str = "BK7-old", temperature_c: ArrayLike | None = None) -> Index:
    """Phase and group index of a glass relative to vacuum.

    vacuum_um       wavelength in vacuum, um
    glass           a name in GLASSES
    temperature_c   °C, -100 to 140, of the glass; None for the temperature of the maker's formula

    Raises ValidityError outside.

    Source: [TIE29] section 1 (relative to air), [TIE19] (its change with temperature). Limited by the maker's
    formula; the change to 5e-7 a kelvin (1e-6 for fused silica).

    >>> [round(float(n), 6) for n in absolute_index(0.780)]
    [1.5116, 1.527894]
    """
    entry = glass_named(glass)
    vacuum = _within(np.asarray(vacuum_um, dtype=float), glass, entry)
    air = reference_air(vacuum, entry.reference_c)
    in_air = vacuum / air.phase
    phase, group = phase_index(in_air, glass) * air.phase, group_index(in_air, glass) * air.group
    if temperature_c is None:
        return Index(phase, group)
    warmed = _warmed(vacuum, phase, phase - group, entry, np.asarray(temperature_c, dtype=float))
    return Index(phase + warmed.phase, group + warmed.group)


def temperature_slopes(vacuum_um: ArrayLike, glass: str = "BK7-old", temperature_c: ArrayLike = 20.0) -> GlassSlopes:
    """Derivatives of the absolute phase and group index by temperature, 1/K.

    vacuum_um       wavelength in vacuum, um
    glass           a name in GLASSES
    temperature_c   °C, -100 to 140

    Source: [TIE19], by a difference over half a degree on either side, within the limits. Good to 5e-7
    where the makers measured, 365 to 1014 nm.

    >>> [round(float(s) * 1e6, 2) for s in temperature_slopes(0.780)]
    [1.11, 1.81]
    """
    low, high = difference_ends(temperature_c, glass)
    below, above = (absolute_index(vacuum_um, glass, end) for end in (low, high))
    return GlassSlopes(*((b - a) / (high - low) for a, b in zip(below, above, strict=True)))


def difference_ends(temperature_c: ArrayLike, glass: str) -> tuple[Array, Array]:
    """Temperatures, °C, for a difference quotient within the formula's limits.

    temperature_c   °C, -100 to 140
    glass           a name in GLASSES

    Raises ValidityError outside.
    """
    t = np.asarray(temperature_c, dtype=float)
    _refuse_temperature(t, glass_named(glass))
    return np.maximum(t - STEP_C, SUPPORT_C[0]), np.minimum(t + STEP_C, SUPPORT_C[1])


def wavelength_in_air_um(vacuum_um: ArrayLike, glass: str = "BK7-old") -> Array:
    """Wavelength, um, in the maker's reference air, for `phase_index`.

    vacuum_um   wavelength in vacuum, um
    glass       a name in GLASSES, whose maker gives the air's temperature

    Source: [TIE29] section 1. At 0.780 um it is 0.21 nm shorter, which raises the group index of BK 7 by 9.1e-6.

    >>> round(float(wavelength_in_air_um(0.780)), 6)
    0.779789
    """
    vacuum = np.asarray(vacuum_um, dtype=float)
    return vacuum / reference_air(vacuum, glass_named(glass).reference_c).phase


def index_over_air(
    vacuum_um: ArrayLike,
    glass: str = "BK7-old",
    temperature_c: ArrayLike | None = None,
    *,
    air_phase: ArrayLike,
    air_group: ArrayLike,
) -> Index:
    """Phase and group index of a glass over the actual air.

    vacuum_um       wavelength in vacuum, um
    glass           a name in GLASSES
    temperature_c   °C, of the glass; None for the temperature of the maker's formula
    air_phase       phase index of that air
    air_group       group index of that air

    Source: [GOLDMAN00] eq. D.1, with the glass's index truly against vacuum. The memo's 1.527077 divides an index
    relative to air by the air again: 4.3e-4 too low (see the module).

    >>> n = index_over_air(0.780, air_phase=1.000248531, air_group=1.000253247)
    >>> [round(float(v), 6) for v in n]
    [1.511224, 1.527507]
    """
    index = absolute_index(vacuum_um, glass, temperature_c)
    return Index(index.phase / np.asarray(air_phase, dtype=float), index.group / np.asarray(air_group, dtype=float))


def glass_named(name: str) -> Glass:
    """Glass by name; ValidityError with the known names if unknown."""
    if name not in GLASSES:
        raise ValidityError(f"glass '{name}' is unknown; known are {', '.join(GLASSES)}")
    return GLASSES[name]


def _warmed(wavelength: Array, phase: Array, first: Array, glass: Glass, temperature_c: Array) -> Index:
    """Change of absolute indices from the reference temperature; `first` is l dn/dl."""
    _refuse_temperature(temperature_c, glass)
    k, t = glass.thermal, temperature_c - glass.reference_c
    off = wavelength**2 - k.resonance_um**2
    bound = (k.e0 + k.e1 * t) * t / off
    driven = (k.d0 + (k.d1 + k.d2 * t) * t) * t + bound
    half = 0.5 * (phase - 1.0 / phase)  # (n^2 - 1) / 2n
    slope = 0.5 * (1.0 + phase**-2) * first * driven - half * bound * 2.0 * wavelength**2 / off  # l d/dl
    return Index(half * driven, half * driven - slope)


def _refuse_temperature(temperature_c: Array, glass: Glass) -> None:
    """Raise ValidityError for a temperature outside the makers' formula."""
    outside = ~((temperature_c >= SUPPORT_C[0]) & (temperature_c <= SUPPORT_C[1]))
    if outside.any():
        raise ValidityError(
            f"temperature {float(temperature_c[outside].flat[0]):g} C is outside {SUPPORT_C[0]:g} to {SUPPORT_C[1]:g} "
            f"C, where {glass.thermal.source} holds"
        )


def _schott(l2: Array, coefficients: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """Old power series of Schott, eq. 1.40; see `_series`."""
    powers = (0, 1, -1, -2, -3, -4)  # of l^2
    terms = np.array([a * l2 ** float(p) for a, p in zip(coefficients, powers, strict=True)])
    double = 2.0 * np.array(powers).reshape((-1,) + (1,) * l2.ndim)
    return terms.sum(axis=0), (double * terms).sum(axis=0), (double**2 * terms).sum(axis=0)


def _sellmeier(l2: Array, coefficients: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """Sellmeier series of three resonances; see `_series`."""
    pairs = list(zip(coefficients[:3], coefficients[3:], strict=True))
    square = 1.0 + np.sum([b * l2 / (l2 - c) for b, c in pairs], axis=0)
    first = -2.0 * np.sum([b * c * l2 / (l2 - c) ** 2 for b, c in pairs], axis=0)
    return square, first, 4.0 * np.sum([b * c * l2 * (l2 + c) / (l2 - c) ** 3 for b, c in pairs], axis=0)


FORMULAS: dict[str, Callable[[Array, tuple[float, ...]], tuple[Array, Array, Array]]] = {
    "schott": _schott,
    "sellmeier": _sellmeier,
}


def _series(wavelength_um: ArrayLike, name: str) -> tuple[Array, Array, Array]:
    """Series n^2, and l d/dl of it, once and twice."""
    glass = glass_named(name)
    wavelength = _within(np.asarray(wavelength_um, dtype=float), name, glass)
    return FORMULAS[glass.formula](wavelength**2, glass.coefficients)


def _within(wavelength: Array, name: str, glass: Glass) -> Array:
    """Wavelengths, um; raises for one outside the glass's limits."""
    outside = ~((wavelength >= glass.shortest_um) & (wavelength <= glass.longest_um))
    if outside.any():
        raise ValidityError(
            f"wavelength {float(wavelength[outside].flat[0]):g} um is outside "
            f"{glass.shortest_um:g}-{glass.longest_um:g} um, where {glass.source} holds for {name}"
        )
    return wavelength
