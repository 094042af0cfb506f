"""EDM baseline as JSON and text; SI units unless a key says otherwise."""

from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict
from catseye.records.laboratory.baseline import FORMAT

if TYPE_CHECKING:
    from catseye.reduction.baseline.instrument import BaselineCalibration

TEST_KEYS = ("name", "statistic", "limit", "passed", "text")


class Span(NamedTuple):
    """Straight-line distance between two pillars with its standard uncertainty, m."""

    start: str
    end: str
    distance: float
    u: float


def spans(calibration: "BaselineCalibration") -> list[Span]:
    """Distances of all pairs of pillars along the line, with full covariance."""
    s, n = calibration.solution, len(calibration.names)
    rows, covariance = s.places
    spans = []
    for i, j in combinations(calibration.order.tolist(), 2):
        dx, dy = s.x[j] - s.x[i], s.y[j] - s.y[i]
        d = float(np.hypot(dx, dy))
        slope = np.zeros(2 * n)
        slope[[i, j, n + i, n + j]] = np.array([-dx, dx, -dy, dy]) / d
        g = slope[rows]
        spans.append(Span(calibration.names[i], calibration.names[j], d, float(np.sqrt(g @ covariance @ g))))
    return spans


def baseline_verdict(calibration: "BaselineCalibration") -> Verdict:
    """Verdict from the tests of ISO 17123-4 and of the shots, and from weather notes."""
    return _own_verdict(calibration).hearing(humidity_doubts(calibration.observations.humidity_percent))


def _own_verdict(calibration: "BaselineCalibration") -> Verdict:
    failed = [d.name for d in calibration.decisions if d.passed is False]
    if failed:
        return Verdict("failed", f"tests failed: {'; '.join(failed)}")
    if calibration.suspects:
        return Verdict("doubtful", f"{len(calibration.suspects)} suspect shots, first {_suspect(calibration)}")
    if not isinstance(calibration.test, FullTest):
        return Verdict("doubtful", f"ISO 17123-4's full test was not possible: {calibration.test}")
    passed = sum(d.passed is True for d in calibration.decisions)
    return Verdict("good", f"every possible test passed ({passed})")


def _suspect(calibration: "BaselineCalibration") -> str:
    first = calibration.suspects[0]
    return f"{first.kind} of row {', '.join(str(r + 1) for r in first.rows[:4])} (w {first.w:.1f})"


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
        "verdict": baseline_verdict(calibration).to_object(),
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
        "noise": _noise(calibration),
        "variance_factor": s.variance_factor,
        "weather_followed": calibration.weather[0],
        "u_weather_followed": calibration.weather[1],
        "reference_height": calibration.reference_height,
        "pillars": _pillars(calibration),
        "distances": [{"from": a, "to": b, "distance": d, "u_distance": u} for a, b, d, u in spans(calibration)],
        "covariance_order": [f"{'x' if r < n else 'y'} {calibration.names[r % n]}" for r in rows],
        "covariance": covariance,
        "correlation_zero_scale": _correlation(calibration),
        "budget": {cause: dict(zip(s.names, part.tolist(), strict=True)) for cause, part in s.parts.items()},
        "suspects": [
            {"kind": x.kind, "rows": [r + 1 for r in x.rows], "w": x.w, "p": x.p, "or_rows": [r + 1 for r in x.twins]}
            for x in calibration.suspects
        ],
        "rejected": {str(k + 1): why for k, why in enumerate(calibration.rejected) if why},
        "notes": calibration.notes,
    }


def _correlation(calibration: "BaselineCalibration") -> float:
    s = calibration.solution
    if "scale" not in s.names:
        return float("nan")
    i, j = s.names.index("zero"), s.names.index("scale")
    return float(s.covariance[i, j] / np.sqrt(s.covariance[i, i] * s.covariance[j, j]))


def _cyclic(calibration: "BaselineCalibration") -> dict[str, Any] | None:
    if not calibration.cyclic:
        return None
    terms = []
    for order in range(1, len(calibration.cyclic) // 2 + 1):
        (c, u_c), (s, u_s) = (calibration.solution.of(f"cyclic {f} {order}") for f in ("cosine", "sine"))
        amplitude = float(np.hypot(c, s))
        terms.append({"order": order, "cosine": c, "u_cosine": u_c, "sine": s, "u_sine": u_s, "amplitude": amplitude})
    return {"unit_length": calibration.settings.unit_length, "terms": terms}


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


def _noise(calibration: "BaselineCalibration") -> dict[str, Any]:
    """Standard deviations and their standard uncertainties (first-order propagation)."""
    noise, u = calibration.solution.noise, calibration.solution.u_noise
    parts: dict[str, Any] = {}
    for k, (key, variance, unit) in enumerate(
        (("shot", noise.shot, 1.0), ("set", noise.set, 1.0), ("air_ppm", noise.air, PPM))
    ):
        root = float(np.sqrt(variance))
        parts[key] = root / unit
        parts[f"u_{key}"] = float(u[k]) / (2.0 * root) / unit if root > 0.0 else None
    return parts


def _pillars(calibration: "BaselineCalibration") -> dict[str, Any]:
    s = calibration.solution
    rows, covariance = s.places
    u = np.zeros(2 * len(calibration.names))
    u[rows] = np.sqrt(np.diag(covariance))
    n = len(calibration.names)
    return {
        calibration.names[i]: {
            "x": s.x[i],
            "y": s.y[i],
            "u_x": u[i],
            "u_y": u[n + i],
            "height": None if calibration.heights is None else calibration.heights[i],
        }
        for i in calibration.order
    }


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
    cyclic = _cyclic(calibration)
    for term in cyclic["terms"] if cyclic else ():
        text = (
            f"order {term['order']}: cosine {term['cosine'] / MILLIMETRE:+.3f} ± {term['u_cosine'] / MILLIMETRE:.3f}, "
            f"sine {term['sine'] / MILLIMETRE:+.3f} ± {term['u_sine'] / MILLIMETRE:.3f} mm"
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
