"""Axis offset and mirror offset by distances in both pointings.

    to the face, from afar, at autocollimation     L - s - e sin Phi     (prime: L - s + e sin Phi)
    to the back retroreflector, from afar          L - b - e sin Phi     (prime: L - b + e sin Phi)
    to a target, by the ranger itself              L + zero - (2 s cos(Phi/2) + e sin Phi) - ...   (prime: - e)

L is the distance from the scan point, e the elevation axis off the azimuth axis, s the face off the elevation axis, b
the retroreflector's. Half the difference of both pointings is e sin Phi whatever L is. s shows in no difference, as
both pointings turn the same face to the same side (the notes, section 2.4, say twice the mirror's offset: see the top
of `geometry.mirror.mirror_path`); it takes known distances.
"""

from typing import Annotated

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.mirror.mirror_path import path_change
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    residuals_by_number,
    scatter_notes,
)

KIND = "both-faces"
DISTANCE = Within(0.1, 10_000)
FACE, BACK, TARGET = "face", "back", "target"
POINTINGS = ("direct", "prime")
AGREES = 1e-9  # m


class BothFacesSheet(Sheet):
    """Sheet of distances in both pointings.

    u_distance_mm         scatter of a distance, if known
    u_known_distance_mm   of each line's known distance, as long as there is a column known_distance_m
    u_zero_mm             of the ranger's zero, which its ranges to targets share; with known distances
    """

    u_distance_mm: Uncertainty | None = None
    u_known_distance_mm: Uncertainty | None = None
    u_zero_mm: Annotated[float, Within(0, 100)] | None = None


LAYOUT = SheetLayout(
    KIND,
    BothFacesSheet,
    required={"line": TEXT, "to": TEXT, "pointing": TEXT, "phi_deg": Within(1, 179), "distance_m": DISTANCE},
    optional={"known_distance_m": DISTANCE},
)


