"""Hydrostatic level: height differences along a run, and its constant.

Two vessels joined by a tube.

The vessels of a Pellissier H5 stand on two marks; each reading is how high the water stands above its vessel's foot.
Vessel v reads the water zero_v lower than it is above the foot. The water in both is one level surface, so that with
vessel 1 on the mark `from` and the constant C = zero_1 - zero_2

    height(to) - height(from) = reading_from - reading_to + C + density        vessel 1 on `from`; - C with vessel 2

Exchanging the vessels tells C. Where the tube hangs down by a depth d below the water at both ends, and the drop at
`to` is the warmer, its lighter water stands higher by d (rho_from / rho_to - 1): reading_to is too high, and that is
added, the density term. The level stretch of the tube does nothing. An open tube also feels the air: 0.1 mm for 1 Pa.
"""

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import MILLIMETRE, PPM
from catseye.errors import ValidityError
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.records.files.refusal import refusal, shown
from catseye.reduction.calibrations.calibration import Calibration, Cell, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
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

KIND = "hydrostatic-level"
CLOSURE_FACTOR = 3.0  # of its standard uncertainty, beyond which a loop is named
COLDEST, WARMEST = 0.0, 40.0  # °C where the formula for the density holds
WATER = Within(COLDEST, WARMEST)
ULength = Annotated[float, Within(0, 100)]  # mm


class LevelSheet(Sheet):
    """Sheet of a run with a hydrostatic level.

    held, held_height_mm, u_held_height_mm   the mark whose height is known, as it is called in the table
    constant_mm, u_constant_mm               the instrument's constant, where it is known beforehand
    depth_m                                  depth of the tube below the water at both ends; a column where it changed
    u_temperature_c                          of the difference between both vessels' thermometers, all readings together
    u_tube_c                                 of the difference between both drops of the tube, each set-up by itself
    u_scale_ppm                              of the micrometers
    u_reading_mm                             of a difference of two readings, if known
    """

    held: Annotated[str, "mark"]
    held_height_mm: Annotated[float, Within(-1e6, 1e7)] = 0.0
    u_held_height_mm: ULength = 0.0
    constant_mm: Annotated[float, Within(-100, 100)] | None = None
    u_constant_mm: ULength | None = None
    depth_m: Annotated[float, Within(0, 50)] | None = None
    u_temperature_c: Annotated[float, Within(0, 10)] = 0.0
    u_tube_c: Annotated[float, Within(0, 10)] = 0.0
    u_scale_ppm: Annotated[float, Within(0, 10_000)] = 0.0
    u_reading_mm: Uncertainty | None = None


READING = Within(-1000, 1000)
LAYOUT = SheetLayout(
    KIND,
    LevelSheet,
    required={
        "from": TEXT,
        "to": TEXT,
        "vessel_from": Within(1, 2),
        "reading_from_mm": READING,
        "reading_to_mm": READING,
    },
    optional={"temperature_from_c": WATER, "temperature_to_c": WATER, "depth_m": Within(0, 50)},
)


def water_density(temperature_c: ArrayLike) -> np.ndarray:
    """Density of clean air-free water at 1013.25 hPa, kg/m³.

    temperature_c   0 to 40; with antifreeze this is not the density

    Raises ValidityError outside.

    Source: [TANAKA01] eq. 1. Good to 0.001 kg/m³.

    >>> water_density([4.0, 20.0]).round(3).tolist()
    [999.975, 998.207]
    """
    t = np.asarray(temperature_c, dtype=float)
    if not np.all((t >= COLDEST) & (t <= WARMEST)):
        wrong = t[~((t >= COLDEST) & (t <= WARMEST))].flat[0]
        raise ValidityError(f"water at {wrong:g} °C is outside {COLDEST:g} to {WARMEST:g} °C, where [TANAKA01] holds")
    return 999.974950 * (1.0 - (t - 3.983035) ** 2 * (t + 301.797) / (522528.9 * (t + 69.34881)))


