"""Laser beam against the azimuth axis, by spots on turning screens.

The mirror folds the beam and nothing else: on a screen square to the beam, l metres past the mirror (below zero: before
it), the spot of a beam through (x_b, y_b) that comes in from the direction (t_x, t_y, ~1) stands at

    p = p_0 + g cos Theta' + g' sin Theta',   q = q_0 - g sin Theta' + g' cos Theta'
    (g, g') = (x_b, y_b) - l (t_x, t_y)

p towards growing Phi (before the mirror: outwards, along the beam's azimuth), q towards growing Theta. Where the screen
stands and where the face lies only make p_0 and q_0; so does the face's tilt, but for tilt times tilt (1e-7 rad). So
the circle's radius vector at two distances gives place and tilt of the beam; a screen that does not turn mixes them
with the mount's own axis.

Its effect on pointing and range is computed with exact rays (`geometry.mirror.imperfect`). A tilt of the beam moves
the pointing by itself; it moves no range to first order, as the wave's phase is the same all across.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.mirror.encoder import HALF_TURN, azimuth_angle
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_counts, imperfect_ray
from catseye.geometry.mirror.mount import gamma
from catseye.geometry.mirror.pointing import MirrorStation, aim
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
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

KIND = "alignment"
COUNTS, SPOT, PATH = Within(-1_000_000, 1_000_000), Within(-1000, 1000), Within(-10, 500)
PLACE = 1e-6  # m: screens nearer to each other are one
AZIMUTHS = 36  # at which the effect is looked up
Tilt = Annotated[float, Within(-0.1, 0.1)]
NO_WAVES = np.zeros((2, 0))  # encoders without waves


class AlignmentSheet(Sheet):
    """Sheet of a laser beam's alignment.

    na0                   counts at Theta = 0
    u_spot_mm             scatter of each coordinate of a spot, if known
    u_screen_turn_deg     of each screen about the beam, against p and q
    u_path_mm             of each screen's path_m
    face_tilt_rad, u_face_tilt_rad   face tilt against the elevation shaft, by autocollimation; for the effect
    effect_phi_deg, effect_distance_m   directions of the reported effect on range and pointing ([30, 60, 90, 120], 100)
    """

    na0: Annotated[float, COUNTS]
    u_spot_mm: Annotated[float, Within(0, 100, above=True)] | None = None
    u_screen_turn_deg: Annotated[float, Within(0, 20)]
    u_path_mm: Annotated[float, Within(0, 1000)]
    face_tilt_rad: Tilt = 0.0
    u_face_tilt_rad: Annotated[float, Within(0, 0.1)] = 0.0
    effect_phi_deg: Annotated[tuple[Annotated[float, Within(1, 170)], ...], Field(strict=False, min_length=1)] = (
        30.0,
        60.0,
        90.0,
        120.0,
    )
    effect_distance_m: Annotated[float, Within(1, 1000)] = 100.0


LAYOUT = SheetLayout(
    KIND,
    AlignmentSheet,
    required={"screen": TEXT, "path_m": PATH, "azimuth_counts": COUNTS, "p_mm": SPOT, "q_mm": SPOT},
)


def calibrate_alignment(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Place and tilt of the laser beam against the azimuth axis.

    With their effect on range and pointing.

    readings   columns screen (a word for each), path_m (past the mirror along the beam, below zero before it; one for
               each screen), azimuth_counts, p_mm and q_mm (the spot); sheet AlignmentSheet
    reject     leave out what the tests reject, both coordinates of a spot together

    Raises EstimationError where the screens stand at one distance, or too few azimuths were taken.

    Source: [PARKER04] section 5.3 assumes the beam on the axes; derived above by unfolding, exact for a flat mirror.
    """
    sheet, m = readings.sheet, len(readings)
    names = list(dict.fromkeys(readings.words["screen"]))
    which = np.array([names.index(word) for word in readings.words["screen"]])
    path = readings.get("path_m")
    for row in range(m):
        first = path[np.argmax(which == which[row])]
        if abs(path[row] - first) > PLACE:
            raise readings.refuse(row, f"path_m = {path[row]} of this screen was {first} before (expected a new name)")
    theta = azimuth_angle(readings.get("azimuth_counts"), sheet.na0)
    cosine, sine = np.cos(theta), np.sin(theta)
    observed = np.column_stack([readings.get("p_mm"), readings.get("q_mm")])
    parameters = [ModelParameter(name, 0.0, 1e-2) for name in ("beam x", "beam y")]
    parameters += [ModelParameter(name, 0.0, 1e-5) for name in ("tilt x", "tilt y")]
    for k, name in enumerate(names):
        middle = observed[which == k].mean(axis=0)
        parameters += [
            ModelParameter(f"{axis} of screen {name}", float(v), 1e-2) for axis, v in zip("pq", middle, strict=True)
        ]
        parameters.append(ModelParameter(f"turn of screen {name}", 0.0, 1e-4, sheet.u_screen_turn_deg * DEGREE, "rad"))
        parameters.append(ModelParameter(f"path of screen {name}", 0.0, 1e-2, sheet.u_path_mm, "mm"))

    def predict(values: np.ndarray) -> np.ndarray:
        zero_p, zero_q, turn, further = values[4:].reshape(-1, 4)[which].T
        length = path / MILLIMETRE + further
        along, across = values[0] - length * values[2], values[1] - length * values[3]
        p, q = along * cosine + across * sine, across * cosine - along * sine
        return np.column_stack(
            [zero_p + p * np.cos(turn) + q * np.sin(turn), zero_q + q * np.cos(turn) - p * np.sin(turn)]
        ).ravel()

    eye = np.eye(2 * m)
    scatter = ObservedScatter(np.zeros_like(eye), {"scatter of a spot": eye})
    if sheet.u_spot_mm is not None:
        scatter = ObservedScatter(sheet.u_spot_mm**2 * eye)
    solution = fit_curved(
        observed.ravel(),
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(
            active=np.repeat(readings.active, 2), together=np.repeat(np.arange(m), 2), reject=reject, level=sheet.level
        ),
    )
    return _calibration(readings, solution)


