"""Plate levels: tilt of a Kelvin mount, alpha2 and alpha3.

By a precision level on a three-ball plate.

The plate lies on three equal balls in the mount. `orientation_deg` is where the level's + end points, clockwise seen
from above from the mount's x^: 0 along x^, 90 along z^ (the v-block), 180 along -x^. `reading_arcsec` is above zero
when the + end is high. With the tilts p of x^ and q of z^ above the level's horizon

    reading = zero + p cos(o) + q sin(o) + wedge of the plate    alpha2' = p, alpha3' = -q   (geometry/frames/plumb.py)

Turning the level by 180° takes out its zero; turning the plate too (`plate_deg`, where its mark points, counted like
the orientation) takes out its wedge. Unequal balls tilt the plate in the mount's own axes: nothing but other balls
shows it. The level knows the plumb line here; alpha2 and alpha3 stand against the ground frame's z, 3.9" away at 120 m.
"""

from typing import Annotated

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.geometry.frames.plumb import lean, mount_angles, plumb_from_ground
from catseye.geometry.mirror.mount import gamma
from catseye.records.files.readings import SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.fit import (
    CalibrationFit,
    Effect,
    FitOptions,
    ObservedScatter,
    fit_readings,
)
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    scatter_notes,
)
from catseye.reduction.calibrations.monument.frame_sheet import MonumentSheet, UAngle, frame_of

KIND = "plate-levels"
STEP = 0.1 * ARCSECOND  # of the derivatives by the deflection: a rotation, straight to 1e-12


class PlateSheet(MonumentSheet):
    """Sheet of plate levels.

    azimuth_deg            survey azimuth of the line fixed point to v-block, ground frame
    u_level_arcsec         of one reading, if known
    u_scale_percent        of the level: of every tilt that it reads
    u_wedge_arcsec         of the plate: its top against the plane of its three seats, each direction
    u_balls_arcsec         tilt of the plate by unequal balls and seats, about each of the mount's axes
    """

    azimuth_deg: Annotated[float, Within(-360, 360)]
    u_level_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    u_scale_percent: Annotated[float, Within(0, 50)]
    u_wedge_arcsec: UAngle
    u_balls_arcsec: UAngle


TURN = Within(-720, 720)
LAYOUT = SheetLayout(
    KIND,
    PlateSheet,
    required={"orientation_deg": TURN, "reading_arcsec": Within(-36_000, 36_000)},
    optional={"plate_deg": TURN},
)


