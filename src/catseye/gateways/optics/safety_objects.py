"""Laser safety of a beam as JSON and text."""

from dataclasses import dataclass
from typing import Any

from catseye.gateways.writers.verdict import Verdict
from catseye.optics.safety.hazard import (
    AVERSION,
    BINOCULARS,
    NAKED,
    NOTICE,
    TIME_BASE,
    LaserBeam,
    classify,
    hazard_zone,
    returned_power,
)
from catseye.optics.safety.limits import ALPHA_MIN, EDITIONS, PUPIL, eye_limits, eye_mpe, factors, skin_limit
from catseye.optics.safety.sweep import sweep_hazard_distance

DURATIONS = (AVERSION, 10.0, 100.0, 3e4)  # s, of the table


@dataclass(frozen=True)
class Question:
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


def safety_object(question: Question) -> dict[str, Any]:
    """Object that `catseye safety --json` prints; SI units unless a key says otherwise."""
    beam, seconds = question.beam, question.seconds
    viewer = BINOCULARS if question.aided else NAKED
    outcome = classify(beam, edition=question.edition, subtense=question.subtense)
    classes = {name: classify(beam, edition=name, subtense=question.subtense).laser_class for name in EDITIONS}
    limits = eye_limits(beam.wavelength_um, seconds, question.subtense, edition=question.edition)
    governing = eye_mpe(beam.wavelength_um, seconds, question.subtense, edition=question.edition)
    skin = skin_limit(beam.wavelength_um, seconds)
    correction_factors = factors(beam.wavelength_um, seconds, question.subtense)
    return {
        "verdict": _verdict(outcome.laser_class).to_object(),
        "notice": NOTICE,
        "edition": question.edition,
        "power": beam.power,
        "wavelength_um": beam.wavelength_um,
        "diameter": beam.diameter,
        "divergence": beam.divergence,
        "beam_quality": beam.quality,
        "duration": seconds,
        "subtense": question.subtense,
        "factors": {name: getattr(correction_factors, name) for name in ("c_a", "c_b", "c_c", "c_e", "t_1", "t_2")},
        "mpe_eye": governing.irradiance,
        "mpe_eye_protects_from": governing.name,
        "mpe_skin": skin.irradiance,
        "class": outcome.laser_class,
        "class_by_edition": classes,
        "reasons": list(outcome.reasons),
        "emissions": outcome.emissions,
        "class_limits": outcome.limits,
        "viewer": viewer.name,
        "hazard_from": hazard_zone(beam, limits, viewer)[0],
        "nohd": hazard_zone(beam, limits)[1],
        "nohd_aided": hazard_zone(beam, limits, BINOCULARS)[1],
        "skin_hazard_distance": hazard_zone(beam, (skin,))[1],
        "scan": _scan(question),
        "returned": _returned(question),
        "what_if": [_what_if(question, t) for t in DURATIONS],
    }


def _verdict(laser_class: str) -> Verdict:
    """Verdict; at best that no limit is exceeded: a warning, never a certificate."""
    if laser_class == "1":
        return Verdict("good", "class 1 as described; this is a computation, never a certificate")
    return Verdict("doubtful", f"class {laser_class}: a hazard as described; this is a warning, never a certificate")


def _what_if(question: Question, seconds: float) -> dict[str, float]:
    """Row of the table for one duration."""
    beam = question.beam
    limits = eye_limits(beam.wavelength_um, seconds, question.subtense, edition=question.edition)
    skin = skin_limit(beam.wavelength_um, seconds)
    return {
        "duration": seconds,
        "mpe_eye": min(limit.irradiance for limit in limits),
        "mpe_skin": skin.irradiance,
        "nohd": hazard_zone(beam, limits)[1],
        "nohd_aided": hazard_zone(beam, limits, BINOCULARS)[1],
        "skin_hazard_distance": hazard_zone(beam, (skin,))[1],
    }


def _scan(question: Question) -> dict[str, Any] | None:
    if question.scan is None:
        return None
    conditions: dict[str, Any] = {
        "duration": question.seconds,
        "period": question.period,
        "subtense": question.subtense,
        "edition": question.edition,
    }
    far = sweep_hazard_distance(
        question.beam, question.scan, viewer=BINOCULARS if question.aided else NAKED, **conditions
    )
    return {"rate": question.scan, "period": question.period, "hazard_distance": far}


