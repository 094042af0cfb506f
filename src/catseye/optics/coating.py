"""Metal films and thin-film stacks: reflectance, phase and group delay.

By angle and polarization.

Waves go as exp(i(wt - kz)): an absorbing medium has the index n - ik, a delay turns a phase backwards. Amplitudes are
of the tangential electric field, so that s and p are alike at normal incidence.

A range depends not on the phase on reflection but on its slope by frequency, the delay of the modulation: below a
tenth of a micrometre for a bare metal, 0.3 to 1 um for a quarter-wave mirror, more at the edge of its band. Mirror
surfaces are surveyed on the outer face of the coating, which is the reference here.

Source: [PARKER04] chapter 6, item 6, section 6.2.2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.optics.glass import GLASSES, phase_index

Complex = NDArray[np.complex128]
Polarization = Literal["s", "p"]
Material = str | complex
Layer = tuple[Material, float]  # material, thickness in um

STEP = 1e-5  # of the wave number, relative, to either side: the delay's own change over it is 1e-9 of it

# wavelength in um, n, k of opaque evaporated films
METALS: Mapping[str, tuple[str, tuple[tuple[float, float, float], ...]]] = MappingProxyType(
    {
        "gold": (
            "[JOHNSON72]",
            ((0.6168, 0.21, 3.272), (0.6595, 0.14, 3.697), (0.7045, 0.13, 4.103), (0.7560, 0.14, 4.542),
             (0.8211, 0.16, 5.083), (0.8920, 0.17, 5.663), (0.9840, 0.22, 6.350), (1.0880, 0.27, 7.150)),
        ),
        "silver": (
            "[JOHNSON72]",
            ((0.6168, 0.06, 4.152), (0.6595, 0.05, 4.483), (0.7045, 0.04, 4.838), (0.7560, 0.03, 5.242),
             (0.8211, 0.04, 5.727), (0.8920, 0.04, 6.312), (0.9840, 0.04, 6.992), (1.0880, 0.04, 7.795)),
        ),
        "aluminium": (
            "[RAKIC95]",
            ((0.61993, 1.3660, 7.4052), (0.65225, 1.5724, 7.7354), (0.68881, 1.8301, 8.0601),
             (0.72932, 2.1606, 8.3565), (0.77491, 2.6154, 8.4914), (0.79478, 2.7675, 8.3866),
             (0.81569, 2.7668, 8.2573), (0.83774, 2.6945, 8.1878), (0.88561, 2.2802, 8.1134),
             (0.91166, 1.9739, 8.3058), (0.96863, 1.4867, 9.0655), (1.0332, 1.3998, 9.8914)),
        ),
    }
)  # fmt: skip


@dataclass(frozen=True)
class Coating:
    """Layers on a substrate.

    layers      from the outer face inwards: material, thickness in um
    substrate   material beneath them
    """

    layers: tuple[Layer, ...]
    substrate: Material


@dataclass(frozen=True, eq=False)
class Response:
    """Response of a coating to a plane wave; all (...).

    r, t             amplitudes, reflected and into the substrate
    reflectance, transmittance, absorptance   of power, each by a separate formula; their sum is 1
    """

    r: Complex
    t: Complex
    reflectance: Array
    transmittance: Array
    absorptance: Array


def index(material: Material, wavelength_um: ArrayLike) -> Complex:
    """Complex index n - ik of a film or substrate.

    material        "gold", "silver", "aluminium", "Ta2O5", "SiO2", "MgF2", "air", a name of `glass.GLASSES`; a number
    wavelength_um   um: 0.617 to 1.033 for metals, 0.6 to 1.1 for Ta2O5, 0.2 to 7 for MgF2

    Raises ValidityError outside, and for an unknown name.

    Source: metals [JOHNSON72] and [RAKIC95], splines through their tables, good to 0.02 in n and 0.03 in k; films
    from one laboratory differ from another's by more. Ta2O5 a fit to [GAO12], within 1e-6 of it; MgF2 [DODGE84], the
    ordinary ray of the crystal; SiO2 that of `glass`.

    >>> complex(index("gold", 0.756))
    (0.14-4.542j)
    """
    wavelength = np.asarray(wavelength_um, dtype=float)
    if not isinstance(material, str):
        return np.broadcast_to(np.asarray(material, dtype=complex), wavelength.shape)
    if material in METALS:
        source, rows = METALS[material]
        table = np.array(rows)
        _support(wavelength, float(table[0, 0]), float(table[-1, 0]), f"{source} holds for {material}")
        from scipy.interpolate import CubicSpline

        n, k = CubicSpline(table[:, 0], table[:, 1:])(wavelength).T
        return (n - 1j * k).T
    square = wavelength**-2
    if material == "Ta2O5":
        _support(wavelength, 0.6, 1.1, "the fit to [GAO12] holds")
        return 2.0762755 + (0.0219993 + (6.4785e-4 + 3.277e-5 * square) * square) * square + 0j
    if material == "MgF2":
        _support(wavelength, 0.2, 7.0, "[DODGE84] holds for MgF2")
        terms = ((0.48755108, 0.04338408), (0.39875031, 0.09461442), (2.3120353, 23.793604))
        total = np.sum([b / (1.0 - c**2 * square) for b, c in terms], axis=0)
        return np.asarray(np.sqrt(1.0 + total), dtype=complex)
    if material == "air":
        return np.ones(wavelength.shape, dtype=complex)
    name = "fused-silica" if material == "SiO2" else material
    if name not in GLASSES:
        raise ValidityError(
            f"material {material!r} is unknown (expected a number or one of "
            f"{', '.join([*METALS, 'Ta2O5', 'SiO2', 'MgF2', 'air', *GLASSES])})"
        )
    return phase_index(wavelength, name).astype(complex)


def response(
    coating: Coating,
    wavelength_um: ArrayLike,
    incidence: ArrayLike = 0.0,
    *,
    polarization: Polarization = "s",
    medium: Material = 1.0,
) -> Response:
    """Reflected and transmitted amplitude and power of a plane wave.

    coating         layers and substrate
    wavelength_um   (...) um, in vacuum or in the air that `medium` 1 stands for
    incidence       (...) rad, 0 to below a right angle, in the medium
    polarization    "s", field across the plane of incidence, or "p", in it
    medium          in front, without absorption

    Raises ValidityError outside these limits.

    Source: [MACLEOD10] ch. 2, the characteristic matrix [B, C] and the tilted admittances. Exact for plane waves and
    flat films. `transmittance` is what enters the substrate: in an opaque metal it is lost there.

    >>> bare = Coating((), "gold")
    >>> round(float(response(bare, 0.780).reflectance), 3)
    0.975
    """
    wavelength, angle = np.broadcast_arrays(np.asarray(wavelength_um, float), np.asarray(incidence, float))
    if not np.all((angle >= 0.0) & (angle < 0.5 * np.pi)):
        raise ValidityError(f"incidence {float(np.ravel(angle)[0]):g} rad is outside 0 to a right angle")
    if polarization not in ("s", "p"):
        raise ValidityError(f"polarization {polarization!r} is not 's' or 'p'")
    front = index(medium, wavelength)
    if np.any(front.imag != 0.0):
        raise ValidityError(f"medium {medium} absorbs: an angle of incidence needs a real index")
    along = front.real * np.sin(angle)

    def admittance(material: Material) -> tuple[Complex, Complex]:
        n = index(material, wavelength)
        across = np.sqrt(n**2 - along**2 + 0j)
        across = np.where(across.imag > 0.0, -across, across)  # the wave that decays inwards
        return across, across if polarization == "s" else n**2 / across

    (_, first), (_, last) = admittance(medium), admittance(coating.substrate)
    b, c = np.ones_like(last), last
    for material, thickness_um in reversed(coating.layers):
        if not 0.0 <= thickness_um < np.inf:
            raise ValidityError(f"thickness {thickness_um} um of {material} is not 0 or more and finite")
        across, eta = admittance(material)
        delta = TWO_PI * across * thickness_um / wavelength
        cosine, sine = np.cos(delta), 1j * np.sin(delta)
        b, c = cosine * b + sine / eta * c, eta * sine * b + cosine * c
    total = first * b + c
    power = 4.0 * first.real / np.abs(total) ** 2
    return Response(
        r=(first * b - c) / total,
        t=2.0 * first / total,
        reflectance=np.abs((first * b - c) / total) ** 2,
        transmittance=power * last.real,
        absorptance=power * (b * np.conj(c) - last).real,
    )


def group_path(
    coating: Coating,
    wavelength_um: ArrayLike,
    incidence: ArrayLike = 0.0,
    *,
    polarization: Polarization = "s",
    medium: Material = 1.0,
) -> Array:
    """Path (...), m, that a reflection adds to the modulation.

    Against a reflection at the coating's outer face.

    coating, wavelength_um, incidence, polarization, medium   as for `response`

    A ranger meets its mirror on the way out and on the way back and halves the sum: its range grows by this much. The
    slope is taken at a fixed angle, as for a collimated beam; the beam's shift along the face is included.

    Source: -d arg r/dk, by a central difference. To 1e-12 m away from zeros of r.

    >>> round(float(group_path(Coating((), "gold"), 0.780)) * 1e9, 1)
    68.5
    """
    wavelength = np.asarray(wavelength_um, dtype=float)
    above, below = (
        response(coating, wavelength / (1.0 + step), incidence, polarization=polarization, medium=medium).r
        for step in (STEP, -STEP)
    )
    k = TWO_PI / (wavelength * 1e-6)
    return -np.angle(above * np.conj(below)) / (2.0 * STEP * k)


def quarter_wave(material: Material, wavelength_um: float, incidence: float = 0.0, *, medium: Material = 1.0) -> Layer:
    """Quarter-wave layer for light at an angle.

    material        of the layer, without absorption
    wavelength_um   um
    incidence       rad, in the medium
    medium          in front

    Source: [MACLEOD10] ch. 2: n d cos(theta) is a quarter wavelength.

    >>> round(quarter_wave("SiO2", 0.780)[1], 5)
    0.13414
    """
    n, front = (float(index(m, wavelength_um).real) for m in (material, medium))
    return material, 0.25 * wavelength_um / float(np.sqrt(n**2 - (front * np.sin(incidence)) ** 2))


def quarter_wave_mirror(
    pairs: int,
    *,
    wavelength_um: float = 0.780,
    incidence: float = 0.0,
    high: Material = "Ta2O5",
    low: Material = "SiO2",
    substrate: Material = "N-BK7",
) -> Coating:
    """Mirror (HL)^pairs H of quarter waves, the high index outside.

    pairs           0 or more
    wavelength_um   um, of the design
    incidence       rad, in air, of the design
    high, low, substrate   materials

    Source: [MACLEOD10] ch. 6.

    >>> round(float(response(quarter_wave_mirror(10), 0.780).reflectance), 4)
    0.9992
    """
    h, el = (quarter_wave(m, wavelength_um, incidence) for m in (high, low))
    return Coating((h, el) * pairs + (h,), substrate)


def named(coating: str, wavelength_um: float, incidence: float = 0.0) -> Coating:
    """Coating by name, designed for a wavelength and an angle.

    coating         "gold", "silver", "aluminium" (bare and opaque), "protected-aluminium" (half a wave of SiO2 on it),
                    "protected-silver" (the same), "dielectric" (`quarter_wave_mirror` of 10 pairs),
                    "ar" (a quarter wave of MgF2 on N-BK7), "uncoated" (N-BK7)
    wavelength_um   um
    incidence       rad

    Raises ValidityError for another name.
    """
    if coating in METALS:
        return Coating((), coating)
    if coating in ("protected-aluminium", "protected-silver"):
        material, quarter_um = quarter_wave("SiO2", wavelength_um, incidence)
        return Coating(((material, 2.0 * quarter_um),), coating.removeprefix("protected-"))
    if coating == "dielectric":
        return quarter_wave_mirror(10, wavelength_um=wavelength_um, incidence=incidence)
    if coating == "ar":
        return Coating((quarter_wave("MgF2", wavelength_um, incidence),), "N-BK7")
    if coating == "uncoated":
        return Coating((), "N-BK7")
    raise ValidityError(f"coating {coating!r} is unknown (expected one of {', '.join(NAMES)})")


NAMES: Sequence[str] = (
    *METALS, "protected-aluminium", "protected-silver", "dielectric", "ar", "uncoated"
)  # fmt: skip


def _support(wavelength: Array, low: float, high: float, what: str) -> None:
    outside = ~((wavelength >= low) & (wavelength <= high))
    if outside.any():
        raise ValidityError(
            f"wavelength {float(wavelength[outside].flat[0]):g} um is outside {low:g}-{high:g} um, where {what}"
        )
