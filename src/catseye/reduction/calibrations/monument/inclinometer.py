"""Calibration of a dual-axis inclinometer on a tilt table or pier.

Scales, zeros, axis misalignments, cubic term and temperature.

`azimuth_deg` is how far the case is turned on the table, clockwise seen from above: axis x stands at the angle
a + misalignment of x from the table's x, axis y at a - 90° + misalignment of y (x right, y forward: counter-clockwise
of x), clockwise. The tilt of a direction is how far it rises above the horizon. With the table tilted by (p, q), what
was applied plus its own tilt, both up along the table's x and y,

    t_k   = p cos(c_k) - q sin(c_k)          the tilt along axis k, at the angle c_k clockwise of the table's x
    volts = zero_k + b_k (T - 20 °C) + s_k (t_k + cubic_k t_k³)

A tilt table with known tilts tells all of it. On a pier whose own tilt is unknown turning the case tells zeros, the
tilt of the pier and how square the axes are; the scale of both axes and the turn of both together are the sheet's.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import EstimationError, ValidityError
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import CalibrationFit, Effect, FitOptions, ObservedScatter, fit_readings
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    scatter_notes,
)
from catseye.reduction.calibrations.monument.frame_sheet import UAngle

KIND = "inclinometer"
REFERENCE_C = 20.0  # °C to which the zeros belong
ROUNDS, ENOUGH = 20, 1e-10  # relative change of the parameters at which the search ends
SQUARE = 0.5 * np.pi
UNLIKE = 1.5  # ratio of the scales of two axes of one make, which differ by some per cent
Scale = Annotated[float, Within(-1e5, 1e5)]


class InclinometerSheet(Sheet):
    """Sheet of an inclinometer.

    cubic                        the readings bend by a cubic term in each axis
    temperature_coefficient      the zeros move with the column temperature_c
    table_tilt                   the table or pier has a tilt of its own that is sought; the case must be turned then
    scale_x_volt_per_rad, scale_y_volt_per_rad, u_scale_percent   known beforehand: needed on a pier
    u_case_arcsec                turn of the case's mark against axis x: where no tilt was applied in a known direction
    u_tilt_arcsec                of each applied tilt by itself
    u_tilt_percent               of the table's scale, all tilts together
    u_volt                       of one reading of an axis, if known
    """

    cubic: bool = False
    temperature_coefficient: bool = False
    table_tilt: bool = False
    scale_x_volt_per_rad: Scale | None = None
    scale_y_volt_per_rad: Scale | None = None
    u_scale_percent: Annotated[float, Within(0, 50, above=True)] | None = None
    u_case_arcsec: UAngle | None = None
    u_tilt_arcsec: UAngle = 0.0
    u_tilt_percent: Annotated[float, Within(0, 50)] = 0.0
    u_volt: Annotated[float, Within(0, 10, above=True)] | None = None


VOLT, TILT = Within(-100, 100), Within(-36_000, 36_000)
LAYOUT = SheetLayout(
    KIND,
    InclinometerSheet,
    required={"x_volt": VOLT, "y_volt": VOLT},
    optional={
        "tilt_x_arcsec": TILT,
        "tilt_y_arcsec": TILT,
        "azimuth_deg": Within(-720, 720),
        "temperature_c": Within(-40, 60),
    },
)


@dataclass(frozen=True)
class Inclinometer:
    """Constants of both axes, x then y: (2,) each.

    zero          V, at 20 °C
    scale         V/rad
    misaligned    rad, clockwise seen from above, of the axis from where the case has it
    cubic         1/rad²
    per_degree    V/°C, of the zeros
    """

    zero: np.ndarray
    scale: np.ndarray
    misaligned: np.ndarray
    cubic: np.ndarray
    per_degree: np.ndarray

    def volts(self, tilts: ArrayLike, azimuth: ArrayLike = 0.0, temperature_c: ArrayLike = REFERENCE_C) -> np.ndarray:
        """Readings (..., 2), V.

        tilts           (..., 2), rad, of the table's x and y above the horizon
        azimuth         (...), rad, of the case on the table, clockwise
        temperature_c   (...)
        """
        p, q = np.moveaxis(np.asarray(tilts, dtype=float), -1, 0)[..., None]
        angle = np.asarray(azimuth, dtype=float)[..., None] + np.array([0.0, -SQUARE]) + self.misaligned
        along = p * np.cos(angle) - q * np.sin(angle)
        warm = (np.asarray(temperature_c, dtype=float) - REFERENCE_C)[..., None]
        return self.zero + self.per_degree * warm + self.scale * (along + self.cubic * along**3)

    def tilts(self, volts: ArrayLike, azimuth: ArrayLike = 0.0, temperature_c: ArrayLike = REFERENCE_C) -> np.ndarray:
        """Tilts (..., 2), rad, of the table's x and y above the horizon: the inverse of `volts`.

        volts           (..., 2), V
        azimuth         (...), rad, of the case on the table, clockwise
        temperature_c   (...)

        Raises ValidityError where the cubic term turns the curve round before the reading is reached.
        """
        warm = (np.asarray(temperature_c, dtype=float) - REFERENCE_C)[..., None]
        sought = (np.asarray(volts, dtype=float) - self.zero - self.per_degree * warm) / self.scale
        along = sought.copy()
        for _ in range(50):
            step = (along + self.cubic * along**3 - sought) / (1.0 + 3.0 * self.cubic * along**2)
            along = along - step
            if not np.any(np.abs(step) > 1e-15):
                break
        if not np.all(np.abs(step) <= 1e-12) or np.any(1.0 + 3.0 * self.cubic * along**2 <= 0.0):
            raise ValidityError("volts lie beyond where the cubic term bends the readings back: no tilt has them")
        angle = np.asarray(azimuth, dtype=float)[..., None] + np.array([0.0, -SQUARE]) + self.misaligned
        rows = np.stack([np.cos(angle), -np.sin(angle)], axis=-1)
        return np.linalg.solve(rows, along[..., None])[..., 0]


def calibrate_inclinometer(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Scales, zeros, misalignments, and optional terms.

    Optional: cubic terms, temperature coefficients and the table's own tilt.

    readings   columns x_volt, y_volt; tilt_x_arcsec, tilt_y_arcsec, azimuth_deg, temperature_c; InclinometerSheet
    reject     leave out what the tests reject, both axes of a reading together

    Raises InputError for a sheet that lacks a value, EstimationError where the readings do not determine every
    parameter.

    Source: [PARKER04] chapter 7 names the model (its reference 145); least squares, [FOERSTNER16] chapter 4.
    """
    axes = _AxisReadings(readings)
    at, active = axes.start(), readings.active
    for turn in range(ROUNDS):
        design, effects, predicted = axes.linear(at)
        fit = fit_readings(
            axes.observed - predicted + design @ at,
            design,
            axes.scatter(at),
            names=axes.names,
            effects=effects,
            options=FitOptions(
                active=np.tile(active, 2),
                together=np.tile(np.arange(len(readings)), 2),
                reject=reject and turn > 2,
                level=readings.sheet.level,
            ),
        )
        moved = np.abs(fit.x - at) / np.maximum(np.abs(fit.x), axes.sizes)
        at, active = fit.x, fit.active[: len(readings)]
        if turn > 2 and moved.max() < ENOUGH:
            return _calibration(axes, fit)
    raise EstimationError(
        f"the inclinometer's model did not settle in {ROUNDS} rounds; is the pier level, or the scale's sign wrong?"
    )