def _returned(question: Question) -> dict[str, Any] | None:
    distance = question.reflector_distance
    if distance is None:
        return None
    viewer = BINOCULARS if question.aided else NAKED
    size: dict[str, Any] = {"reflector": question.reflector_diameter, "viewer": viewer}

    def within(aperture: float) -> float:
        return returned_power(question.beam, distance, aperture=aperture, **size)

    limits = eye_limits(question.beam.wavelength_um, question.seconds, question.subtense, edition=question.edition)
    times, governing = max(((within(m.aperture) / m.power, m) for m in limits), key=lambda row: row[0])
    return {
        "distance": distance,
        "diameter": question.reflector_diameter,
        "power_into_eye": within(PUPIL),
        "limit": governing.power,
        "limit_aperture": governing.aperture,
        "limit_protects_from": governing.name,
        "times_limit": times,
    }


def safety_passages(answer: dict[str, Any]) -> list[tuple[str, str]]:
    """Title and text of each passage."""
    passages = [
        ("Class", f"{answer['class']} by {answer['edition']}" + _disagreement(answer)),
        *(("", reason) for reason in answer["reasons"]),
        ("Eye", f"{answer['mpe_eye']:.4g} W/m² for {answer['duration']:g} s ({answer['mpe_eye_protects_from']})"),
        ("Skin", f"{answer['mpe_skin']:.4g} W/m²; exceeded {_as_far(answer['skin_hazard_distance'])}"),
        ("Hazard", f"naked eye {_as_far(answer['nohd'])}; through 7x50 binoculars {_as_far(answer['nohd_aided'])}"),
    ]
    if answer["class"] in ("1", "2") and answer["nohd"] > 0.0:
        passages.append(
            ("", f"class {answer['class']}, but the limit for this exposure is exceeded within that distance")
        )
    if answer["subtense"] > ALPHA_MIN:
        width = f"distances are for a source that looks {answer['subtense'] * 1e3:g} mrad wide from everywhere"
        passages.append(
            ("", f"{width}; one of a fixed size looks smaller farther away, and is a hazard farther than that")
        )
    if answer["hazard_from"] > 0.0:
        passages.append(("", f"{answer['viewer']}: only from {answer['hazard_from']:.3g} m, around the waist"))
    if scan := answer["scan"]:
        often = "one pass" if scan["period"] is None else f"a pass every {scan['period']:g} s"
        far = f"{answer['viewer']} {_as_far(scan['hazard_distance'])}"
        text = f"at {scan['rate']:g} rad/s, {often}: {far}; valid only if the sweep cannot stop"
        passages.append(("Sweeping", text))
    if back := answer["returned"]:
        where = f"by {back['diameter'] * 1e3:g} mm at {back['distance']:g} m"
        power = f"{back['power_into_eye'] * 1e3:.3g} mW through the pupil ({answer['viewer']})"
        passages.append(
            (
                "Sent back",
                f"{where}: {power}, {back['times_limit']:.3g} times the limit ({back['limit_protects_from']})",
            )
        )
    return passages


def safety_table(answer: dict[str, Any]) -> str:
    """Table of durations as text."""
    head = f"{'exposure':>10} {'eye W/m²':>10} {'skin W/m²':>10} {'naked eye':>12} {'binoculars':>12} {'skin':>9}"
    rows = [
        f"{row['duration']:>8g} s {row['mpe_eye']:>10.4g} {row['mpe_skin']:>10.4g} {row['nohd']:>10.4g} m "
        f"{row['nohd_aided']:>10.4g} m {row['skin_hazard_distance']:>7.3g} m"
        for row in answer["what_if"]
    ]
    return "\n".join((head, *rows))


def _disagreement(answer: dict[str, Any]) -> str:
    differs = [f"{name}: {class_}" for name, class_ in answer["class_by_edition"].items() if class_ != answer["class"]]
    return f" ({', '.join(differs)})" if differs else ""


def _as_far(distance: float) -> str:
    return f"up to {distance:.4g} m" if distance > 0.0 else "nowhere"