def calibrate_both_faces(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Axis offset, and with known distances mirror offset.

    From distances in both pointings.

    readings   columns line (a word for each line of sight), to ("face", "back", "target"), pointing ("direct",
               "prime"), phi_deg (the line's angle from the azimuth axis), distance_m, perhaps known_distance_m (from
               the scan point, one for each line); sheet BothFacesSheet
    reject     leave out what the tests reject

    Raises EstimationError where no line was measured in both pointings.

    Source: [PARKER04] section 2.4 (after eq. 2.26), corrected: see the top of this file.
    """
    words = _checked(readings)
    lines = _lines(readings, words)
    keys = list(dict.fromkeys(lines))
    which = np.array([keys.index(line) for line in lines])
    has_distances = "known_distance_m" in readings.numbers
    measured, phi = readings.get("distance_m"), readings.get("phi_deg") * DEGREE
    to = {name: np.array([word == name for word in words["to"]]) for name in (FACE, BACK, TARGET)}
    prime = np.array([word == "prime" for word in words["pointing"]])
    parameters = _parameters(readings, keys, which, to)

    def predict(values: np.ndarray) -> np.ndarray:
        e, s, b, zero = values[:4] * MILLIMETRE
        length = values[4:][which]
        toward = e * np.where(prime, -1.0, 1.0) * np.sin(phi)
        answer = length - np.where(to[BACK], b, s) - toward
        t = to[TARGET]
        if t.any():
            change, _ = path_change(0.0, phi[t], length[t], [e, s, 0.0, 0.0], prime=prime[t])
            answer[t] = length[t] + zero + change
        return answer

    eye = np.eye(len(readings))
    scatter = ObservedScatter(np.zeros_like(eye), {"scatter of one distance": eye}, size=float(measured.max()))
    if readings.sheet.u_distance_mm is not None:
        scatter = ObservedScatter((readings.sheet.u_distance_mm * MILLIMETRE) ** 2 * eye)
    solution = fit_curved(
        measured,
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(active=readings.active, reject=reject, level=readings.sheet.level),
    )
    return _calibration(readings, solution, words, has_distances)


def _checked(readings: SheetReadings) -> dict[str, tuple[str, ...]]:
    """Columns of words, checked against the allowed ones."""
    expected = {"to": (FACE, BACK, TARGET), "pointing": POINTINGS}
    for name, allowed in expected.items():
        for row, word in enumerate(readings.words[name]):
            if word not in allowed:
                raise readings.refuse(row, f"{name} = {word!r} is unknown (expected {', '.join(map(repr, allowed))})")
    return {name: readings.words[name] for name in ("line", *expected)}


def _lines(readings: SheetReadings, words: dict[str, tuple[str, ...]]) -> list[str]:
    """Name of each reading's unknown length.

    Of the line, or of the line to one of its ends.
    """
    if "known_distance_m" not in readings.numbers:
        return [f"{line} ({to})" for line, to in zip(words["line"], words["to"], strict=True)]
    if readings.sheet.u_known_distance_mm is None:
        raise refusal(readings.sheet_file, "u_known_distance_mm is missing (expected with the column known_distance_m)")
    if readings.sheet.u_zero_mm is None and TARGET in words["to"]:
        raise refusal(readings.sheet_file, "u_zero_mm is missing (expected, as targets at known distances are ranged)")
    first: dict[str, float] = {}
    for row, (line, value) in enumerate(zip(words["line"], readings.get("known_distance_m"), strict=True)):
        if abs(first.setdefault(line, float(value)) - value) > AGREES:
            raise readings.refuse(
                row,
                f"known_distance_m = {value} of line {line!r} was {first[line]} before (expected one for each line)",
            )
    return list(words["line"])


def _parameters(
    readings: SheetReadings, keys: list[str], which: np.ndarray, to: dict[str, np.ndarray]
) -> list[ModelParameter]:
    sheet = readings.sheet
    has_distances = "known_distance_m" in readings.numbers
    distance = readings.get("known_distance_m" if has_distances else "distance_m")
    u = sheet.u_known_distance_mm * MILLIMETRE if has_distances else np.inf
    return [
        ModelParameter("axis offset", 0.0, 1e-2),
        ModelParameter("mirror offset", 0.0, 1e-2, np.inf if has_distances and (to[FACE] | to[TARGET]).any() else 0.0),
        ModelParameter("back retroreflector", 0.0, 1e-2, np.inf if has_distances and to[BACK].any() else 0.0),
        ModelParameter(
            "zero", 0.0, 1e-2, (sheet.u_zero_mm or 0.0) if has_distances and to[TARGET].any() else 0.0, "mm"
        ),
        *(ModelParameter(f"line {key}", float(distance[which == k][0]), 1e-4, u, "m") for k, key in enumerate(keys)),
    ]


def _calibration(
    readings: SheetReadings, solution: CurvedFit, words: dict[str, tuple[str, ...]], has_distances: bool
) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    selection = [
        ("axis offset", "axis_offset_mm", "mm", "elevation axis off the azimuth axis, along the beam's azimuth", 1.0)
    ]
    notes = []
    if np.isinf(solution.parameters[1].u):
        selection.append(
            ("mirror offset", "mirror_offset_mm", "mm", "face off the elevation axis, along its normal", 1.0)
        )
    else:
        notes.append(
            "the mirror offset moves both pointings alike: no distance is known here from the scan point, so it cannot "
            "be told; it and u of the record come from elsewhere"
        )
    if np.isinf(solution.parameters[2].u):
        notes.append(
            f"the back retroreflector stands {solution.value('back retroreflector'):.4f} mm before the scan point"
        )
    calibrated, covariance = solution.quantities(selection)
    record: dict[str, RecordValue] = {q.key: q.value for q in calibrated}
    record["u_axis_mm"] = max(q.u for q in calibrated)
    notes.append(
        f"a mirror's record has one u_axis_mm for four values; this one is of {', '.join(q.key for q in calibrated)}: "
        "keep the larger of it and the record's"
    )
    if has_distances and np.any([word == TARGET for word in words["to"]]):
        notes.append(f"the ranger's zero came out as {solution.value('zero'):+.4f} mm (u {solution.u('zero'):.4f} mm)")
    rows = tuple(
        (words["line"][k], words["to"][k], words["pointing"][k], float(readings.get("phi_deg")[k]),
         float(readings.get("distance_m")[k]), float(1e6 * fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"Axis and mirror offset of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("line", "to", "pointing", "phi_deg", "distance_m", "residual_um", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(*notes, *scatter_notes(fit, "µm", 1e-6)),
        curve=residuals_by_number(fit, 1e-6),  # distances differ by metres: residuals alone share an axis
        axes=("reading", "residual (µm)"),
        method="Distances to the mirror's face, to the retroreflector in its back, or by the ranger to a target are "
        "taken in the direct and in the prime pointing. What an axis offset and a mirror offset do to each is "
        "computed; lengths that nobody knows are found with them.",
        record=record,
    )


RECIPE = CalibrationKind(
    "axis and mirror offset from distances in direct and prime pointing",
    LAYOUT,
    calibrate_both_faces,
    plausible=Plausibility(
        scatter=ReadingScatter(
            100.0, "µm", 1e-6, "a ranger repeats to a tenth of a millimetre or better, 0.4° of phase"
        ),
        sizes={"*_offset_mm": PlausibleSpan(-10.0, 10.0, "what a mirror's record may hold of an offset", u=1.0)},
    ),
)
