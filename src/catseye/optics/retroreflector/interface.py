"""Interface of all retroreflectors: fiducial point, range change, returned light.

    hollow_cube       three mirrors                                      corner
    solid_prism       cube corner of glass                               T, height / n below the face
    cats_eye          two half-balls, or one ball                        common centre
    back_mirror_cube  one of the cubes in the back of a servo mirror     the same, and the mirror's face behind it

Each has its own axes, z along its axis towards the ranger, and is used at an `incidence` from z and an `azimuth`
about z, of the direction to the ranger. What files and rooms call a kind is in `kinds`.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError

Complex = NDArray[np.complex128]
RIGHT = 0.5 * np.pi


class Sectors(NamedTuple):
    """Sectors of a retroreflector in polarized light: shares and Jones matrices.

    shares   (..., k), summing to 1
    jones    (..., k, 2, 2) amplitudes with the losses, in the axes of `corner_polarization`: as the ranger sees them
    """

    shares: Array
    jones: Complex


class Retroreflector(Protocol):
    """Retroreflector interface; lengths in metres, angles in radians.

    fiducial         (x, y, z) of the end point of a reduced range, in its own axes
    range_constant   to be added to the measured length at normal incidence; negative for glass
    range_change     further correction at an incidence; NaN where it looks away
    acceptance       largest incidence of use at any azimuth
    clear_area       m^2 across the beam: light entering there returns
    return_share     returned share of the light on the full clear face
    sectors          the same for polarized light: for `corner_polarization.returned_power`
    """

    @property
    def fiducial(self) -> tuple[float, float, float]: ...
    @property
    def range_constant(self) -> float: ...
    @property
    def acceptance(self) -> float: ...
    def range_change(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array: ...
    def clear_area(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array: ...
    def return_share(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Array: ...
    def sectors(self, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Sectors: ...


def fresnel(cosine: ArrayLike, ratio: ArrayLike) -> tuple[Array, Array]:
    """Reflectance of a bare surface in s and p; 1 in total reflection.

    cosine   of the angle of incidence, 0 to 1
    ratio    phase index behind the surface over the one before it

    Source: [BORN99] section 1.5.2, Fresnel's formulae squared. Exact for media that do not absorb.

    >>> [round(float(r), 5) for r in fresnel(1.0, 1.511)]
    [0.04141, 0.04141]
    """
    c, n = np.asarray(cosine, dtype=float), np.asarray(ratio, dtype=float)
    square = 1.0 - (1.0 - c**2) / n**2
    total = square <= 0.0
    refracted = np.sqrt(np.where(total, 0.0, square))
    with np.errstate(invalid="ignore", divide="ignore"):
        s = ((c - n * refracted) / (c + n * refracted)) ** 2
        p = ((n * c - refracted) / (n * c + refracted)) ** 2
    return np.where(total, 1.0, s), np.where(total, 1.0, p)


def incidences(incidence: ArrayLike) -> Array:
    """Angles of incidence as an array; outside 0 to pi refused.

    NaN is passed on.
    """
    angle = np.asarray(incidence, dtype=float)
    if np.any((angle < 0.0) | (angle > np.pi)):
        wrong = float(angle[(angle < 0.0) | (angle > np.pi)].flat[0])
        raise ValidityError(f"incidence {wrong:g} rad is outside 0 to pi (expected the angle from the axis)")
    return angle


def refuse_sizes(**sizes: float) -> None:
    """Raise ValidityError for a size not above 0 and finite."""
    for name, value in sizes.items():
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value:g} m is not above 0 and finite")


def refuse_shares(**shares: float | None) -> None:
    """Raise ValidityError for a given share outside 0 to 1."""
    for name, value in shares.items():
        if value is not None and not 0.0 <= value <= 1.0:
            raise ValidityError(f"{name} = {value:g} is outside 0 to 1")


def refuse_indices(phase: float, group: float) -> None:
    """Raise ValidityError for an implausible index of glass over air."""
    for name, value in (("phase", phase), ("group", group)):
        if not 1.0 < value < 4.0:
            raise ValidityError(f"{name} index ratio {value:g} is outside 1 to 4: give glass over air, such as 1.5112")