def effect(
    tilts: np.ndarray, beam_mm: np.ndarray, *, theta: np.ndarray, phi: float, distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Change of range (n,), m, and of both counts (n, 2), at a target.

    When the beam's middle meets the target.

    tilts      (3,), rad: face, beam x, beam y, as in `Imperfections`
    beam_mm    (2,), mm: beam x, beam y
    theta      (n,), rad, and phi, rad: the target's direction in mirror axes
    distance   m, from the scan point

    The path runs from the plane across the incoming beam through the scan point, as in
    `geometry.mirror.mirror_path.path_change`.

    >>> change, counts = effect(np.array([0.0, 1e-4, 0.0]), np.zeros(2), theta=np.zeros(1), phi=1.0, distance=100.0)
    >>> round(float(change[0] * 1e6), 6), counts.round(3).tolist()  # one count of elevation is 125.66 urad of the beam
    (-0.0, [[0.0, 0.796]])
    """
    imperfections = Imperfections(np.array([0.0, 0.0, *beam_mm]) * MILLIMETRE, tilts, NO_WAVES, NO_WAVES)
    station = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))
    u = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.full(len(theta), np.cos(phi))], axis=-1)
    target = distance * u @ gamma(0.0, 0.0, 0.0)
    counts = imperfect_counts(station, imperfections, target)
    ray = imperfect_ray(station, imperfections, counts)
    coming = -np.array([tilts[1], tilts[2], np.sqrt(1.0 - tilts[1] ** 2 - tilts[2] ** 2)]) @ gamma(0.0, 0.0, 0.0)
    path = ray.origin @ coming + np.sum((target - ray.origin) * ray.direction, axis=-1)
    ideal = aim(station, target)
    return path - distance, counts - np.stack([ideal.azimuth_counts, ideal.elevation_counts], axis=-1)


def _calibration(readings: SheetReadings, solution: CurvedFit) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    selection = [
        (f"beam {axis}", f"beam_{axis}_mm", "mm", f"laser beam from the azimuth axis at the mirror, along {axis}", 1.0)
        for axis in "xy"
    ] + [
        (f"tilt {axis}", f"beam_tilt_{axis}_rad", "rad", f"{axis} of the direction that the laser beam comes from", 1.0)
        for axis in "xy"
    ]  # fmt: skip
    calibrated, covariance = solution.quantities(selection)
    record: dict[str, RecordValue] = {q.key: q.value for q in calibrated}
    record["u_axis_mm"] = max(solution.u("beam x"), solution.u("beam y"))
    record["u_tilt_rad"] = max(solution.u("tilt x"), solution.u("tilt y"), sheet.u_face_tilt_rad)
    if sheet.u_face_tilt_rad > 0.0:
        record["face_tilt_rad"] = sheet.face_tilt_rad
    residual = fit.residual.reshape(-1, 2)
    rows = tuple(
        (readings.words["screen"][k], float(readings.get("path_m")[k]), float(readings.get("azimuth_counts")[k]),
         float(readings.get("p_mm")[k]), float(readings.get("q_mm")[k]), float(residual[k, 0]), float(residual[k, 1]),
         statistic, state)
        for k, (statistic, state) in enumerate(row_ends(fit, readings.left_out, 2))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"Laser beam of {sheet.instrument} against its azimuth axis",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("screen", "path_m", "azimuth_counts", "p_mm", "q_mm", "residual_p_mm",
                 "residual_q_mm", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            *_effects(sheet, solution),
            "a mirror's record has one u_axis_mm for four values and one u_tilt_rad for three; these are of the beam "
            "alone: keep the larger of them and the record's",
            *scatter_notes(fit, "mm", 1.0, sought=4),
        ),
        curve=_circles(readings, solution),
        axes=("p, from the screen's middle (mm)", "q, from the screen's middle (mm)"),
        method="Spots of the beam on screens that turn with the mount go round circles; their radius vectors at "
        "different distances along the unfolded beam give its place at the mirror and its tilt. Each screen's place "
        "is found too; its turn and its distance are parameters with priors.",
        record=record,
        equal_axes=True,
    )  # fmt: skip


def _effects(sheet: AlignmentSheet, solution: CurvedFit) -> list[str]:
    """Worst effects of beam and face on range and pointing, as texts."""
    theta = np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)
    tilts = np.array([sheet.face_tilt_rad, solution.value("tilt x"), solution.value("tilt y")])
    beam = np.array([solution.value("beam x"), solution.value("beam y")])
    effects = []
    for phi in sheet.effect_phi_deg:
        change, counts = effect(tilts, beam, theta=theta, phi=phi * DEGREE, distance=sheet.effect_distance_m)
        counts[:, 0] = np.remainder(counts[:, 0] + HALF_TURN, 2.0 * HALF_TURN) - HALF_TURN
        low, high = counts.min(axis=0), counts.max(axis=0)
        effects.append(
            f"at Phi = {phi:g} degrees and {sheet.effect_distance_m:g} m, round the azimuth, the range changes by "
            f"{1e6 * change.min():+.3f} to {1e6 * change.max():+.3f} µm, the azimuth counts by {low[0]:+.1f} to "
            f"{high[0]:+.1f}, the elevation counts by {low[1]:+.1f} to {high[1]:+.1f}"
        )
    return effects


def _circles(readings: SheetReadings, solution: CurvedFit) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Spots about the middle of their screens, and the circles."""
    names = list(dict.fromkeys(readings.words["screen"]))
    which = np.array([names.index(word) for word in readings.words["screen"]])
    middle = solution.values[4:].reshape(-1, 4)[which, :2]
    spot = np.column_stack([readings.get("p_mm"), readings.get("q_mm")]) - middle
    on = solution.fit.active.reshape(-1, 2).all(axis=1)
    turn, lines = np.linspace(0.0, 2.0 * np.pi, 181), []
    for k in range(len(names)):
        length = readings.get("path_m")[np.argmax(which == k)] / MILLIMETRE
        radius = np.hypot(*(solution.values[:2] - length * solution.values[2:4]))
        lines += [radius * np.column_stack([np.cos(turn), np.sin(turn)]), np.full((1, 2), np.nan)]
    line = np.concatenate(lines)
    return {
        "readings": (spot[on, 0], spot[on, 1]),
        "left out": (spot[~on, 0], spot[~on, 1]),
        "fit": (line[:, 0], line[:, 1]),
    }


RECIPE = CalibrationKind(
    "the laser beam against the azimuth axis, with its effect on range and pointing",
    LAYOUT,
    calibrate_alignment,
    plausible=Plausibility(
        scatter=ReadingScatter(0.1, "mm", 1.0, "the middle of a spot of some mm is read by eye to a tenth of one"),
        sizes={
            "beam_[xy]_mm": PlausibleSpan(-10.0, 10.0, "a beam further off leaves the mirror", u=1.0),
            "beam_tilt_[xy]_rad": PlausibleSpan(-0.05, 0.05, "a beam 3 degrees askew misses its mount"),
        },
    ),
)
