"""Laser safety of a beam as JSON and text."""

from typing import TYPE_CHECKING, Any

from catseye.optics.safety.hazard import NOTICE
from catseye.optics.safety.limits import ALPHA_MIN

if TYPE_CHECKING:
    from catseye.reduction.optics.safety import SafetyAssessment


def safety_object(assessment: "SafetyAssessment") -> dict[str, Any]:
    """Object that `catseye safety --json` prints; SI units unless a key says otherwise."""
    question, outcome, exposure = assessment.question, assessment.outcome, assessment.exposure
    beam, scan, returned = question.beam, assessment.scan, assessment.returned
    return {
        "verdict": assessment.verdict.to_object(),
        "notice": NOTICE,
        "edition": question.edition,
        "power": beam.power,
        "wavelength_um": beam.wavelength_um,
        "diameter": beam.diameter,
        "divergence": beam.divergence,
        "beam_quality": beam.quality,
        "duration": question.seconds,
        "subtense": question.subtense,
        "factors": {name: getattr(assessment.correction, name) for name in ("c_a", "c_b", "c_c", "c_e", "t_1", "t_2")},
        "mpe_eye": assessment.governing.irradiance,
        "mpe_eye_protects_from": assessment.governing.name,
        "mpe_skin": assessment.skin.irradiance,
        "class": outcome.laser_class,
        "class_by_edition": dict(assessment.classes),
        "reasons": list(outcome.reasons),
        "emissions": outcome.emissions,
        "class_limits": outcome.limits,
        "viewer": question.viewer.name,
        "hazard_from": assessment.hazard_from,
        "nohd": exposure.nohd,
        "nohd_aided": exposure.nohd_aided,
        "skin_hazard_distance": exposure.skin_hazard_distance,
        "scan": None if scan is None else dict(vars(scan)),
        "returned": None if returned is None else dict(vars(returned)),
        "what_if": [dict(vars(row)) for row in assessment.what_if],
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