def calibrate_plate(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Angles alpha2 and alpha3 of a mount, against the ground frame.

    readings   columns orientation_deg, reading_arcsec, perhaps plate_deg; sheet PlateSheet
    reject     leave out what the tests reject

    Raises EstimationError where the orientations do not tell both tilts from the level's zero.

    Source: [PARKER04] section 2.2.1, step 2; eq. 2.5; curvature and deflection as in geometry/frames/plumb.py.
    """
    sheet, m = readings.sheet, len(readings)
    observed = readings.get("reading_arcsec") * ARCSECOND
    turned = readings.get("orientation_deg") * DEGREE
    design = np.column_stack([np.cos(turned), np.sin(turned), np.ones(m)])
    effects = _effects(readings, turned)
    scatter = ObservedScatter(
        np.zeros((m, m)), {"scatter of one reading": np.eye(m)}, size=float(np.max(np.abs(observed)))
    )
    if sheet.u_level_arcsec is not None:
        scatter = ObservedScatter((sheet.u_level_arcsec * ARCSECOND) ** 2 * np.eye(m))

    def fitted(acting: list[Effect], active: np.ndarray, leave: bool) -> CalibrationFit:
        names = ["tilt of x^", "tilt of z^", "level's zero"]
        return fit_readings(
            observed,
            design,
            scatter,
            names=names,
            effects=acting,
            options=FitOptions(active=active, reject=leave, level=sheet.level),
        )

    first = fitted(effects, readings.active, reject)
    tilted = design[:, :2] @ first.x[:2]  # the scale acts on the tilts, which the first fit knows well enough
    scale = Effect("scale of the level", 0.01 * tilted, sheet.u_scale_percent, "%")
    return _calibration(readings, fitted([*effects, scale], first.active, False))


def _effects(readings: SheetReadings, turned: np.ndarray) -> list[Effect]:
    """Effects of the plate's wedge and of unequal balls.

    The wedge turns with the plate, the balls are fixed in the mount's axes.
    """
    sheet = readings.sheet
    plate = readings.get("plate_deg") * DEGREE if "plate_deg" in readings.numbers else np.zeros(len(readings))
    named = {"wedge of the plate": (turned - plate, sheet.u_wedge_arcsec), "balls": (turned, sheet.u_balls_arcsec)}
    return [
        Effect(f"{name}, {axis}", ARCSECOND * wave(angle), u, "arcsec")
        for name, (angle, u) in named.items()
        for axis, wave in (("along its mark" if "wedge" in name else "x^", np.cos),
                           ("square to it" if "wedge" in name else "z^", np.sin))
    ]  # fmt: skip


def _in_ground(sheet: PlateSheet, tilts: np.ndarray, *, xi: float = 0.0, eta: float = 0.0) -> np.ndarray:
    """Angles alpha2, alpha3 (rad) against the ground frame.

    From the tilts of x^ and z^ above the level's horizon.
    """
    place = np.array([sheet.x_mm, sheet.y_mm, sheet.z_mm]) * MILLIMETRE
    plumb = plumb_from_ground(frame_of(sheet, xi=xi, eta=eta), place)
    alpha2 = np.arcsin(tilts[0])
    alpha3 = -np.arcsin(tilts[1] / np.cos(alpha2))  # eq. 2.5: elements 13 and 33
    # The azimuth in the level's axes is a few seconds off that in the ground's: 1e-9 rad in the result.
    local = gamma(np.pi - sheet.azimuth_deg * DEGREE, alpha2, alpha3)
    return mount_angles(local @ plumb)[1:]


def _derived(sheet: PlateSheet, fit: CalibrationFit) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[SharedInput]]:
    """Values (3,), covariance, derivatives by the fit, and the deflection as inputs.

    alpha2, alpha3 (rad) and the level's zero (arcsec).
    """
    tilts = np.sin(fit.x[:2])
    turn = np.zeros((3, 3))
    turn[0, 0], turn[1, 1], turn[2, 2] = 1.0, -1.0, 1.0 / ARCSECOND  # tilts below 0.1 rad add as vectors to 1 %
    by_deflection = np.zeros((3, 2))
    for column, name in enumerate(("xi", "eta")):
        moved = [_in_ground(sheet, tilts, **{name: sign * STEP}) for sign in (1.0, -1.0)]
        by_deflection[:2, column] = (moved[0] - moved[1]) / (2.0 * STEP)
    u_deflection = sheet.u_deflection_arcsec * ARCSECOND
    inputs = [
        SharedInput(f"deflection of the plumb line, {name}", u_deflection, "rad", slopes)
        for name, slopes in zip(("xi", "eta"), by_deflection.T, strict=True)
    ]
    covariance = turn @ fit.covariance @ turn.T + sum(each.covariance for each in inputs)
    return np.array([*_in_ground(sheet, tilts), fit.x[2] / ARCSECOND]), covariance, turn, inputs


def _rows(readings: SheetReadings, fit: CalibrationFit) -> tuple[tuple[Cell, ...], ...]:
    """Table of orientations of level and plate, readings, residuals."""
    orientation, observed = readings.get("orientation_deg"), readings.get("reading_arcsec")
    return tuple(
        (
            float(orientation[k]),
            *((float(readings.get("plate_deg")[k]),) if "plate_deg" in readings.numbers else ()),
            float(observed[k]),
            float(fit.residual[k] / ARCSECOND),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )


def _calibration(readings: SheetReadings, fit: CalibrationFit) -> Calibration:
    sheet = readings.sheet
    values, covariance, turn, inputs = _derived(sheet, fit)
    keys = [
        ("alpha2_rad", "rad", "turn of the mount about z^, against the ground frame's z"),
        ("alpha3_rad", "rad", "turn of the mount about x^, against the ground frame's z"),
        ("level_zero_arcsec", "arcsec", "what the level reads on a level plate"),
    ]
    calibrated = quantities(keys, values, covariance, fit=fit, turn=turn, inputs=inputs)
    leans = lean(frame_of(sheet), np.array([sheet.x_mm, sheet.y_mm, sheet.z_mm]) * MILLIMETRE) / ARCSECOND
    local = np.array([fit.x[0], -fit.x[1]]) / ARCSECOND
    around = np.linspace(0.0, 360.0, 361)
    wave = np.column_stack([np.cos(around * DEGREE), np.sin(around * DEGREE), np.ones(361)]) @ fit.x
    on, where = fit.active, np.mod(readings.get("orientation_deg"), 360.0)
    cleared = (fit.predicted + fit.residual) / ARCSECOND  # wedge, balls and scale as adjusted are taken out
    return Calibration(
        kind=KIND,
        title=f"Plate levels of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("orientation_deg", *(("plate_deg",) if "plate_deg" in readings.numbers else ()), "reading_arcsec",
                 "residual_arcsec", fit.test, "state"),
        rows=_rows(readings, fit),
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"against the plumb line at the monument: alpha2 {local[0]:+.2f}\", alpha3 {local[1]:+.2f}\"",
            f"the plumb line there leans {leans[0]:+.2f}\" to the east and {leans[1]:+.2f}\" to the north of the "
            "ground frame's z, by the curvature of the earth and the deflection of the vertical; this is taken out",
            "the plate was not turned: its wedge is in u with u_wedge_arcsec" if "plate_deg" not in readings.numbers
            else "the plate was turned on its balls: its wedge is found from the readings",
            *scatter_notes(fit, "arcsec", ARCSECOND, sought=2),
        ),
        curve={
            "readings": (where[on], cleared[on]),
            "left out": (where[~on], cleared[~on]),
            "fit": (around, wave / ARCSECOND),
            "residuals": (where[on], fit.residual[on] / ARCSECOND),
        },
        axes=("level's + end, clockwise from x^ (degrees)", "reading less wedge (arcsec)"),
        method="A precision level on a plate on three balls in the Kelvin mount is read in several directions. The "
        "tilts of the mount's x and z axes and the level's zero are adjusted; wedge, balls and scale are parameters "
        "with priors. The tilts are turned from the plumb line at the monument to the z axis of the ground frame.",
        record={
            "alpha2_rad": float(values[0]),
            "alpha3_rad": float(values[1]),
            "u_alpha2_rad": float(np.sqrt(covariance[0, 0])),
            "u_alpha3_rad": float(np.sqrt(covariance[1, 1])),
        },
    )  # fmt: skip


RECIPE = CalibrationKind(
    "turns of a Kelvin mount about z^ and x^ by a level on a three-ball plate",
    LAYOUT,
    calibrate_plate,
    plausible=Plausibility(
        scatter=ReadingScatter(
            5.0, "arcsec", ARCSECOND, "a precision level has 2 to 4 arcsec a division [PARKER04] 2.2.1"
        ),
        sizes={"alpha?_rad": PlausibleSpan(-0.02, 0.02, "a mount within a degree of level", u=10.0 * ARCSECOND)},
        varying={"orientation_deg": 180.0},
    ),
)
