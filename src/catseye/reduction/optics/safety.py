"""Laser safety of a beam: limits of exposure, class, hazard distances, verdict."""

from collections.abc import Mapping
from dataclasses import dataclass

from catseye.errors import ArgumentError
from catseye.optics.safety.hazard import (
    AVERSION,
    BINOCULARS,
    NAKED,
    TIME_BASE,
    LaserBeam,
    LaserClassification,
    Viewer,
    classify,
    hazard_zone,
    returned_power,
)
from catseye.optics.safety.limits import (
    ALPHA_MIN,
    EDITIONS,
    PUPIL,
    ExposureLimit,
    Factors,
    eye_limits,
    eye_mpe,
    factors,
    skin_limit,
)
from catseye.optics.safety.sweep import sweep_hazard_distance
from catseye.verdict import Verdict

DURATIONS = (AVERSION, 10.0, 100.0, 3e4)  # s, of the table


@dataclass(frozen=True)
class SafetyQuestion:
    """Beam and viewing conditions to assess.

    beam                 of the laser
    edition              a name in EDITIONS
    duration             s, of the exposure; None for 0.25 s of visible light, 100 s of infrared
    aided                True for viewing through binoculars
    subtense             rad, of the apparent source
    scan, period         rad/s of the beam, s from one pass to the next; None for none
    reflector_distance   m, and diameter, m, of a retroreflector; None for none
    """

    beam: LaserBeam
    edition: str = EDITIONS[0]
    duration: float | None = None
    aided: bool = False
    subtense: float = ALPHA_MIN
    scan: float | None = None
    period: float | None = None
    reflector_distance: float | None = None
    reflector_diameter: float = 0.0508

    @property
    def seconds(self) -> float:
        """Duration of the exposure."""
        if self.duration is not None:
            return self.duration
        return AVERSION if self.beam.wavelength_um < 0.7 else TIME_BASE

    @property
    def viewer(self) -> Viewer:
        """Naked eye, or binoculars."""
        return BINOCULARS if self.aided else NAKED


@dataclass(frozen=True)
class ExposureHazard:
    """Limits of exposure (W/m²) and hazard distances (m) for one duration (s)."""

    duration: float
    mpe_eye: float
    mpe_skin: float
    nohd: float
    nohd_aided: float
    skin_hazard_distance: float


@dataclass(frozen=True)
class SweepHazard:
    """Hazard of a turning beam: rate, rad/s, period, s, and distance, m."""

    rate: float
    period: float | None
    hazard_distance: float


@dataclass(frozen=True)
class ReturnedLight:
    """Light that a retroreflector sends back into an eye.

    distance, diameter   of the retroreflector, m
    power_into_eye       W through the pupil
    limit, limit_aperture, limit_protects_from   W, m, and the injury, of the governing limit
    times_limit          power through that aperture over the limit
    """

    distance: float
    diameter: float
    power_into_eye: float
    limit: float
    limit_aperture: float
    limit_protects_from: str
    times_limit: float


@dataclass(frozen=True)
class SafetyAssessment:
    """Laser safety of a beam: for planning, never a certificate.

    question        beam and viewing conditions
    outcome         class with reasons, emissions and limits
    classes         class by edition
    governing, skin   limits for the eye and the skin
    correction      factors of the limits
    exposure        limits and hazard distances for the duration of the question
    hazard_from     m, start of the hazard for the viewer
    scan, returned  of a turning beam and of a retroreflector; None without
    what_if         for other durations
    """

    question: SafetyQuestion
    outcome: LaserClassification
    classes: Mapping[str, str]
    governing: ExposureLimit
    skin: ExposureLimit
    correction: Factors
    exposure: ExposureHazard
    hazard_from: float
    scan: SweepHazard | None
    returned: ReturnedLight | None
    what_if: tuple[ExposureHazard, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict by class: a warning, never a certificate."""
        laser_class = self.outcome.laser_class
        if laser_class == "1":
            return Verdict("good", "class 1 as described; this is a computation, never a certificate")
        return Verdict(
            "doubtful", f"class {laser_class}: a hazard as described; this is a warning, never a certificate"
        )


def assess_safety(question: SafetyQuestion) -> SafetyAssessment:
    """Laser safety of a beam: limits of exposure, class, hazard distances.

    question   beam and viewing conditions; a period needs a rate

    Raises ValidityError: values outside the limits' tables; ArgumentError: a period without a rate.
    Source: `catseye.optics.safety`.

    >>> assess_safety(SafetyQuestion(LaserBeam(0.01, 0.78, 0.02, 5e-5, 0.0))).outcome.laser_class
    '3B'
    """
    if question.period is not None and question.scan is None:
        raise ArgumentError("scan_period_s needs scan_rad_per_s", "scan_period_s", "scan_rad_per_s")
    beam, seconds, subtense = question.beam, question.seconds, question.subtense
    limits = eye_limits(beam.wavelength_um, seconds, subtense, edition=question.edition)
    return SafetyAssessment(
        question=question,
        outcome=classify(beam, edition=question.edition, subtense=subtense),
        classes={name: classify(beam, edition=name, subtense=subtense).laser_class for name in EDITIONS},
        governing=eye_mpe(beam.wavelength_um, seconds, subtense, edition=question.edition),
        skin=skin_limit(beam.wavelength_um, seconds),
        correction=factors(beam.wavelength_um, seconds, subtense),
        exposure=_exposure(question, seconds),
        hazard_from=hazard_zone(beam, limits, question.viewer)[0],
        scan=_scan(question),
        returned=_returned(question),
        what_if=tuple(_exposure(question, t) for t in DURATIONS),
    )


def _exposure(question: SafetyQuestion, seconds: float) -> ExposureHazard:
    """Limits and hazard distances for one duration."""
    beam = question.beam
    limits = eye_limits(beam.wavelength_um, seconds, question.subtense, edition=question.edition)
    skin = skin_limit(beam.wavelength_um, seconds)
    return ExposureHazard(
        duration=seconds,
        mpe_eye=min(limit.irradiance for limit in limits),
        mpe_skin=skin.irradiance,
        nohd=hazard_zone(beam, limits)[1],
        nohd_aided=hazard_zone(beam, limits, BINOCULARS)[1],
        skin_hazard_distance=hazard_zone(beam, (skin,))[1],
    )


def _scan(question: SafetyQuestion) -> SweepHazard | None:
    if question.scan is None:
        return None
    far = sweep_hazard_distance(
        question.beam,
        question.scan,
        viewer=question.viewer,
        duration=question.seconds,
        period=question.period,
        subtense=question.subtense,
        edition=question.edition,
    )
    return SweepHazard(question.scan, question.period, far)


def _returned(question: SafetyQuestion) -> ReturnedLight | None:
    distance = question.reflector_distance
    if distance is None:
        return None

    def within(aperture: float) -> float:
        return returned_power(
            question.beam,
            distance,
            aperture=aperture,
            reflector=question.reflector_diameter,
            viewer=question.viewer,
        )

    limits = eye_limits(question.beam.wavelength_um, question.seconds, question.subtense, edition=question.edition)
    times, governing = max(((within(m.aperture) / m.power, m) for m in limits), key=lambda row: row[0])
    return ReturnedLight(
        distance=distance,
        diameter=question.reflector_diameter,
        power_into_eye=within(PUPIL),
        limit=governing.power,
        limit_aperture=governing.aperture,
        limit_protects_from=governing.name,
        times_limit=times,
    )