class _AxisReadings:
    """Readings of both axes, x above y, and the parameters.

    Parameters in order: zero, scale, misalignment of x, y; then cubic x, y; temperature coefficient x, y; tilt of the
    table x, y, as asked for. On a pier scales and the turn of the case have priors: they are parameters with an
    observation of themselves, below the readings' own rows through effects on x.
    """

    def __init__(self, readings: SheetReadings) -> None:
        sheet = readings.sheet
        self.readings, self.sheet, self.m = readings, sheet, len(readings)
        present = [name in readings.numbers for name in ("tilt_x_arcsec", "tilt_y_arcsec")]
        if present[0] != present[1]:
            raise refusal(readings.file, "line 1, expected both columns tilt_x_arcsec and tilt_y_arcsec, or none")
        self.pier = not present[0]
        if self.pier and not sheet.table_tilt:
            raise refusal(readings.sheet_file, "table_tilt is not true, and no tilt was applied (expected table_tilt = "
                                               "true on a pier)")  # fmt: skip
        if self.pier:
            for key in ("scale_x_volt_per_rad", "scale_y_volt_per_rad", "u_scale_percent", "u_case_arcsec"):
                if getattr(sheet, key) is None:
                    raise refusal(readings.sheet_file, f"{key} is missing (needed on a pier, where no tilt is applied)")
            if sheet.cubic:
                raise refusal(readings.sheet_file, "cubic = true, but one tilt shows no bend (expected a tilt table)")
        if sheet.table_tilt and "azimuth_deg" not in readings.numbers:
            raise refusal(readings.file, "line 1, column 'azimuth_deg' is missing (turning the case tells table_tilt)")
        tilts = [readings.get(f"tilt_{k}_arcsec") * ARCSECOND if present[0] else np.zeros(self.m) for k in "xy"]
        self.applied = np.column_stack(tilts)
        turned = "azimuth_deg" in readings.numbers
        self.azimuth = readings.get("azimuth_deg") * DEGREE if turned else np.zeros(self.m)
        self.temperature_c = (
            readings.get("temperature_c") if sheet.temperature_coefficient else np.full(self.m, REFERENCE_C)
        )
        self.observed = np.concatenate([readings.get("x_volt"), readings.get("y_volt")])
        self.names, sizes = [], []
        parts = [("zero", "V", 1e-3, True), ("scale", "V/rad", 1e-3, not self.pier)]
        parts += [("misalignment", "rad", 1e-6, not self.pier), ("cubic term", "1/rad²", 1e-3, sheet.cubic)]
        parts += [("temperature coefficient", "V/°C", 1e-6, sheet.temperature_coefficient)]
        parts += [("tilt of the table", "rad", 1e-8, sheet.table_tilt)]
        self.free = np.repeat([sought for *_, sought in parts], 2)
        for name, _, size, sought in parts:
            if sought:
                self.names += [f"{name} of {axis}" for axis in "xy"]
                sizes += [size, size]
        if self.pier:  # how square the axes are is all that turning tells of the misalignments
            self.free[5] = True
            self.names.insert(2, "misalignment of y")
            sizes.insert(2, 1e-6)
        self.sizes = np.array(sizes)

    def full(self, at: np.ndarray) -> np.ndarray:
        """All twelve constants, fixed ones by the sheet."""
        constants = np.zeros(12)
        if self.pier:
            constants[2:4] = self.sheet.scale_x_volt_per_rad, self.sheet.scale_y_volt_per_rad
        constants[self.free] = at
        return constants

    def predicted(self, constants: np.ndarray, scale: float = 0.0) -> np.ndarray:
        """Predicted readings (2 m,) V; applied tilts larger by `scale`."""
        model = _model(constants)
        return model.volts(self.applied * (1.0 + scale) + constants[10:], self.azimuth, self.temperature_c).T.ravel()

    def start(self) -> np.ndarray:
        """Start values: zeros by means, scales and misalignments by a plane."""
        constants = np.zeros(12)
        if self.pier:
            return self._pier_start()
        c, s = np.cos(self.azimuth), np.sin(self.azimuth)
        p, q = self.applied.T
        case = np.column_stack([p * c - q * s, p * s + q * c])  # the tilt along the case's x and y
        design = np.column_stack([np.ones(self.m), case])
        on = self.readings.active
        if np.linalg.matrix_rank(design[on]) < 3:
            raise EstimationError("the applied tilts lie in one direction of the case: tilt it along both axes")
        for k in range(2):
            values = self.observed[k * self.m : (k + 1) * self.m]
            zero, by_x, by_y = np.linalg.lstsq(design[on], values[on], rcond=None)[0]
            main, cross = (by_x, -by_y) if k == 0 else (by_y, by_x)
            constants[k], constants[2 + k] = zero, np.copysign(np.hypot(main, cross), main)
            constants[4 + k] = np.arctan(cross / main)
        return constants[self.free]

    def _pier_start(self) -> np.ndarray:
        constants = self.full(np.zeros(int(self.free.sum())))
        on = self.readings.active
        x = self.observed[: self.m][on]
        design = np.column_stack([np.ones(on.sum()), np.cos(self.azimuth[on]), -np.sin(self.azimuth[on])])
        if np.linalg.matrix_rank(design) < 3:
            raise EstimationError("the case stands in too few azimuths on the pier: turn it to three or more")
        constants[0], p, q = np.linalg.lstsq(design, x, rcond=None)[0]
        constants[1] = np.mean(self.observed[self.m :][on])
        constants[10:] = np.array([p, q]) / constants[2]
        return constants[self.free]

    def linear(self, at: np.ndarray) -> tuple[np.ndarray, list[Effect], np.ndarray]:
        """Design (2 m, p), effects, and prediction about the parameters.

        By central differences.
        """
        constants = self.full(at)

        def slope(k: int) -> np.ndarray:
            # Linear or smooth in each: steps of 1e-6 of the range leave 1e-10 of the slope.
            step = np.array([1.0, 1.0, 1.0, 1.0, 1e-4, 1e-4, 1.0, 1.0, 1e-3, 1e-3, 1e-5, 1e-5])[k]
            ends = [self.predicted(constants + sign * step * np.eye(12)[k]) for sign in (1.0, -1.0)]
            return (ends[0] - ends[1]) / (2.0 * step)

        design = np.column_stack([slope(int(k)) for k in np.flatnonzero(self.free)])
        effects = []
        if self.sheet.u_tilt_percent and not self.pier:
            by_scale = (self.predicted(constants, 1e-3) - self.predicted(constants, -1e-3)) / 2e-3
            effects.append(Effect("scale of the table", 0.01 * by_scale, self.sheet.u_tilt_percent, "%"))
        if self.pier:
            for k, axis in enumerate("xy"):
                share = 0.01 * constants[2 + k] * slope(2 + k)
                effects.append(Effect(f"scale of {axis}", share, self.sheet.u_scale_percent, "%"))
            by_turn = slope(4) + slope(5)
            effects.append(Effect("turn of the case", ARCSECOND * by_turn, self.sheet.u_case_arcsec, "arcsec"))
        return design, effects, self.predicted(constants)

    def scatter(self, at: np.ndarray) -> ObservedScatter:
        """Scatter of the readings, with that of the applied tilts.

        The tilts' is common to both axes of a reading.
        """
        constants, m, sheet = self.full(at), self.m, self.sheet
        claimed = np.zeros((2 * m, 2 * m))
        if sheet.u_tilt_arcsec and not self.pier:
            angle = self.azimuth[:, None] + np.array([0.0, -SQUARE]) + constants[4:6]
            rows = np.stack([np.cos(angle), -np.sin(angle)], axis=-1) * constants[2:4, None]  # (m, axis, tilt) V/rad
            pairs = np.einsum("mat,mbt->abm", rows, rows) * (sheet.u_tilt_arcsec * ARCSECOND) ** 2
            claimed = np.block([[np.diag(pairs[a, b]) for b in range(2)] for a in range(2)])
        if sheet.u_volt is not None:
            return ObservedScatter(claimed + sheet.u_volt**2 * np.eye(2 * m))
        return ObservedScatter(
            claimed, {"scatter of one reading": np.eye(2 * m)}, size=float(np.abs(self.observed).max())
        )


