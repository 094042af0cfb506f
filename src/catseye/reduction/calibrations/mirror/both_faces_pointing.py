"""Face tilt, beam tilt and encoder zeros by counts in both pointings.

With psi = Phi/2 the direct and the prime counts of one target, at a distance R, differ by

    N_a - (N_a' - 50 000) = -2 (tau - kappa cos psi) / sin psi        (times 1e5 / 2 pi)
    N_e + N_e' = 2 N_e0 + 4 e sin^2 psi / R                          (times 1e5 / 4 pi, the second term)

for the face tilt tau, the elevation shaft's own tilt kappa, the axis offset e: these need no known direction. The
laser beam's tilt and N_a0 move both alike; they show where the directions of the targets are known. A tilt of the beam
moves its azimuth by t, a turn of the whole mirror (beta) by t cos Phi, and both move Phi by t: targets well off the
axis tell them apart. Exact rays: `geometry.mirror.imperfect`.
"""

from typing import Annotated

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.geometry.frames.rotation import from_vector
from catseye.geometry.mirror.encoder import COUNTS_PER_RADIAN, HALF_TURN, azimuth_angle, elevation_angle
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_counts
from catseye.geometry.mirror.mount import gamma
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved, row_ends
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
from catseye.reduction.calibrations.mirror.both_faces import POINTINGS

KIND = "both-faces-pointing"
COUNTS = Within(-1_000_000, 1_000_000)
Offset = Annotated[float, Within(-10, 10)]
Arcseconds = Annotated[float, Within(0, 3600)]
STEP = 1e-5  # rad
ANGLE_ROUNDING = 1e-9  # degrees
OFFSETS = ("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm")
AXES = gamma(0.0, 0.0, 0.0)  # mirror axes of ground vectors for a mount that is not turned
NO_WAVES = np.zeros((2, 0))  # encoders without waves


class PointingSheet(Sheet):
    """Sheet of counts in both pointings.

    na0_nominal, ne0_nominal   counts: good to a few hundred, start of the search
    axis_offset_mm, mirror_offset_mm, beam_x_mm, beam_y_mm   as in the mirror's record (0)
    u_axis_mm              of each of these offsets (0)
    u_axis_tilt_arcsec     elevation shaft against the plane across the azimuth axis
    u_direction_arcsec     of each target's theta_deg and phi_deg, if these columns are there
    u_frame_arcsec         of the frame of these directions against the mirror's axes, about x and y: u of beta
    u_counts               scatter of a count, if known
    """

    na0_nominal: Annotated[float, COUNTS]
    ne0_nominal: Annotated[float, COUNTS]
    axis_offset_mm: Offset = 0.0
    mirror_offset_mm: Offset = 0.0
    beam_x_mm: Offset = 0.0
    beam_y_mm: Offset = 0.0
    u_axis_mm: Annotated[float, Within(0, 10)] = 0.0
    u_axis_tilt_arcsec: Arcseconds = 0.0
    u_direction_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    u_frame_arcsec: Arcseconds | None = None
    u_counts: Annotated[float, Within(0, 1000, above=True)] | None = None


LAYOUT = SheetLayout(
    KIND,
    PointingSheet,
    required={
        "target": TEXT,
        "pointing": TEXT,
        "azimuth_counts": COUNTS,
        "elevation_counts": COUNTS,
        "distance_m": Within(0.1, 10_000),
    },
    optional={"theta_deg": Within(-360, 360), "phi_deg": Within(0.1, 175)},
)


