"""Exposure and class limits of continuous lasers, 400 to 1400 nm.

Limits for eye and skin, and emission limits of classes.

Two editions, which agree except where noted:

    iec2014    IEC 60825-1:2014 (edition 3): tables A.1, A.2 (eye), A.5 (skin), 3, 4 (class 1), 5 (class 2), 6, 7 (class
               3R), 8 (class 3B), 9 (factors). Its C3, C4, C6, C7 are the C_B, C_A, C_E, C_C below.
    ansi2014   ANSI Z136.1-2014: tables 5b to 5e (eye), 6 (factors), 7 (skin).

They differ: IEC prints class limits rounded (0.39 mW C_A), ANSI multiplies the limit of exposure by the area of a 7 mm
pupil (0.385 mW C_A); beyond 1200 nm ANSI has a limit for the cornea of its own, IEC lets no eye have more than skin.

Lengths are metres, limits W/m^2 on the average over the exposure, angles radians: 1.5 mrad is 1.5e-3. At a border of
durations the lower limit holds, at one of wavelengths that of the longer ones. All this is for planning: the standards
themselves decide. They were not available for this file: docs/safety.md lists its comparisons.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.errors import ValidityError

EDITIONS = ("iec2014", "ansi2014")
CLASSES = ("1", "1M", "2", "2M", "3R", "3B", "4")
ALPHA_MIN = 1.5e-3  # rad: a smaller source is a point to the eye
PUPIL, SKIN_APERTURE = 7e-3, 3.5e-3  # m, diameters over which exposures are averaged
SHORTEST, LONGEST = 1e-9, 3e4  # s
CLASS_2, CLASS_3B = 1e-3, 0.5  # W


class Factors(NamedTuple):
    """Correction factors of one exposure; times in s, angles in rad."""

    c_a: float
    c_b: float
    c_c: float
    c_e: float
    t_1: float
    t_2: float
    t_i: float
    alpha_max: float
    gamma: float


@dataclass(frozen=True)
class ExposureLimit:
    """Limit of exposure of eye or skin.

    name         hazard it protects from
    irradiance   W/m^2, on the average over duration and aperture
    aperture     m, diameter over which the exposure is averaged
    """

    name: str
    irradiance: float
    aperture: float

    @property
    def power(self) -> float:
        """Limit as a power, W, through its aperture."""
        return self.irradiance * 0.25 * np.pi * self.aperture**2


def factors(wavelength_um: float, duration: float = 100.0, subtense: float = ALPHA_MIN) -> Factors:
    """Correction factors of an exposure.

    wavelength_um   um, 0.4 to 1.4
    duration        s, 1e-9 to 3e4
    subtense        rad, 0 to 1: angle under which the apparent source is seen; up to 1.5e-3 it is a point

    Raises ValidityError outside.

    Source: [IEC14] table 9, [ANSI14] table 6 (T_1, where 450 to 500 nm change from heat to chemistry). C_E above
    alpha_max in ANSI's form, which counts the light of the whole source.

    >>> round(factors(0.780).c_a, 4), factors(1.064).c_a, factors(0.488).t_2
    (1.4454, 5.0, 10.0)
    """
    nm = _nanometres(wavelength_um)
    _within("duration", duration, SHORTEST, LONGEST, "s")
    _within("subtense", subtense, 0.0, 1.0, "rad")
    c_a = 1.0 if nm < 700 else (10 ** (0.002 * (nm - 700)) if nm < 1050 else 5.0)
    c_b = 1.0 if nm < 450 else 10 ** (0.02 * (min(nm, 600) - 450))
    c_c = 1.0 if nm < 1150 else (10 ** (0.018 * (nm - 1150)) if nm < 1200 else 8 + 10 ** (0.04 * (nm - 1250)))
    longest = 5e-3 if duration < 625e-6 else (0.2 * duration**0.5 if duration <= 0.25 else 0.1)
    angle = max(subtense, ALPHA_MIN)
    c_e = angle / ALPHA_MIN if angle <= longest else angle**2 / (longest * ALPHA_MIN)
    gamma = 11e-3 if duration <= 100 else (1.1e-3 * duration**0.5 if duration < 1e4 else 0.11)
    t_1 = 10.0 * 10 ** (0.02 * (min(max(nm, 450), 500) - 450))
    t_2 = 10.0 * 10 ** ((min(angle, 0.1) - ALPHA_MIN) / 98.5e-3)
    return Factors(c_a, c_b, c_c, c_e, t_1, t_2, 5e-6 if nm < 1050 else 13e-6, longest, gamma)


def eye_limits(
    wavelength_um: float, duration: float, subtense: float = ALPHA_MIN, *, edition: str = "iec2014"
) -> tuple[ExposureLimit, ...]:
    """All limits for exposure of the eye; each must be met.

    wavelength_um, duration, subtense   as for `factors`
    edition                             a name in EDITIONS

    Source: [IEC14] tables A.1 and A.2; [ANSI14] tables 5b to 5e. They are those of [ICNIRP13]. Raises ValidityError
    outside.

    >>> [(m.name, round(m.irradiance, 2)) for m in eye_limits(0.780, 100.0)]
    [('heat on the retina', 14.45)]
    """
    _check_edition(edition)
    f, nm = factors(wavelength_um, duration, subtense), _nanometres(wavelength_um)
    limits = [ExposureLimit("heat on the retina", _heat(nm, duration, f, subtense), PUPIL)]
    chemical = _chemistry(nm, duration, f, subtense)
    if chemical is not None:
        limits.append(ExposureLimit("chemistry on the retina", chemical, PUPIL))
    if nm >= 1200 and edition == "ansi2014":
        limits.append(ExposureLimit("heat on the cornea", _cornea(nm, duration), _corneal_aperture(duration)))
    elif nm >= 1200:
        skin = skin_limit(wavelength_um, duration)
        limits.append(ExposureLimit("heat on the front of the eye", skin.irradiance, skin.aperture))
    return tuple(limits)


def eye_mpe(
    wavelength_um: float, duration: float, subtense: float = ALPHA_MIN, *, edition: str = "iec2014"
) -> ExposureLimit:
    """Maximum permissible exposure of the eye: the lowest of `eye_limits`.

    wavelength_um, duration, subtense, edition   as for `eye_limits`

    Source: as `eye_limits`.

    >>> round(eye_mpe(0.6328, 0.25).irradiance, 1), eye_mpe(0.6328, 100.0).irradiance
    (25.5, 10.0)
    """
    return min(eye_limits(wavelength_um, duration, subtense, edition=edition), key=lambda limit: limit.irradiance)


def skin_limit(wavelength_um: float, duration: float) -> ExposureLimit:
    """Maximum permissible exposure of the skin, the same in both editions.

    wavelength_um, duration   as for `factors`

    Source: [IEC14] table A.5, [ANSI14] table 7.

    >>> round(skin_limit(0.780, 100.0).irradiance), skin_limit(0.6328, 100.0).irradiance
    (2891, 2000.0)
    """
    c_a = factors(wavelength_um, duration).c_a
    if duration > 10.0:
        return ExposureLimit("heat on the skin", 2000.0 * c_a, SKIN_APERTURE)
    energy = 200.0 if duration < 1e-7 else 1.1e4 * duration**0.25
    return ExposureLimit("heat on the skin", energy * c_a / duration, SKIN_APERTURE)


def class_limit(
    laser_class: str, wavelength_um: float, duration: float, *, subtense: float = ALPHA_MIN, edition: str = "iec2014"
) -> float:
    """Accessible emission limit of a class, W.

    laser_class                         1, 2, 3R or 3B; 2 from 0.4 to below 0.7 um only
    wavelength_um, duration, subtense   as for `factors`; the duration is the class's time base
    edition                             a name in EDITIONS

    Source: [IEC14] tables 3 to 8; [ANSI14] section 3.3, the limit of exposure times the area of its aperture.

    >>> [round(class_limit(c, 0.780, 100.0) * 1e3, 3) for c in ("1", "3R", "3B")]
    [0.564, 2.891, 500.0]
    """
    _check_edition(edition)
    visible = _nanometres(wavelength_um) < 700
    if laser_class == "3B":
        return CLASS_3B
    if laser_class in ("2", "3R") and visible and duration >= 0.25:
        c_e = factors(wavelength_um, 0.25, subtense).c_e
        return (1.0 if laser_class == "2" else 5.0) * CLASS_2 * c_e
    if laser_class == "1" or (laser_class == "2" and visible):
        return min(_class_1(wavelength_um, duration, subtense, edition), CLASS_3B)
    if laser_class == "3R":
        return min(_class_3r(wavelength_um, duration, subtense, edition), CLASS_3B)
    raise ValidityError(f"class {laser_class} has no limit at {wavelength_um:g} um (1, 3R and 3B have; 2 below 0.7 um)")


def _class_1(wavelength_um: float, duration: float, subtense: float, edition: str) -> float:
    if edition == "ansi2014":
        return min(limit.power for limit in eye_limits(wavelength_um, duration, subtense, edition=edition))
    f, nm = factors(wavelength_um, duration, subtense), _nanometres(wavelength_um)
    point, tall = subtense <= ALPHA_MIN, nm >= 1050
    if duration < f.t_i:
        heat = (7.7e-7 * f.c_c if tall else 7.7e-8 * f.c_a) * f.c_e / duration
    elif point and duration >= 10.0:
        heat = 3.9e-4 * f.c_a * f.c_c
    else:
        heat = (3.5e-3 if tall else 7e-4 * f.c_a) * f.c_c * f.c_e * min(duration, f.t_2) ** -0.25
    chemical = _chemistry(nm, duration, f, subtense)
    return heat if chemical is None else min(heat, 3.9e-5 * chemical)


def _class_3r(wavelength_um: float, duration: float, subtense: float, edition: str) -> float:
    """Class 3R limit: five times class 1, which IEC rounds for points."""
    if edition == "iec2014" and subtense <= ALPHA_MIN and duration >= 10.0 and wavelength_um >= 0.7:
        f = factors(wavelength_um, duration, subtense)
        return 2.0e-3 * f.c_a * f.c_c
    return 5.0 * _class_1(wavelength_um, duration, subtense, edition)


def _heat(nm: float, duration: float, f: Factors, subtense: float) -> float:
    """Thermal limit of the retina, W/m^2."""
    tall = nm >= 1050
    if duration < f.t_i:
        return (2e-2 * f.c_c if tall else 2e-3 * f.c_a) * f.c_e / duration
    if subtense <= ALPHA_MIN and duration >= 10.0:
        return 10.0 * f.c_a * f.c_c
    return (90.0 if tall else 18.0 * f.c_a) * f.c_c * f.c_e * min(duration, f.t_2) ** -0.25


def _chemistry(nm: float, duration: float, f: Factors, subtense: float) -> float | None:
    """Photochemical limit of the retina, W/m^2; None where absent.

    Only light within gamma counts: an even source larger than that is allowed more by the square.
    """
    early = duration >= 1.0 and nm <= 484 and ALPHA_MIN < subtense < 82e-3
    if nm > 600 or not (duration >= 10.0 or early):
        return None
    return 100.0 * f.c_b / min(duration, 100.0) * max(1.0, subtense / f.gamma) ** 2


def _cornea(nm: float, duration: float) -> float:
    """Corneal limit, W/m^2, [ANSI14] table 5c, 1200 to 1400 nm."""
    k = 10 ** (0.01 * (1400 - nm))
    if duration >= 10.0:
        return 1e4 * (0.03 * k + 0.07)
    time_term = 0.0 if duration < 1e-3 else (0.56 * duration**0.25 - 0.1 if duration < 4.0 else 0.7)
    return 1e4 * (0.3 * k + time_term) / duration


def _corneal_aperture(duration: float) -> float:
    """Limiting aperture at the cornea, m, [ANSI14] table 8."""
    return 1e-3 if duration <= 0.3 else (1.5e-3 * duration**0.375 if duration < 10.0 else 3.5e-3)


def _nanometres(wavelength_um: float) -> float:
    _within("wavelength", wavelength_um, 0.4, 1.4, "um")
    return round(1e3 * wavelength_um, 9)  # 1.1 um is 1100 nm exactly


def _within(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise ValidityError(f"{name} {value:g} {unit} is outside {low:g}-{high:g} {unit}, where these limits are known")


def _check_edition(edition: str) -> None:
    if edition not in EDITIONS:
        raise ValidityError(f"edition {edition!r} is not one of {', '.join(EDITIONS)}")
