"""Mirror axes, encoder zeros and face tilt by an autocollimator.

beta1, beta2, N_e0, N_a0 and the tilt of the face.

One adjustment of all readings with exact rays (`geometry.mirror.autocollimator`). Into the mirror near Phi = 0 the
reflection goes round a circle as the azimuth is turned: its centre is beta, its radius is how far the shaft stands from
N_e0, and the face's tilt. Into a flat on the x axis, at Phi = 90 degrees, it shows N_a0.

Separable parameters:
    beta, face tilt, N_e0   by azimuths half a turn apart; with one azimuth only, not at all
    face tilt and N_a0      at Phi = 0: the tilt makes a circle where the shaft stands right, N_a0 does not; at 90
                            degrees by direct and prime readings
    face tilt and the elevation shaft's own tilt   by readings at Phi = 0 and, direct and prime, at 90 degrees; else the
                            shaft's is a parameter with a prior (u_axis_tilt_arcsec)
    beta and the autocollimator's alignment        not at all: a prior (u_lean_x_arcsec, u_lean_y_arcsec)
"""

from typing import Annotated, Literal

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.mirror.autocollimator import face_normal, flat_reading, mirror_reading
from catseye.geometry.mirror.encoder import azimuth_angle, elevation_angle
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved, row_ends
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    scatter_notes,
)

KIND = "autocollimation"
COUNTS = Within(-1_000_000, 1_000_000)
ARC = Within(-7200, 7200)
NEAR = 5.0 * DEGREE  # of the beam: an autocollimator sees far less
Arcseconds = Annotated[float, Within(0, 3600)]
STEP = 1e-5  # rad


class AutocollimationSheet(Sheet):
    """Sheet of an autocollimation.

    displays                           "beam" or "mirror": angle on the autocollimator's scale, the beam's or half
                                       of it
    x_sign, y_sign                     1 if the reading grows as the mirror's normal leans towards +x^, +y^ (up); -1
                                       if it falls
    na0_nominal, ne0_nominal           counts, start of the search
    u_na0_counts                       of na0_nominal, without a reading into a flat: then N_a0 is fixed
    u_face_tilt_arcsec                 of a face tilt of zero, where the readings do not determine it: then it is
                                       fixed
    face_tilt_limit_arcsec             tolerance of the mirror's adjustment, if the tilt is to be judged
    u_axis_tilt_arcsec                 elevation shaft against the plane across the azimuth axis
    u_lean_x_arcsec, u_lean_y_arcsec   of the autocollimator against the mount's z
    u_roll_arcsec                      of the autocollimator about the mount's z
    u_scale_percent                    of its scale
    u_flat_arcsec                      lean of the flat out of the vertical (towards y)
    u_flat_turn_arcsec                 turn of the flat about y
    u_reading_arcsec                   scatter of each reading of each axis, as displayed, if known
    u_count                            counts: of the shafts' places by the encoder's counts, independent for each
                                       reading
    """

    displays: Literal["beam", "mirror"]
    x_sign: Literal[1, -1] = 1
    y_sign: Literal[1, -1] = 1
    na0_nominal: Annotated[float, COUNTS]
    ne0_nominal: Annotated[float, COUNTS]
    u_na0_counts: Annotated[float, Within(0, 20_000)] | None = None
    u_face_tilt_arcsec: Arcseconds | None = None
    face_tilt_limit_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    u_axis_tilt_arcsec: Arcseconds = 0.0
    u_lean_x_arcsec: Arcseconds
    u_lean_y_arcsec: Arcseconds
    u_roll_arcsec: Annotated[float, Within(0, 36_000)]
    u_scale_percent: Annotated[float, Within(0, 20)] = 0.0
    u_flat_arcsec: Arcseconds | None = None
    u_flat_turn_arcsec: Arcseconds = 600.0
    u_reading_arcsec: Annotated[float, Within(0, 60, above=True)] | None = None
    u_count: Annotated[float, Within(0, 10)] = 0.29


LAYOUT = SheetLayout(
    KIND,
    AutocollimationSheet,
    required={"azimuth_counts": COUNTS, "elevation_counts": COUNTS, "x_arcsec": ARC, "y_arcsec": ARC},
    optional={"into": TEXT, "u_reading_arcsec": Within(0, 60, above=True)},
)


