"""Eight-term pointing series of the Green Bank telescope.

The terms are IA, IE, CA, NPAE, AW, AN, HZCZ, HZSZ.

    dA cos E = CA + NPAE sin E + IA cos E + AW cos A sin E + AN sin A sin E
    dE       = -IE - AW sin A + AN cos A + HZCZ sin E + HZSZ cos E

A and E are azimuth, clockwise from north, and elevation; (dA, dE) is added to a direction on the sky to give
that of the encoders (the correction of `reduction.live.pose`), and minus the offset of the beam. With it

    IA     the azimuth encoder reads too high                     IE     the elevation encoder reads too low
    CA     the beam lies to the left of square to the elevation axis
    NPAE   the elevation axis's right end stands too high: the beam leans to the left as it rises
    AN, AW the azimuth axis leans to the north, to the west
    HZCZ, HZSZ   droop of beam against structure: sin E, cos E

as follows from geometry: an axis turned by a small vector w takes the direction d to d + w x d, along rising azimuth
-w.e and along rising elevation w.a with a = (cos A, -sin A, 0), e = (-sin E sin A, -sin E cos A, cos E); an axis that
leans to the north has w = (-AN, 0, 0), to the west (0, -AW, 0), and the encoders read minus that.

[TPOINT11] uses the same names. As a public re-implementation of it writes them, from what the encoders show to the
sky, the six terms of geometry are dA cos E = -IA cos E - CA - NPAE sin E - AN sin A sin E - AW cos A sin E and dE =
IE - AN cos A + AW sin A: the published series with the other sign throughout, so the coefficients are the same and
only (dA, dE) has the opposite sign. HZCZ and HZSZ are there, by the rule of their names, corrections of the
zenith distance by cos Z and sin Z, positive downwards: again minus the published dE. The published text
does not state the sense in which (dA, dE) is added: we take the one in which AN and AW lean as their names say.
In the opposite sense all eight coefficients change sign together and nothing else changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import ARCSECOND
from catseye.errors import ValidityError

TERMS = ("IA", "IE", "CA", "NPAE", "AW", "AN", "HZCZ", "HZSZ")
PUBLISHED_ARCSEC = (-14.18, 758.10, -27.00, -4.71, -2.18, -2.96, 680.72, 794.33)  # fit of 28-30 December 2001
PUBLISHED_SKY_RMS_ARCSEC = 7.39


def design(azimuth: ArrayLike, elevation: ArrayLike) -> Array:
    """Derivatives (..., 2, 8) of azimuth times cos E and elevation by terms.

    azimuth     rad, clockwise from north; broadcasts with
    elevation   rad

    Source: [GBTPM01], the series in use. Exact for that series.

    >>> design(0.0, 0.0)[1].tolist()  # pointing north at the horizon, elevation: -IE + AN + HZSZ
    [0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]
    """
    a, e = np.broadcast_arrays(np.asarray(azimuth, dtype=float), np.asarray(elevation, dtype=float))
    sa, ca, se, ce = np.sin(a), np.cos(a), np.sin(e), np.cos(e)
    zero, one = np.zeros_like(a), np.ones_like(a)
    across = [ce, zero, one, se, ca * se, sa * se, zero, zero]
    up = [zero, -one, zero, zero, -sa + 0.0, ca, se, ce]
    return np.stack([np.stack(across, axis=-1), np.stack(up, axis=-1)], axis=-2)


@dataclass(frozen=True, eq=False)
class PointingSeries:
    """Coefficients of the pointing series, possibly a selection.

    terms        names, a selection of TERMS; the others are zero
    values       (k,) rad
    covariance   (k, k) rad^2; zero where unknown
    """

    terms: tuple[str, ...]
    values: Array
    covariance: Array

    def __post_init__(self) -> None:
        columns(self.terms)
        k = len(self.terms)
        if np.shape(self.values) != (k,) or np.shape(self.covariance) != (k, k):
            raise ValidityError(
                f"pointing series of {k} terms has values {np.shape(self.values)} and covariance "
                f"{np.shape(self.covariance)}, expected ({k},) and ({k}, {k})"
            )

    def correction(self, azimuth: ArrayLike, elevation: ArrayLike) -> Array:
        """Correction (..., 2), rad, azimuth times cos E and elevation, sky to encoders.

        azimuth, elevation   rad, on the sky
        """
        correction = design(azimuth, elevation)[..., columns(self.terms)] @ self.values
        return np.asarray(correction)

    def covariance_of_correction(self, azimuth: ArrayLike, elevation: ArrayLike) -> Array:
        """Covariance (..., 2, 2), rad^2, of `correction` from the coefficients."""
        rows = design(azimuth, elevation)[..., columns(self.terms)]
        return np.asarray(rows @ self.covariance @ np.swapaxes(rows, -1, -2))

    def encoders(self, azimuth: ArrayLike, elevation: ArrayLike) -> tuple[Array, Array]:
        """Encoder azimuth and elevation, rad, for a beam direction on the sky.

        azimuth, elevation   rad; raises ValidityError at the zenith, where azimuth is undefined
        """
        a, e = np.broadcast_arrays(np.asarray(azimuth, dtype=float), np.asarray(elevation, dtype=float))
        low = np.abs(np.cos(e)) < 1e-6
        if np.any(low):
            raise ValidityError("elevation within 0.2 arc seconds of the zenith: azimuth is not defined there", low)
        delta = self.correction(a, e)
        return a + delta[..., 0] / np.cos(e), e + delta[..., 1]


def published() -> PointingSeries:
    """Fit of 28-30 December 2001; its covariance is not public.

    Source: [GBTPM01].

    >>> (published().correction(0.0, np.pi / 4) / ARCSECOND).round(3).tolist()
    [-41.899, 281.958]
    """
    return PointingSeries(TERMS, np.array(PUBLISHED_ARCSEC) * ARCSECOND, np.zeros((8, 8)))


def columns(terms: Sequence[str]) -> list[int]:
    """Columns of terms in TERMS; ValidityError for unknown or repeated terms."""
    strangers = [t for t in terms if t not in TERMS]
    if strangers:
        raise ValidityError(f"pointing term {strangers[0]!r} is none of {', '.join(TERMS)}")
    if len(set(terms)) != len(terms):
        raise ValidityError(f"pointing terms {', '.join(terms)}: repeated (expected each once)")
    return [TERMS.index(t) for t in terms]


def axis_terms(turn: ArrayLike) -> Array:
    """AN and AW (..., 2), rad, of an azimuth axis turned by a vector.

    The small rotation vector is in the ground frame.

    turn   (..., 3) rad, x east, y north, z up; z is no tilt but an index error, minus IA

    An axis along z turned by w goes to z + w x z = (w_y, -w_x, 1): it leans to the north by -w_x, to the west by -w_y.

    >>> axis_terms([-1e-5, 0.0, 0.0]).tolist()
    [1e-05, -0.0]
    """
    w = np.asarray(turn, dtype=float)
    if w.shape[-1:] != (3,):
        raise ValidityError(f"turn has shape {w.shape}, expected (..., 3)")
    return np.stack([-w[..., 0], -w[..., 1]], axis=-1)