def calibrate_both_faces_pointing(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Face tilt and N_e0 from counts in both pointings.

    With known directions beam tilt and N_a0 too.

    readings   columns target (its name), pointing ("direct", "prime"), azimuth_counts, elevation_counts, distance_m
               (from the scan point), perhaps theta_deg and phi_deg (known direction, mirror axes); sheet PointingSheet
    reject     leave out what the tests reject, both counts of a pointing together

    Raises EstimationError where no target was found in both pointings.

    Source: [PARKER04] eq. 2.21 to 2.26 and section 2.4 on measuring in both; derived in
    `geometry.mirror.imperfect`.
    """
    m, names = len(readings), list(dict.fromkeys(readings.words["target"]))
    for row, word in enumerate(readings.words["pointing"]):
        if word not in POINTINGS:
            raise readings.refuse(row, f"pointing = {word!r} is unknown (expected 'direct', 'prime')")
    which = np.array([names.index(word) for word in readings.words["target"]])
    prime = np.array([word == "prime" for word in readings.words["pointing"]])
    distance = readings.get("distance_m")
    parameters = _parameters(readings, names, which, prime)
    observed = np.column_stack([readings.get("azimuth_counts"), readings.get("elevation_counts")])
    back = np.zeros((m, 2))

    def predict(values: np.ndarray) -> np.ndarray:
        na0, ne0, face, tilt_x, tilt_y, e, s, beam_x, beam_y, kappa, frame_x, frame_y = values[:12]
        theta, phi = values[12:].reshape(-1, 2)[which].T
        u = np.column_stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
        points = distance[:, None] * (u @ from_vector(np.array([frame_x, frame_y, 0.0])).T)
        offsets = np.array([e, s, beam_x, beam_y]) * MILLIMETRE
        station = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.array([na0, ne0]))
        counts = imperfect_counts(
            station,
            Imperfections(offsets, np.array([face, tilt_x, tilt_y]), NO_WAVES, NO_WAVES),
            points @ AXES,
            prime=prime,
        )
        shaft = 0.5 * elevation_angle(counts[:, 1], ne0)
        return (counts + back + np.column_stack([COUNTS_PER_RADIAN * kappa / np.tan(shaft), np.zeros(m)])).ravel()

    # Counts may be off by whole turns: the turn nearest to the prediction.
    start = predict(np.array([p.start for p in parameters])).reshape(m, 2)
    back[:, 0] = 2.0 * HALF_TURN * np.round((observed[:, 0] - start[:, 0]) / (2.0 * HALF_TURN))
    eye = np.eye(2 * m)
    scatter = ObservedScatter(np.zeros_like(eye), {"scatter of a count": eye}, size=float(np.abs(observed).max()))
    if readings.sheet.u_counts is not None:
        scatter = ObservedScatter(readings.sheet.u_counts**2 * eye)
    solution = fit_curved(
        observed.ravel(),
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(
            active=np.repeat(readings.active, 2),
            together=np.repeat(np.arange(m), 2),
            reject=reject,
            level=readings.sheet.level,
        ),
    )
    return _calibration(readings, solution)


def _parameters(
    readings: SheetReadings, names: list[str], which: np.ndarray, prime: np.ndarray
) -> list[ModelParameter]:
    """Twelve parameters of the mirror, two of each target.

    Unknown directions begin at the counts.
    """
    sheet = readings.sheet
    has_directions = "theta_deg" in readings.numbers and "phi_deg" in readings.numbers
    if ("theta_deg" in readings.numbers) != ("phi_deg" in readings.numbers):
        raise refusal(
            readings.file, "line 1, of the columns 'theta_deg' and 'phi_deg' one is missing (expected both or none)"
        )
    if has_directions:
        for key in ("u_direction_arcsec", "u_frame_arcsec"):
            if getattr(sheet, key) is None:
                raise refusal(
                    readings.sheet_file, f"{key} is missing (expected with the columns theta_deg and phi_deg)"
                )
    free = np.inf if has_directions else 0.0
    mirror = [
        ModelParameter("N_a0", sheet.na0_nominal, 0.1, free),
        ModelParameter("N_e0", sheet.ne0_nominal, 0.1),
        ModelParameter("face tilt", 0.0, STEP),
        ModelParameter("beam tilt x", 0.0, STEP, free),
        ModelParameter("beam tilt y", 0.0, STEP, free),
        *(ModelParameter(key, getattr(sheet, key), 1e-2, sheet.u_axis_mm, "mm") for key in OFFSETS),
        ModelParameter("axis tilt", 0.0, STEP, sheet.u_axis_tilt_arcsec * ARCSECOND, "rad"),
        *(
            ModelParameter(
                f"frame {axis}", 0.0, STEP, (sheet.u_frame_arcsec if has_directions else 0.0) * ARCSECOND, "rad"
            )
            for axis in "xy"
        ),
    ]
    theta = azimuth_angle(readings.get("azimuth_counts"), sheet.na0_nominal) - np.where(prime, np.pi, 0.0)
    phi = np.abs(elevation_angle(readings.get("elevation_counts"), sheet.ne0_nominal))
    u = np.inf
    if has_directions:
        theta, phi, u = (
            readings.get("theta_deg") * DEGREE,
            readings.get("phi_deg") * DEGREE,
            sheet.u_direction_arcsec * ARCSECOND,
        )
        _check_directions(readings, which)
    for k, name in enumerate(names):
        first = int(np.argmax(which == k))
        across = np.sin(phi[first])  # u is across the sight
        mirror.append(ModelParameter(f"theta of {name}", float(theta[first]), STEP, u / across, "rad"))
        mirror.append(ModelParameter(f"phi of {name}", float(phi[first]), STEP, u, "rad"))
    return mirror


def _check_directions(readings: SheetReadings, which: np.ndarray) -> None:
    """Raise InputError for different known directions of one target."""
    for name in ("theta_deg", "phi_deg"):
        directions = readings.get(name)
        for row in range(len(directions)):
            first = directions[np.argmax(which == which[row])]
            if abs(directions[row] - first) > ANGLE_ROUNDING:
                raise readings.refuse(
                    row,
                    f"{name} = {directions[row]:.10g} of target {readings.words['target'][row]!r} was {first:.10g} "
                    "before (expected one direction for each)",
                )


QUANTITIES = (
    ("face tilt", "face_tilt_rad", "rad", "face against the elevation shaft: its normal towards +y at Theta = 0", 1.0),
    ("N_e0", "ne0", "counts", "elevation encoder where the beam is along the azimuth axis", 1.0),
    (
        "beam tilt x",
        "beam_tilt_x_rad",
        "rad",
        "laser beam against the azimuth axis: it comes from this side of it",
        1.0,
    ),
    ("beam tilt y", "beam_tilt_y_rad", "rad", "the same along y", 1.0),
    ("N_a0", "na0", "counts", "azimuth encoder where the beam is in the x-z plane", 1.0),
)


def _calibration(readings: SheetReadings, solution: CurvedFit) -> Calibration:
    fit, sought = solution.fit, {p.name for p in solution.parameters if np.isinf(p.u)}
    selection = [w for w in QUANTITIES if w[0] in sought]
    calibrated, covariance = solution.quantities(selection)
    record: dict[str, RecordValue] = {q.key: q.value for q in calibrated}
    record["u_tilt_rad"] = max(q.u for q in calibrated if "tilt" in q.key)
    record["u_zero_counts"] = max(q.u for q in calibrated if q.key in ("na0", "ne0"))
    residual = fit.residual.reshape(-1, 2)
    rows = tuple(
        (readings.words["target"][k], readings.words["pointing"][k], float(readings.get("azimuth_counts")[k]),
         float(readings.get("elevation_counts")[k]), float(residual[k, 0]), float(residual[k, 1]),
         statistic, state)
        for k, (statistic, state) in enumerate(row_ends(fit, readings.left_out, 2))
    )  # fmt: skip
    notes = [f"u of the axis offset, {solution.u('axis_offset_mm'):.2g} mm, is in N_e0: near targets lend it weight"]
    if "beam tilt x" not in sought:
        notes.append(
            "the targets' directions are not known: beam tilt and N_a0 move both pointings alike and cannot be told"
        )
    if solution.u("axis tilt") > 0.0:
        tilt, u = solution.value("axis tilt") / ARCSECOND, solution.u("axis tilt") / ARCSECOND
        notes.append(f'the elevation shaft\'s own tilt came out as {tilt:+.2f}" (u {u:.2g}")')
    return Calibration(
        kind=KIND,
        title=f"Face tilt and encoder zeros of {readings.sheet.instrument} in both pointings",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("target", "pointing", "azimuth_counts", "elevation_counts", "residual_azimuth_counts",
                 "residual_elevation_counts", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(*notes, *scatter_notes(fit, "counts", 1.0)),
        curve=residuals_by_number(fit, 1.0),
        axes=("count: azimuth, elevation of each pointing", "residual (counts)"),
        method="The counts at which the beam of a tilted face and a tilted laser meets each target are computed "
        "exactly, direct and prime; all are adjusted together with the targets' directions. Axis offsets, the shaft's "
        "tilt and the frame of known directions are parameters with priors.",
        record=record,
    )  # fmt: skip


RECIPE = CalibrationKind(
    "face tilt, beam tilt and encoder zeros from counts in both pointings",
    LAYOUT,
    calibrate_both_faces_pointing,
    plausible=Plausibility(
        scatter=ReadingScatter(
            5.0, "counts", 1.0, "a search finds a target to some counts of 13 arcsec [PARKER04] 2.4"
        ),
        sizes={"*_tilt*_rad": PlausibleSpan(-0.05, 0.05, "a beam or face 3 degrees askew misses its mount")},
        explained=0.99,
    ),
)
