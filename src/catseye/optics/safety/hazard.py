"""Laser safety of a standing beam: class, hazard distance, returned light.

For sweeping beams see `sweep`.

A warning for planning, never a certificate. Assumptions: no loss in air, a Gaussian beam, its centre on the
pupil, and exposure over the full duration.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import ValidityError
from catseye.optics import gaussian_beam
from catseye.optics.safety.limits import ALPHA_MIN, CLASS_3B, PUPIL, ExposureLimit, class_limit, factors

NOTICE = (
    "A warning for planning, not a certificate: only the standard itself, measurement and a laser safety officer "
    "decide on class and hazard zone."
)
AVERSION = 0.25  # s, aversion response to visible light
TIME_BASE, LONG_TIME_BASE = 100.0, 3e4  # s, time base of classes: unless viewing is intended; where it is
WIDEST = 1.0  # rad, full angle: the tangent of its half is 9 % more than the half
NEAREST = 0.1  # m, nearest distance of a naked eye
ROUNDING = 1e-12  # relative rounding of a power equal to the limit


@dataclass(frozen=True)
class LaserBeam:
    """Beam of a continuous laser.

    power            W
    wavelength_um    um, 0.4 to 1.4
    diameter         m, at 1/e^2 of the intensity, at the exit
    divergence       rad, full angle at 1/e^2, far away; up to 1
    waist_distance   m, from the exit to the waist; below 0 behind it

    The diameters at 1/e of other makers are smaller by the square root of 2: used here, they are conservative.
    Raises ValidityError for a physically impossible beam.
    """

    power: float
    wavelength_um: float
    diameter: float
    divergence: float
    waist_distance: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("power", "W"), ("diameter", "m"), ("divergence", "rad")):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValidityError(f"{name} = {getattr(self, name):g} {unit} is not above 0 and finite")
        if self.divergence > WIDEST:
            raise ValidityError(
                f"divergence = {self.divergence:g} rad is above {WIDEST:g} rad: such wide beams are not supported"
            )
        if not np.isfinite(self.waist_distance):
            raise ValidityError(f"waist_distance = {self.waist_distance:g} m is not finite")
        factors(self.wavelength_um)
        if not (self._waist_squared > 0.0 and self.quality > 1.0 - 1e-3):
            least = 4e-6 * self.wavelength_um / (np.pi * self.diameter)
            raise ValidityError(
                f"a divergence of {self.divergence * 1e3:.4g} mrad from {self.diameter * 1e3:.4g} mm with the waist "
                f"{self.waist_distance:g} m away is impossible (expected {least * 1e3:.4g} mrad or more with the "
                "waist at the exit)"
            )

    @classmethod
    def gaussian(cls, power: float, wavelength_um: float, waist: float, quality: float = 1.0) -> "LaserBeam":
        """Beam with its waist at the exit; waist is a radius, m.

        As `gaussian_beam.radius`.

        >>> round(LaserBeam.gaussian(0.010, 0.780, 0.010).divergence * 1e3, 5)
        0.04966
        """
        return cls(power, wavelength_um, 2.0 * waist, 2e-6 * quality * wavelength_um / (np.pi * waist))

    @property
    def _waist_squared(self) -> float:
        return self.diameter**2 - (self.divergence * self.waist_distance) ** 2

    @property
    def waist_diameter(self) -> float:
        """Diameter at the waist, m."""
        return float(np.sqrt(self._waist_squared))

    @property
    def quality(self) -> float:
        """Beam quality M^2, 1 for an ideal beam."""
        return self.divergence * self.waist_diameter * np.pi / (4e-6 * self.wavelength_um)

    def diameter_at(self, distance: float) -> float:
        """Diameter at 1/e^2, m, at a distance, m, from the exit."""
        return float(np.hypot(self.waist_diameter, self.divergence * (distance - self.waist_distance)))

    def power_within(self, aperture: float, distance: float) -> float:
        """Power, W, through a centred aperture of a diameter, m."""
        return float(-self.power * np.expm1(-2.0 * (aperture / self.diameter_at(distance)) ** 2))


@dataclass(frozen=True)
class Viewer:
    """Viewing aid of an eye, or none.

    name            display name
    entrance        m, diameter of the front lens; infinite for a naked eye
    magnification   1 for a naked eye
    transmission    0 to 1
    """

    name: str
    entrance: float = np.inf
    magnification: float = 1.0
    transmission: float = 1.0

    def __post_init__(self) -> None:
        if not (self.entrance > 0.0 and self.magnification >= 1.0 and 0.0 < self.transmission <= 1.0):
            raise ValidityError(
                f"{self.name}: entrance {self.entrance:g} m, magnification {self.magnification:g}, transmission "
                f"{self.transmission:g} are no viewing aid (expected above 0, 1 or more, 0 to 1)"
            )

    def collecting(self, aperture: float) -> float:
        """Diameter, m, at the front of light through an eye aperture, m."""
        return min(self.entrance, self.magnification * aperture)


NAKED = Viewer("naked eye")
BINOCULARS = Viewer("7x50 binoculars", 0.050, 7.0, 0.9)  # transmission of good glass for visible light; less in the IR


@dataclass(frozen=True)
class LaserClassification:
    """Laser class with its reasons.

    laser_class    a name in CLASSES
    reasons        one line each
    emissions      W: under condition 1 (50 mm at 2 m), condition 3 (7 mm at 0.1 m)
    limits         W, of classes 1, 2 (visible only), 3R, 3B
    """

    laser_class: str
    reasons: tuple[str, ...]
    emissions: dict[str, float]
    limits: dict[str, float]


def hazard_zone(beam: LaserBeam, limits: tuple[ExposureLimit, ...], viewer: Viewer = NAKED) -> tuple[float, float]:
    """Distances (from, to), m, where the standing beam exceeds a limit.

    (0, 0) if nowhere.

    beam     the laser's
    limits   of `limits`; for the nominal ocular hazard distance those of the eye
    viewer   what the eye looks through

    With d^2 = d_w^2 + (divergence (z - z_w))^2 a Gaussian beam puts 1 - exp(-2 (D/d)^2) of its power through D; the
    zone is where that is above the limit's power. ANSI's formula sqrt(4 P / (pi MPE) - a^2) / divergence, with
    diameters at 1/e, takes the peak for the average over the pupil: longer, the same far away.

    Source: [ANSI14] appendix B, nominal ocular hazard distance, made exact for the pupil. Exact for a Gaussian beam.

    >>> from catseye.optics.safety.limits import eye_limits
    >>> beam = LaserBeam(0.010, 0.780, 0.003, 1e-3)
    >>> [round(z, 2) for z in hazard_zone(beam, eye_limits(0.780, 100.0))]
    [0.0, 41.27]
    """
    zones = [zone for limit in limits if (zone := _zone(beam, limit, viewer))[1] > 0.0]
    return (min(z[0] for z in zones), max(z[1] for z in zones)) if zones else (0.0, 0.0)


def classify(
    beam: LaserBeam, *, edition: str = "iec2014", long_viewing: bool = False, subtense: float = ALPHA_MIN
) -> LaserClassification:
    """Class of the beam as a product's only accessible emission.

    beam           the laser's, standing still: a sweep counts only if it cannot stop
    edition        a name in `limits.EDITIONS`
    long_viewing   True for intended long viewing: 30 000 s instead of 100 s
    subtense       rad, of the apparent source

    The first class in the order 1, 1M, 2, 2M, 3R, 3B, 4 whose limits it meets. Single faults, labels, class 1C and
    several wavelengths are not considered.

    Source: [IEC14] clauses 4.3, 5.3 and table 10 (conditions 1 and 3; the loupe's condition 2 is gone); [ANSI14]
    section 3.3 measures alike.

    >>> classify(LaserBeam(0.010, 0.780, 0.003, 1e-3)).laser_class
    '3B'
    """
    base = LONG_TIME_BASE if long_viewing else TIME_BASE
    visible = beam.wavelength_um < 0.7
    aided, naked = beam.power_within(0.050, 2.0), beam.power_within(PUPIL, 0.1)
    limits = {"1": class_limit("1", beam.wavelength_um, base, subtense=subtense, edition=edition)}
    if visible:
        limits["2"] = class_limit("2", beam.wavelength_um, AVERSION, subtense=subtense, edition=edition)
    limits["3R"] = class_limit(
        "3R", beam.wavelength_um, AVERSION if visible else base, subtense=subtense, edition=edition
    )
    limits["3B"] = CLASS_3B
    reasons = []
    for name in ("1", "1M", "2", "2M", "3R", "3B"):
        if name.rstrip("M") not in limits:
            continue
        limit, most = limits[name.rstrip("M")], max(aided, naked)
        if name.endswith("M"):
            fits = not exceeds(naked, limit) and exceeds(aided, limit) and not exceeds(aided, CLASS_3B)
            texts = _milliwatts(naked, aided, limit)
            power = f"{texts[0]} mW through 7 mm at 0.1 m, {texts[1]} mW through 50 mm at 2 m"
        else:
            fits = not exceeds(most, limit)
            texts = _milliwatts(most, limit)
            power = f"{texts[0]} mW, the more of both measurements,"
        reasons.append(f"class {name}: {power} {'keeps' if fits else 'does not keep'} the limit of {texts[-1]} mW")
        if fits:
            break
    else:
        name = "4"
        reasons.append("class 4: more than class 3B")
    return LaserClassification(name, tuple(reasons), {"condition_1": aided, "condition_3": naked}, limits)


def exceeds(power: float, limit: float) -> bool:
    """True for a power above its limit, with rounding tolerance.

    power, limit   W

    >>> exceeds(0.39 * 1e-3, 3.9e-4), exceeds(0.39000001e-3, 3.9e-4)
    (False, True)
    """
    return power > limit * (1.0 + ROUNDING)


def _milliwatts(*powers: float) -> list[str]:
    """Powers, W, with the limit last, as texts in mW.

    With enough digits to distinguish each from the limit.
    """
    limit = powers[-1]
    for digits in range(4, 17):
        texts = [f"{power * 1e3:.{digits}g}" for power in powers]
        if all(text != texts[-1] or not _differ(power, limit) for text, power in zip(texts, powers, strict=True)):
            break
    return texts


def _differ(power: float, limit: float) -> bool:
    return exceeds(power, limit) or exceeds(limit, power)


def returned_power(
    beam: LaserBeam,
    distance: float,
    *,
    reflector: float,
    reflectance: float = 1.0,
    viewer: Viewer = NAKED,
    aperture: float = PUPIL,
) -> float:
    """Power, W, returned by a retroreflector into an eye beside the laser.

    In the middle of the returned light.

    beam          the laser's, its waist where it leaves
    distance      m, above 0, to the retroreflector
    reflector     m, above 0: diameter of its clear face
    reflectance   0 to 1, of the retroreflector
    viewer        what the eye looks through
    aperture      m, diameter over which the exposure is averaged: the pupil's for the retina, see `ExposureLimit`

    Computed as for an ideal beam (M^2 = 1) of the same waist, which spreads least: conservative.

    Source: `gaussian_beam.returned_share`. Raises ValidityError as it does, and for a waist elsewhere.

    >>> beam = LaserBeam.gaussian(0.010, 0.780, 0.010)
    >>> round(returned_power(beam, 120.0, reflector=0.0508) * 1e3, 3)
    1.654
    """
    if beam.waist_distance != 0.0:
        raise ValidityError(f"waist {beam.waist_distance:g} m away: the returned power needs a waist at the laser")
    if not 0.0 <= reflectance <= 1.0:
        raise ValidityError(f"reflectance {reflectance:g} is outside 0 to 1")
    share = gaussian_beam.returned_share(
        distance,
        aperture=0.5 * reflector,
        receiver=0.5 * viewer.collecting(aperture),
        waist=0.5 * beam.diameter,
        wavelength=1e-6 * beam.wavelength_um,
    )
    return beam.power * reflectance * viewer.transmission * share


def _zone(beam: LaserBeam, limit: ExposureLimit, viewer: Viewer) -> tuple[float, float]:
    """Zone where one limit is exceeded."""
    share = limit.power / (viewer.transmission * beam.power)
    if not exceeds(1.0, share):
        return 0.0, 0.0
    square = -2.0 * viewer.collecting(limit.aperture) ** 2 / np.log1p(-share) - beam.waist_diameter**2
    if square <= 0.0:
        return 0.0, 0.0
    reach = float(np.sqrt(square)) / beam.divergence
    return max(0.0, beam.waist_distance - reach), max(0.0, beam.waist_distance + reach)