def calibrate_level(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Heights of marks from a run, the constant, and loop closures.

    readings   columns from, to, vessel_from, reading_from_mm, reading_to_mm, perhaps temperatures and depth_m
    reject     leave out what the tests reject

    Raises InputError for unconnected marks, EstimationError where vessels that were never exchanged leave the constant
    unknown.

    Source: [PARKER04] section 7.2.4 names instrument and constant (its references 116, 146); hydrostatics as above.
    """
    sheet, m = readings.sheet, len(readings)
    ends = [readings.words[name] for name in ("from", "to")]
    marks = tuple(dict.fromkeys((sheet.held, *(mark for pair in zip(*ends, strict=True) for mark in pair))))
    side = np.where(readings.get("vessel_from") == 1.0, 1.0, -1.0)
    _refuse(readings, ends, marks)
    climb = np.zeros((m, len(marks)))
    for row, (first, last) in enumerate(zip(*ends, strict=True)):
        climb[row, marks.index(first)] -= 1.0
        climb[row, marks.index(last)] += 1.0
    density, by_temperature = _density(readings)
    difference = (readings.get("reading_from_mm") - readings.get("reading_to_mm")) * MILLIMETRE
    observed = difference + density - climb[:, 0] * sheet.held_height_mm * MILLIMETRE
    # observed = climb of the others - side C
    design, names = climb[:, 1:], [f"height of {mark}" for mark in marks[1:]]
    effects = [
        Effect("thermometers", side * by_temperature, sheet.u_temperature_c, "°C"),
        Effect("micrometers", PPM * difference, sheet.u_scale_ppm, "ppm"),
        Effect("height of the held mark", climb[:, 0] * MILLIMETRE, sheet.u_held_height_mm, "mm"),
    ]
    if sheet.constant_mm is not None:
        if sheet.u_constant_mm is None:
            raise refusal(readings.sheet_file, "u_constant_mm is missing (expected a value beside constant_mm)")
        observed = observed + side * sheet.constant_mm * MILLIMETRE
        effects.append(Effect("constant of the instrument", -side * MILLIMETRE, sheet.u_constant_mm, "mm"))
    else:
        design, names = np.column_stack([design, -side]), [*names, "constant (exchange the vessels)"]
    claimed = np.diag((sheet.u_tube_c * by_temperature) ** 2)
    scatter = ObservedScatter(claimed, {"scatter of one difference": np.eye(m)}, size=float(np.max(np.abs(observed))))
    if sheet.u_reading_mm is not None:
        scatter = ObservedScatter(claimed + (sheet.u_reading_mm * MILLIMETRE) ** 2 * np.eye(m))
    fit = fit_readings(
        observed,
        design,
        scatter,
        names=names,
        effects=effects,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    loops = _loops(fit, design, effects, climb)
    return _calibration(readings, fit, marks, density, loops)


def _refuse(readings: SheetReadings, ends: list[tuple[str, ...]], marks: tuple[str, ...]) -> None:
    """Raise InputError for unnamed marks, null set-ups or unconnected parts.

    A null set-up goes from a mark to itself.
    """
    for row, (first, last) in enumerate(zip(*ends, strict=True)):
        if not first or not last:
            raise readings.refuse(row, f"{'from' if not first else 'to'} is empty (expected a word for the mark)")
        if first == last:
            raise readings.refuse(row, f"goes from {shown(first)} to itself (expected two marks)")
        if readings.get("vessel_from")[row] not in (1.0, 2.0):
            raise readings.refuse(row, f"vessel_from = {readings.get('vessel_from')[row]:g} (expected 1 or 2)")
    reached, active = {marks[0]}, readings.active
    for _ in marks:
        for first, last, on in zip(*ends, active, strict=True):
            if on and (first in reached or last in reached):
                reached |= {first, last}
    alone = [mark for mark in marks if mark not in reached]
    if alone:
        raise refusal(readings.file, f"{shown(alone[0])} does not hang together with held = {shown(marks[0])}")


def _density(readings: SheetReadings) -> tuple[np.ndarray, np.ndarray]:
    """Density correction, m, and its derivative by the temperature of `to`, m/°C.

    (m,), (m,).
    """
    zeros = np.zeros(len(readings))
    present = [name in readings.numbers for name in ("temperature_from_c", "temperature_to_c")]
    if present[0] != present[1]:
        raise refusal(readings.file, "line 1, expected both columns temperature_from_c and temperature_to_c, or none")
    if not present[0]:
        for key in ("u_temperature_c", "u_tube_c"):
            if getattr(readings.sheet, key) > 0.0:
                raise refusal(readings.sheet_file, f"{key} is given, but {readings.file} has no temperatures")
        return zeros, zeros
    first, last = (readings.get(f"temperature_{end}_c") for end in ("from", "to"))
    depth = readings.get("depth_m")

    def added(warmer: float) -> np.ndarray:
        return depth * (water_density(first) / water_density(np.clip(last + warmer, COLDEST, WARMEST)) - 1.0)

    step = 0.01
    low, high = np.maximum(last - step, COLDEST), np.minimum(last + step, WARMEST)
    return added(0.0), (added(step) - added(-step)) / (high - low)


def _loops(
    fit: CalibrationFit, design: np.ndarray, effects: list[Effect], climb: np.ndarray
) -> list[tuple[str, float, float]]:
    """Set-ups (by number) of each closed loop, misclosure and u, m.

    Residuals of all readings add up along a loop; the heights drop out, constant and effects are as adjusted. Loops are
    those that each set-up beyond a spanning tree closes.
    """
    on = np.flatnonzero(fit.active)
    shared = sum((e.u**2 * np.outer(e.column[on], e.column[on]) for e in effects), np.zeros((len(on), len(on))))
    total = np.diag(fit.sigma[on] ** 2) + shared
    off = (fit.residual + _acted(fit, effects))[on]
    least = design[on]
    residual_covariance = total - least @ np.linalg.solve(least.T @ np.linalg.solve(total, least), least.T)
    loops: list[tuple[str, float, float]] = []
    tree: list[int] = []
    for k, row in enumerate(on):
        if not tree or np.linalg.matrix_rank(climb[on[[*tree, k]]]) > len(tree):
            tree.append(k)
            continue
        signs = np.linalg.lstsq(climb[on[tree]].T, climb[row], rcond=None)[0].round()
        loop = np.zeros(len(on))
        loop[k], loop[tree] = 1.0, -signs
        u = float(np.sqrt(max(loop @ residual_covariance @ loop, 0.0)))
        members = ", ".join(str(on[j] + 1) for j in np.flatnonzero(loop))
        loops.append((members, float(loop @ off), u))
    return loops


def _acted(fit: CalibrationFit, effects: list[Effect]) -> np.ndarray:
    """Estimated contribution of the effects to each reading, m.

    Residuals are without it.
    """
    parts = (e.column * fit.effects[e.name][0] for e in effects if e.u > 0.0)
    return sum(parts, np.zeros(len(fit.residual)))


def _constant_note(readings: SheetReadings, fit: CalibrationFit) -> str:
    """Note on the source of the constant.

    And the readings' change of one that the sheet states.
    """
    sheet = readings.sheet
    if sheet.constant_mm is None:
        return "the constant was found by exchanging the vessels"
    value, u = fit.effects.get("constant of the instrument, mm", (0.0, 0.0))
    return (
        f"the constant is the sheet's, {sheet.constant_mm:g} mm; these readings move it by {value:+.4f} mm, "
        f"u {u:.4f} mm"
    )


def _loops_decision(loops: list[tuple[str, float, float]]) -> CheckOutcome:
    """Check of the loop with the largest misclosure over u.

    Against three of that.
    """
    worst = max(loops, key=lambda loop: abs(loop[1]) / max(loop[2], 1e-12), default=None)
    if worst is None:
        return CheckOutcome("loops: misclosure, mm", float("nan"), float("nan"), None, "the run closes no loop")
    return CheckOutcome(
        f"loops: misclosure of {len(loops)}, size of the worst, mm",
        abs(worst[1]) / MILLIMETRE,
        CLOSURE_FACTOR * worst[2] / MILLIMETRE,
        bool(abs(worst[1]) <= CLOSURE_FACTOR * worst[2]),
        f"set-ups {worst[0]}; limit three standard uncertainties",
    )


def _rows(readings: SheetReadings, fit: CalibrationFit, density: np.ndarray) -> tuple[tuple[Cell, ...], ...]:
    """Table of set-ups: reading, density correction (m) in micrometres, residual."""
    micro = 1e-3 * MILLIMETRE
    return tuple(
        (
            *(readings.words[end][k] for end in ("from", "to")),
            int(readings.get("vessel_from")[k]),
            *(float(readings.get(name)[k]) for name in ("reading_from_mm", "reading_to_mm")),
            float(density[k] / micro),
            float(fit.residual[k] / micro),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )


def _calibration(
    readings: SheetReadings,
    fit: CalibrationFit,
    marks: tuple[str, ...],
    density: np.ndarray,
    loops: list[tuple[str, float, float]],
) -> Calibration:
    sheet = readings.sheet
    values, covariance = fit.x / MILLIMETRE, fit.covariance / MILLIMETRE**2
    keys = [(f"height_{mark}_mm", "mm", f"height of {mark} along the plumb line") for mark in marks[1:]]
    constant = sheet.constant_mm is None
    if constant:
        keys.append(("constant_mm", "mm", "zero of vessel 1 less that of vessel 2, added with vessel 1 on `from`"))
    calibrated = quantities(keys, values, covariance, fit=fit, turn=np.eye(len(values)) / MILLIMETRE)
    micro = 1e-3 * MILLIMETRE
    on, number = fit.active, np.arange(1, len(readings) + 1)
    record: dict[str, RecordValue] = {
        "marks": list(marks),
        "heights_mm": [sheet.held_height_mm, *(q.value for q in calibrated[: len(marks) - 1])],
        "u_heights_mm": [sheet.u_held_height_mm, *(q.u for q in calibrated[: len(marks) - 1])],
    }
    if constant:
        record |= {"constant_mm": calibrated[-1].value, "u_constant_mm": calibrated[-1].u}
    return Calibration(
        kind=KIND,
        title=f"Run with hydrostatic level {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("from", "to", "vessel_from", "reading_from_mm", "reading_to_mm", "density_um", "residual_um",
                 fit.test, "state"),
        rows=_rows(readings, fit, density),
        decisions=(_loops_decision(loops), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            _constant_note(readings, fit),
            "heights are along the plumb line (NAVD88 where the held mark is); z of the ground frame falls below them "
            "by the curvature of the earth, 1.1 mm at 120 m, and the deflection: "
            "geometry/frames/local_frame.py turns them",
            *(f"loop of set-ups {names}: {w / micro:+.1f} um, u {u / micro:.1f} um" for names, w, u in loops),
            *scatter_notes(fit, "µm", micro),
        ),
        curve={
            "readings": (number[on], fit.residual[on] / micro),
            "left out": (number[~on], fit.residual[~on] / micro),
            "fit": (number, np.zeros(len(number))),
        },
        axes=("set-up", "residual (µm)"),
        method="Both vessels are read on two marks at a time; readings of all set-ups are adjusted to heights of the "
        "marks and the instrument's constant, which exchanging the vessels shows. Drops of the tube at different "
        "temperatures are corrected by the density of water. Thermometers, micrometers, the held height and a constant "
        "known beforehand are parameters with priors.",
        record=record,
    )  # fmt: skip


RECIPE = CalibrationKind(
    "heights of marks and the instrument's constant by a hydrostatic level",
    LAYOUT,
    calibrate_level,
    plausible=Plausibility(
        scatter=ReadingScatter(
            50.0, "µm", 1e-3 * MILLIMETRE, "micrometers touch water to some µm; 0.1 mm is 1 Pa of air"
        ),
        sizes={
            "height_*_mm": PlausibleSpan(-1e6, 1e6, "a height above any datum, by water that tells 0.05 mm", u=0.5),
            "constant_mm": PlausibleSpan(-100.0, 100.0, "two vessels of one make"),
        },
    ),
)
