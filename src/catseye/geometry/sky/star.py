"""Azimuth and zenith angle of a star, for true north by Polaris."""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import ValidityError

EARLIEST, LATEST = 41_317.0, 88_069.0  # mjd, 1972 to 2100: UTC has leap seconds; proper motion stays straight
MJD_ZERO = 2_400_000.5  # Julian date
MILLIARCSECOND = 1e-3 * ARCSECOND
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Star:
    """Catalogue star, ICRS at the epoch J2000.0.

    name
    right_ascension, declination   rad
    motion_ra                      rad/yr, of right ascension times cos(declination), as catalogues print it
    motion_dec                     rad/yr
    parallax_arcsec
    radial_velocity_km_s
    """

    name: str
    right_ascension: float
    declination: float
    motion_ra: float = 0.0
    motion_dec: float = 0.0
    parallax_arcsec: float = 0.0
    radial_velocity_km_s: float = 0.0

    def __post_init__(self) -> None:
        limits = {"right_ascension": 2.0 * np.pi, "declination": 0.5 * np.pi, "motion_ra": 1e-4, "motion_dec": 1e-4}
        for name, limit in limits.items():
            value = getattr(self, name)
            if not abs(value) <= limit:
                raise ValidityError(f"star {self.name}: {name} {value:.9g} is outside ±{limit:.5g} rad (degrees?)")


POLARIS = Star(
    "Polaris",
    right_ascension=(2.0 + 31.0 / 60.0 + 49.09456 / 3600.0) * 15.0 * DEGREE,
    declination=(89.0 + 15.0 / 60.0 + 50.7923 / 3600.0) * DEGREE,
    motion_ra=44.48 * MILLIARCSECOND,
    motion_dec=-11.85 * MILLIARCSECOND,
    parallax_arcsec=0.00754,
    radial_velocity_km_s=-16.42,
)  # [LEEUWEN07], brought to J2000.0


def star_place(
    star: Star,
    mjd: ArrayLike,
    latitude: ArrayLike,
    *,
    longitude: ArrayLike,
    height: float = 0.0,
    ut1_utc: ArrayLike = 0.0,
    pole: tuple[float, float] = (0.0, 0.0),
) -> tuple[Floats, Floats]:
    """Azimuth (clockwise from north, [0, 2 pi)) and zenith angle of a star, rad.

    Without refraction.

    star        from a catalogue
    mjd         (...), UTC as Modified Julian Date, 1972 to 2100
    latitude    (...), rad, astronomic: the azimuth belongs to the plumb line's horizon
    longitude   (...), rad, astronomic, east positive
    height      m, above the ellipsoid (for the diurnal aberration and parallax alone)
    ut1_utc     (...), s, from the Earth rotation service; below 0.9 in size. Polaris moves by 0.2" of azimuth a second
    pole        rad, x_p and y_p of the pole: if neglected, up to 0.6" of azimuth

    Refraction lifts along the vertical and leaves the azimuth alone. Proper motion, parallax, light deflection,
    aberration, precession-nutation IAU 2006/2000A, Earth rotation, diurnal aberration, pole.

    Raises ValidityError outside 1972 to 2100.

    Source: [SOFA23] (SOFA's Atco13 as pyerfa has it); 1 mas for given UT1, pole and star.

    >>> azimuth, zenith = star_place(POLARIS, 61_280.0, 0.67, longitude=-1.39)
    >>> bool(abs(zenith - (np.pi / 2 - 0.67)) < np.radians(0.7))
    True
    """
    import erfa

    when = np.asarray(mjd, dtype=float)
    if not np.all((when >= EARLIEST) & (when <= LATEST)):
        wrong = float(when[~((when >= EARLIEST) & (when <= LATEST))].flat[0])
        raise ValidityError(f"mjd {wrong:.6f} is outside {EARLIEST:.0f} to {LATEST:.0f} (1972 to 2100), expected UTC")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*dubious year", category=erfa.ErfaWarning)  # no leap seconds known
        azimuth, zenith, *_ = erfa.atco13(
            star.right_ascension,
            star.declination,
            star.motion_ra / np.cos(star.declination),  # ERFA expects the motion of right ascension itself
            star.motion_dec,
            star.parallax_arcsec,
            star.radial_velocity_km_s,
            MJD_ZERO,
            when,
            ut1_utc,
            longitude,
            latitude,
            height,
            *pole,
            0.0,  # hPa: no refraction
            0.0,
            0.0,
            0.5,
        )
    return np.mod(azimuth, 2.0 * np.pi), np.asarray(zenith)
