"""EDM baseline as JSON and text; SI units unless a key says otherwise."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.gateways.writers.passage import Passage
from catseye.records.laboratory.baseline import FORMAT

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

TEST_KEYS = ("name", "statistic", "limit", "passed", "text")


def baseline_object(calibration: "BaselineCalibration") -> dict[str, Any]:
    """Object that `catseye baseline --json` prints."""
    s, test = calibration.solution, calibration.test
    zero, u_zero = s.of("zero")
    scale, u_scale = s.of("scale")
    full = test if isinstance(test, FullTest) else None
    rows, covariance = s.places
    n = len(calibration.names)
    return {
        "format": FORMAT,
        "verdict": calibration.verdict.to_object(),
        "observations": {"shots": len(calibration.keep), "used": int(calibration.keep.sum()), "sets": len(s.residual)},
        "sign": "observed = (1 + scale) distance + zero + cyclic; zero_correction is added to what is shown",
        "zero": zero,
        "u_zero": u_zero,
        "zero_correction": -zero,
        "scale_ppm": scale / PPM,
        "u_scale_ppm": u_scale / PPM,
        "cyclic": _cyclic(calibration),
        "s": full.s if full else None,
        "u_s": full.s / np.sqrt(2.0 * full.degrees_of_freedom) if full else None,
        "degrees_of_freedom": full.degrees_of_freedom if full else None,
        "tests": [{key: getattr(d, key) for key in TEST_KEYS} for d in calibration.decisions],
        "iso17123_4": _full(calibration),
        "noise": calibration.noise,
        "variance_factor": s.variance_factor,
        "weather_followed": calibration.weather[0],
        "u_weather_followed": calibration.weather[1],
        "reference_height": calibration.reference_height,
        "pillars": {name: pillar._asdict() for name, pillar in calibration.pillars.items()},
        "distances": [{"from": a, "to": b, "distance": d, "u_distance": u} for a, b, d, u in calibration.spans],
        "covariance_order": [f"{'x' if r < n else 'y'} {calibration.names[r % n]}" for r in rows],
        "covariance": covariance,
        "correlation_zero_scale": calibration.correlation,
        "budget": {cause: dict(zip(s.names, part.tolist(), strict=True)) for cause, part in s.parts.items()},
        "suspects": [
            {"kind": x.kind, "rows": [r + 1 for r in x.rows], "w": x.w, "p": x.p, "or_rows": [r + 1 for r in x.twins]}
            for x in calibration.suspects
        ],
        "rejected": {str(k + 1): why for k, why in enumerate(calibration.rejected) if why},
        "notes": calibration.notes,
    }


def _full(calibration: "BaselineCalibration") -> dict[str, Any] | None:
    test, total = calibration.test, calibration.all_shots
    if not isinstance(test, FullTest):
        return {"status": test}
    return {
        "status": "done",
        "zero_correction": -test.zero,
        "u_zero_correction": test.u_zero,
        "s": test.s,
        "degrees_of_freedom": test.degrees_of_freedom,
        "all_shots": None if total is None else {"s": total.s, "degrees_of_freedom": total.degrees_of_freedom},
    }


def _cyclic(calibration: "BaselineCalibration") -> dict[str, Any] | None:
    if not calibration.cyclic:
        return None
    terms = [term._asdict() for term in calibration.cyclic_terms]
    return {"unit_length": calibration.settings.unit_length, "terms": terms}


def passages(calibration: "BaselineCalibration") -> list[Passage]:
    """Summary passages for a reader, in order."""
    s, test = calibration.solution, calibration.test
    zero, u_zero = (v / MILLIMETRE for v in s.of("zero"))
    shots = calibration.observations
    passages = [
        Passage(
            "The shots",
            f"{calibration.keep.sum()} of {len(shots)} used, in {len(s.residual)} sets between "
            f"{len(calibration.names)} pillars",
        ),
        Passage("Zero", f"{zero:+.3f} ± {u_zero:.3f} mm (observed minus true; add {-zero:+.3f} mm to readings)"),
    ]
    scale, u_scale = (v / PPM for v in s.of("scale"))
    if np.isfinite(scale):
        passages.append(Passage("Scale", f"{scale:+.2f} ± {u_scale:.2f} ppm (positive: reads too long)"))
    else:
        passages.append(Passage("Scale", "not determined without certified distances"))
    for term in calibration.cyclic_terms:
        text = (
            f"order {term.order}: cosine {term.cosine / MILLIMETRE:+.3f} ± {term.u_cosine / MILLIMETRE:.3f}, "
            f"sine {term.sine / MILLIMETRE:+.3f} ± {term.u_sine / MILLIMETRE:.3f} mm"
        )
        passages.append(Passage("Cyclic", text))
    noise = s.noise
    passages.append(
        Passage(
            "Scatter",
            f"of a shot within its set {noise.shot**0.5 / MILLIMETRE:.3f} mm; from set to set "
            f"{float(noise.set) ** 0.5 / MILLIMETRE:.3f} mm and {noise.air**0.5 / PPM:.2f} ppm",
        )
    )
    if isinstance(test, FullTest):
        freedom = f"{test.degrees_of_freedom} degrees of freedom"
        text = f"s = {test.s / MILLIMETRE:.3f} mm of one distance (a set's mean), {freedom}"
        passages.append(Passage("ISO 17123-4", text))
    for d in calibration.decisions:
        verdict = {True: "passed", False: "FAILED", None: "not possible"}[d.passed]
        numbers = f" ({d.statistic:.3g}, limit {d.limit:.3g})" if np.isfinite(d.limit) else ""
        passages.append(Passage("Test", f"{d.name}: {verdict}{numbers}. {d.text}"))
    return passages + [Passage("Note", note) for note in calibration.notes]