def calibrate_autocollimation(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Mirror axes, encoder zeros and face tilt from autocollimator readings.

    readings   columns azimuth_counts, elevation_counts, x_arcsec, y_arcsec, perhaps into ("mirror" or "flat"); sheet
               AutocollimationSheet
    reject     leave out what the tests reject, both axes of a reading together

    Raises EstimationError where the readings do not determine a parameter, naming it.

    Source: [PARKER04] sections 2.2 (step 4) and 2.4 (step 6), with the remarks in `geometry.mirror.autocollimator`.
    """
    sheet, m = readings.sheet, len(readings)
    flat = _flat(readings)
    sign = np.array([sheet.x_sign, sheet.y_sign])
    observed = (np.column_stack([readings.get("x_arcsec"), readings.get("y_arcsec")]) * sign * ARCSECOND).ravel()
    parameters = _parameters(readings, bool(flat.any()))
    names = [p.name for p in parameters]
    display_factor = 1.0 if sheet.displays == "beam" else 0.5
    na, ne = readings.get("azimuth_counts"), readings.get("elevation_counts")

    def predict(values: np.ndarray, aside: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
        p = dict(zip(names, values, strict=True))
        theta = azimuth_angle(na + aside[0], p["N_a0"])
        shaft = 0.5 * elevation_angle(ne + aside[1], p["N_e0"])
        normal = face_normal(theta, shaft, p["face tilt"], axis_tilt=p["axis tilt"])
        beta, alignment = [p["beta1"], p["beta2"]], [p["lean x"], p["lean y"], p["roll"]]
        reading = mirror_reading(normal, beta, alignment)
        if flat.any():
            reading[flat] = flat_reading(normal[flat], beta, alignment, flat=[p["flat up"], p["flat along"]])
        return (display_factor * (1.0 + p["scale"]) * reading).ravel()

    start = np.array([p.start for p in parameters])
    shaking = np.zeros((2 * m, 2 * m))
    for axis in ((1.0, 0.0), (0.0, 1.0)):  # a count moves both coordinates of its own reading
        slope = 0.5 * sheet.u_count * (predict(start, axis) - predict(start, (-axis[0], -axis[1])))
        shaking += np.outer(slope, slope) * np.kron(np.eye(m), np.ones((2, 2)))
    solution = fit_curved(
        observed,
        predict,
        parameters,
        scatter=_scatter(readings, shaking),
        options=FitOptions(
            active=np.repeat(readings.active, 2), together=np.repeat(np.arange(m), 2), reject=reject, level=sheet.level
        ),
    )
    return _calibration(readings, solution, flat, display_factor)


def _flat(readings: SheetReadings) -> np.ndarray:
    """True (m,) for readings into the flat.

    Raises InputError for other words, and counts of another direction.
    """
    sheet, words = readings.sheet, readings.words.get("into", ("mirror",) * len(readings))
    for row, word in enumerate(words):
        if word not in ("mirror", "flat"):
            raise readings.refuse(row, f"into = {word!r} is unknown (expected 'mirror' or 'flat')")
    flat = np.array([word == "flat" for word in words])
    phi = elevation_angle(readings.get("elevation_counts"), sheet.ne0_nominal)
    off = np.where(flat, np.abs(np.abs(phi) - 0.5 * np.pi), np.abs(phi))
    if np.any(off > NEAR):
        row = int(np.argmax(off > NEAR))
        expected = "90, or -90 in prime, into a flat" if flat[row] else "0, into the mirror"
        raise readings.refuse(
            row,
            f"elevation_counts = {readings.get('elevation_counts')[row]:g} points to Phi = {phi[row] / DEGREE:.2f} "
            f"degrees from ne0_nominal = {sheet.ne0_nominal:g} (expected within 5 of {expected})",
        )
    if flat.any() and sheet.u_flat_arcsec is None:
        raise refusal(readings.sheet_file, f"u_flat_arcsec is missing (expected, as {readings.file} reads into a flat)")
    if not flat.any() and sheet.u_na0_counts is None:
        raise refusal(
            readings.sheet_file,
            f"u_na0_counts is missing (expected, as no reading of {readings.file} is into a flat, to show N_a0)",
        )
    return flat


def _parameters(readings: SheetReadings, flat: bool) -> list[ModelParameter]:
    sheet = readings.sheet

    def arcseconds(name: str, u: float | None) -> ModelParameter:
        return ModelParameter(name, 0.0, STEP, np.inf if u is None else u * ARCSECOND, "rad")

    return [
        ModelParameter("beta1", 0.0, STEP),
        ModelParameter("beta2", 0.0, STEP),
        ModelParameter("N_a0", sheet.na0_nominal, 0.1, np.inf if flat else sheet.u_na0_counts, "counts"),
        ModelParameter("N_e0", sheet.ne0_nominal, 0.1),
        arcseconds("face tilt", sheet.u_face_tilt_arcsec),
        arcseconds("axis tilt", sheet.u_axis_tilt_arcsec),
        arcseconds("lean x", sheet.u_lean_x_arcsec),
        arcseconds("lean y", sheet.u_lean_y_arcsec),
        arcseconds("roll", sheet.u_roll_arcsec),
        ModelParameter("scale", 0.0, 1e-3, sheet.u_scale_percent / 100.0, "1"),
        arcseconds("flat up", sheet.u_flat_arcsec if flat else 0.0),
        arcseconds("flat along", sheet.u_flat_turn_arcsec if flat else 0.0),
    ]


def _scatter(readings: SheetReadings, shaking: np.ndarray) -> ObservedScatter:
    if readings.has("u_reading_arcsec"):
        u = np.repeat(readings.get("u_reading_arcsec") * ARCSECOND, 2)
        return ObservedScatter(shaking + np.diag(u**2))
    return ObservedScatter(shaking, {"scatter of one reading": np.eye(len(shaking))})


QUANTITIES = (
    ("beta1", "beta1_rad", "rad", "turn of the mirror's axes about x: minus the azimuth axis's lean upwards", 1.0),
    ("beta2", "beta2_rad", "rad", "turn about y: the azimuth axis's lean towards +x", 1.0),
    ("N_e0", "ne0", "counts", "elevation encoder where the beam is along the azimuth axis", 1.0),
    ("N_a0", "na0", "counts", "azimuth encoder where the beam is in the x-z plane", 1.0),
    ("face tilt", "face_tilt_rad", "rad", "face against the elevation shaft: its normal towards +y at Theta = 0", 1.0),
)


def _calibration(readings: SheetReadings, solution: CurvedFit, flat: np.ndarray, display_factor: float) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    sought = {p.name for p in solution.parameters if np.isinf(p.u)}
    selection = [w for w in QUANTITIES if w[0] in sought]
    calibrated, covariance = solution.quantities(selection)
    record: dict[str, RecordValue] = {q.key: q.value for q in calibrated}
    record["u_beta_rad"] = max(solution.u("beta1"), solution.u("beta2"))
    record["u_zero_counts"] = max(solution.u("N_e0"), solution.u("N_a0"))
    if "face tilt" in sought:
        record["u_tilt_rad"] = solution.u("face tilt")
    residual = fit.residual.reshape(-1, 2) / ARCSECOND
    rows = tuple(
        ("flat" if flat[k] else "mirror", float(readings.get("azimuth_counts")[k]),
         float(readings.get("elevation_counts")[k]), float(readings.get("x_arcsec")[k]),
         float(readings.get("y_arcsec")[k]), float(residual[k, 0]), float(residual[k, 1]),
         statistic, state)
        for k, (statistic, state) in enumerate(row_ends(fit, readings.left_out, 2))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"Mirror axes and encoder zeros of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("into", "azimuth_counts", "elevation_counts", "x_arcsec", "y_arcsec", "residual_x_arcsec",
                 "residual_y_arcsec", fit.test, "state"),
        rows=rows,
        decisions=(_tilt_decision(solution, sheet.face_tilt_limit_arcsec), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=_notes(solution, bool(flat.any())),
        curve=_circles(readings, solution, flat, display_factor),
        axes=("x (arcsec of the mirror)", "y (arcsec of the mirror)"),
        method="The light's way from the autocollimator by the mirror, and by the flat, back is computed exactly for "
        "each reading; all readings are adjusted together. The autocollimator's alignment and scale, the flat and the "
        "elevation shaft's tilt are parameters with priors.",
        record=record,
        equal_axes=True,
    )  # fmt: skip


def _tilt_decision(solution: CurvedFit, limit: float | None) -> CheckOutcome:
    name, nan = "face parallel to the elevation shaft: |tilt|, arcsec", float("nan")
    if not np.isinf(solution.parameters[solution.index("face tilt")].u):
        return CheckOutcome(name, nan, nan, None, "the readings were not asked for the tilt; it has a prior")
    tilt, u = solution.value("face tilt") / ARCSECOND, solution.u("face tilt") / ARCSECOND
    text = f'the face leans {tilt:+.2f}" (u {u:.2g}"); the record corrects for it'
    return CheckOutcome(name, abs(tilt), limit or nan, None if limit is None else abs(tilt) <= limit, text)


def _notes(solution: CurvedFit, flat: bool) -> tuple[str, ...]:
    fit = solution.fit
    notes = [
        "beta cannot be better than the autocollimator's alignment, which no reading shows: "
        f'u {solution.u("lean y") / ARCSECOND:.2g}" about x, {solution.u("lean x") / ARCSECOND:.2g}" about y',
        f'N_e0 is {solution.value("N_e0"):.2f}; a count of the shaft moves the beam by 25.92"',
    ]
    if flat:
        plain = solution.value("N_a0") + (solution.value("beta1")) * 1e5 / (2 * np.pi)
        notes.append(
            f"the notes' step 6 taken literally (y zeroed with the autocollimator still along z) would give N_a0 = "
            f"{plain:.1f}: beta1 off, as the light does not come in along the azimuth axis"
        )
    else:
        notes.append("no reading into a flat: N_a0 is that of the sheet")
    if solution.u("axis tilt") > 0.0:
        notes.append(
            f"the elevation shaft's own tilt came out as {solution.value('axis tilt') / ARCSECOND:+.1f}\" "
            f'(u {solution.u("axis tilt") / ARCSECOND:.1f}"); near Phi = 0 only face tilt less shaft tilt shows'
        )
    return (*notes, *scatter_notes(fit, "arcsec", ARCSECOND))


def _circles(
    readings: SheetReadings, solution: CurvedFit, flat: np.ndarray, display_factor: float
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Readings into the mirror, and the circle of each elevation setting.

    Arcsec of mirror angles.
    """
    sheet, scale = readings.sheet, 0.5 / display_factor
    x = readings.get("x_arcsec") * sheet.x_sign * scale
    y = readings.get("y_arcsec") * sheet.y_sign * scale
    on = solution.fit.active.reshape(-1, 2).all(axis=1)
    theta = np.linspace(0.0, 2.0 * np.pi, 181)
    curves = [np.full((1, 2), np.nan)]
    for ne in np.unique(readings.get("elevation_counts")[~flat]):
        shaft = 0.5 * elevation_angle(ne, solution.value("N_e0"))
        normal = face_normal(theta, shaft, solution.value("face tilt"), axis_tilt=solution.value("axis tilt"))
        alignment = [solution.value(name) for name in ("lean x", "lean y", "roll")]
        reading = mirror_reading(normal, [solution.value("beta1"), solution.value("beta2")], alignment)
        curves += [0.5 * reading / ARCSECOND, np.full((1, 2), np.nan)]
    line = np.concatenate(curves)
    return {
        "readings": (x[on & ~flat], y[on & ~flat]),
        "left out": (x[~on & ~flat], y[~on & ~flat]),
        "fit": (line[:, 0], line[:, 1]),
    }


RECIPE = CalibrationKind(
    "mirror axes, encoder zeros and face tilt from an autocollimator",
    LAYOUT,
    calibrate_autocollimation,
    plausible=Plausibility(
        scatter=ReadingScatter(
            5.0, "arcsec", ARCSECOND, "an autocollimator is read to a second or better [PARKER04] 2.4"
        ),
        sizes={
            "beta?_rad": PlausibleSpan(-0.02, 0.02, "a mirror's axes within a degree of its mount's"),
            "face_tilt_rad": PlausibleSpan(-0.01, 0.01, "a face half a degree off its shaft is mounted wrongly"),
        },
    ),
)