def _model(constants: np.ndarray) -> Inclinometer:
    return Inclinometer(constants[0:2], constants[2:4], constants[4:6], constants[6:8], constants[8:10])


MEANINGS = (
    ("zero_{}_volt", "V", "reading of axis {} when level, at 20 °C", 1.0),
    ("scale_{}_volt_per_rad", "V/rad", "slope of axis {}, above zero where its + end up reads more", 1.0),
    ("misalignment_{}_arcsec", "arcsec", "axis {} clockwise of where the case has it", ARCSECOND),
    ("cubic_{}_per_rad2", "1/rad²", "bend of axis {}: volts = scale (t + cubic t³)", 1.0),
    ("warmth_{}_volt_per_c", "V/°C", "zero of axis {} for each degree", 1.0),
    ("table_tilt_{}_arcsec", "arcsec", "own tilt of table or pier, its {} axis up", ARCSECOND),
)


def _calibration(axes: _AxisReadings, fit: CalibrationFit) -> Calibration:
    readings, sheet, m = axes.readings, axes.sheet, axes.m
    all_keys = [
        (key.format(axis), unit, meaning.format(axis), size) for key, unit, meaning, size in MEANINGS for axis in "xy"
    ]
    chosen = [all_keys[k] for k in np.flatnonzero(axes.free)]
    turn = np.diag([1.0 / size for *_, size in chosen])
    values, covariance = turn @ fit.x, turn @ fit.covariance @ turn.T
    calibrated = quantities([one[:3] for one in chosen], values, covariance, fit=fit, turn=turn)
    states = fit.state(readings.left_out * 2)
    optional = [name for name in LAYOUT.optional if name in readings.numbers]
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            *(float(readings.numbers[name][k]) for name in optional),
            float(axes.observed[k]),
            float(axes.observed[m + k]),
            float(fit.residual[k] * 1e3),
            float(fit.residual[m + k] * 1e3),
            float(fit.statistic[k]),
            float(fit.statistic[m + k]),
            states[k] if states[k] != "used" else states[m + k],
        )
        for k in range(m)
    )
    on = fit.active
    number = np.tile(np.arange(1, m + 1), 2)
    return Calibration(
        kind=KIND,
        title=f"Inclinometer {sheet.instrument} on a {'pier' if axes.pier else 'tilt table'}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=(*optional, "x_volt", "y_volt", "residual_x_mv", "residual_y_mv", f"x|{fit.test}", f"y|{fit.test}",
                 "state"),
        rows=rows,
        decisions=(*_alike(axes.full(fit.x)), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(*_notes(axes), *scatter_notes(fit, "mV", 1e-3)),
        curve={
            "readings": (number[on], fit.residual[on] * 1e3),
            "left out": (number[~on], fit.residual[~on] * 1e3),
            "fit": (np.arange(1, m + 1), np.zeros(m)),
        },
        axes=("reading, both axes", "residual (mV)"),
        method="Readings of both axes are adjusted to the tilts: zero and scale of each axis, their misalignments and, "
        "where asked, cubic terms, temperature coefficients and the table's own tilt. Tilts and scale of the table, "
        "and on a pier the scales and the turn of the case, are parameters with priors.",
        record={**{q.key: q.value for q in calibrated}, **{f"u_{q.key}": q.u for q in calibrated}},
    )  # fmt: skip


def _alike(constants: np.ndarray) -> tuple[CheckOutcome, ...]:
    """Check of the two axes' scales: they are of one make."""
    scale = np.abs(constants[2:4])
    ratio = float(scale.max() / scale.min()) if scale.min() > 0.0 else float("inf")
    text = "two axes of one make"
    if ratio > UNLIKE:
        text = (
            f"the axes' scales are {constants[2]:.4g} and {constants[3]:.4g} V/rad: a tilt or a voltage of another size"
        )
    return (CheckOutcome("larger scale over the smaller", ratio, UNLIKE, bool(ratio <= UNLIKE), text),)


def _notes(axes: _AxisReadings) -> tuple[str, ...]:
    if not axes.pier:
        return () if axes.sheet.table_tilt else (
            "the table's own tilt was not sought: it is part of the zeros",
        )  # fmt: skip
    return (
        f"scales are those of the sheet, u {axes.sheet.u_scale_percent:g} %: one tilt of the pier tells none",
        "misalignment_y is that against axis x: turning on a pier shows how square the axes are, no more",
    )


RECIPE = CalibrationKind(
    "scales, zeros and axes of a dual-axis inclinometer on a tilt table or a pier",
    LAYOUT,
    calibrate_inclinometer,
    plausible=Plausibility(
        scatter=ReadingScatter(5.0, "mV", 1e-3, "three seconds of arc at 400 V/rad [PARKER04] chapter 7"),
        sizes={
            "scale_?_volt_per_rad": PlausibleSpan(0.0, 1e5, "above zero where the axis' + end up reads more"),
            "misalignment_?_arcsec": PlausibleSpan(-36e3, 36e3, "an axis within 10 degrees of the case's mark"),
            "table_tilt_?_arcsec": PlausibleSpan(-36e3, 36e3, "a table within 10 degrees of level"),
        },
        columns={"temperature_c": PlausibleSpan(-30.0, 45.0, "air in which people read an inclinometer")},
    ),
)
