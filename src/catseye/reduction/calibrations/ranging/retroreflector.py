"""Retroreflector constants by exchange with a known one in the seat.

The seat stays, so L_u + Pc_u = L_r + Pc_r with the measured lengths L: the unknown constant is
Pc_u = Pc_r - (L_u - L_r). More glass makes the range longer and the constant more negative. The sequence A-B-A-B
separates the difference from a linear drift of ranger and air.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT, TWO_PI
from catseye.records.files.readings import TEXT, TIME, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD, Name, Uncertainty, Within
from catseye.records.files.refusal import refusal, shown
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import CalibrationFit, FitOptions, ObservedScatter, fit_readings
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    scatter_notes,
)
from catseye.reduction.calibrations.ranging.cyclic import cyclic_effects

KIND = "retroreflector"
READING, SEATING = "scatter of one reading", "scatter between seatings"


class RetroreflectorSheet(Sheet):
    """Sheet of a comparison of retroreflectors.

    reference                 name of the known retroreflector, as in the table
    pc_mm, u_pc_mm            its constant, negative or 0
    u_range_mm                of one range by itself, if known
    u_seating_mm              of putting a retroreflector into its seat, if known
    drift                     a line in time at each position is removed
    modulation_hz             frequency of the modulation
    u_cyclic_mm               of each cyclic term of orders 1 and 2: the two lengths stand at two phases
    """

    reference: Name
    pc_mm: Annotated[float, Within(-2000, 0)]
    u_pc_mm: Annotated[float, Within(0, 10)]
    u_range_mm: Uncertainty | None = None
    u_seating_mm: Uncertainty | None = None
    drift: bool = True
    modulation_hz: Annotated[float, Within(1e7, 1e11)] = 1500e6
    u_cyclic_mm: Annotated[float, Within(0, 1)]


LAYOUT = SheetLayout(
    KIND,
    RetroreflectorSheet,
    required={TIME: Within(EARLIEST_MJD, LATEST_MJD), "retroreflector": TEXT, "range_m": Within(0.05, 10_000)},
    optional={"position": TEXT, "u_range_mm": Within(0, 100, above=True)},
)


def calibrate_retroreflector(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Range constants of unknown retroreflectors against a known one.

    readings   columns mjd_utc, retroreflector, range_m (without any constant of a retroreflector), perhaps position
    reject     leave out what the tests reject

    Raises InputError where the known one is not among them, EstimationError where a drift looks like an offset.

    Source: [PARKER04] section 7.4 names the measurement; sign of the constant as eq. 5.19 and [GOLDMAN00] eq. 3.10.
    """
    sheet = readings.sheet
    names, on = readings.words["retroreflector"], readings.active
    measured = sorted({name for name, a in zip(names, on, strict=True) if a})
    if sheet.reference not in measured:
        raise refusal(
            readings.file, f"no reading of {shown(sheet.reference)}, the reference that {readings.sheet_file} names"
        )
    unknown = [name for name in measured if name != sheet.reference]
    if not unknown or "" in names:
        raise refusal(
            readings.file,
            f"column retroreflector holds {', '.join(map(shown, measured))} (expected an unknown one too)",
        )
    range_ = readings.get("range_m")
    phase = np.mod(-2.0 * TWO_PI * sheet.modulation_hz / SPEED_OF_LIGHT * range_, TWO_PI)
    fit = fit_readings(
        range_,
        _design(readings, unknown),
        _scatter(readings),
        names=_parameters(readings, unknown),
        effects=cyclic_effects(phase, sheet.u_cyclic_mm),
        options=FitOptions(active=on, reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, unknown)


def _positions(readings: SheetReadings) -> tuple[np.ndarray, list[str]]:
    """Position number of each reading, and the positions' names."""
    names_typed = readings.words.get("position", ("",) * len(readings))
    names = sorted(set(names_typed))
    return np.array([names.index(p) for p in names_typed]), names


def _parameters(readings: SheetReadings, unknown: list[str]) -> list[str]:
    _, names = _positions(readings)
    per = ["range", "drift"][: 1 + readings.sheet.drift]
    return [*unknown, *(f"{what} at position {name or 'of the seat'}" for name in names for what in per)]


def _design(readings: SheetReadings, unknown: list[str]) -> np.ndarray:
    """Design: one column per retroreflector, then level and drift.

    1 where it was read; drift in m/h of each position.
    """
    which, hours = np.array(readings.words["retroreflector"]), readings.hours()
    position, names = _positions(readings)
    columns = [(which == name).astype(float) for name in unknown]
    for k in range(len(names)):
        at_position = (position == k).astype(float)
        columns.append(at_position)
        if readings.sheet.drift:
            columns.append(at_position * (hours - hours[position == k].mean()))
    return np.column_stack(columns)


def _seatings(readings: SheetReadings) -> np.ndarray:
    """Seating number of each reading.

    Runs in time of one retroreflector at one position.
    """
    position, _ = _positions(readings)
    order = np.lexsort((readings.hours(), position))
    which = np.array(readings.words["retroreflector"])[order]
    changed = (which[1:] != which[:-1]) | (np.diff(position[order]) != 0)
    numbers = np.empty(len(readings), dtype=int)
    numbers[order] = np.concatenate([[0], np.cumsum(changed)])
    return numbers


def _scatter(readings: SheetReadings) -> ObservedScatter:
    """Scatter of each reading, and one shift a seating.

    Estimated where the sheet does not claim them.
    """
    m, sheet = len(readings), readings.sheet
    seating = _seatings(readings)
    same_seating = (seating[:, None] == seating).astype(float)
    claimed, unknown = np.zeros((m, m)), {}
    if readings.has("u_range_mm"):
        claimed += np.diag((readings.get("u_range_mm") * MILLIMETRE) ** 2)
    else:
        unknown[READING] = np.eye(m)
    if sheet.u_seating_mm is not None:
        claimed += (sheet.u_seating_mm * MILLIMETRE) ** 2 * same_seating
    elif np.count_nonzero(same_seating) > m or readings.has("u_range_mm"):
        unknown[SEATING] = same_seating
    return ObservedScatter(claimed, unknown)


def _rows(readings: SheetReadings, fit: CalibrationFit) -> tuple[tuple[Cell, ...], ...]:
    """Table of readings: time, position, range, residual."""
    hours, range_ = readings.hours(), readings.get("range_m")
    positions = readings.words.get("position", ("",) * len(readings))
    return tuple(
        (
            float(hours[k]),
            positions[k] or "-",
            readings.words["retroreflector"][k],
            float(range_[k]),
            float(fit.residual[k] / (1e-3 * MILLIMETRE)),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )


def _seatings_decision(readings: SheetReadings, count: int) -> CheckOutcome:
    """Check that each retroreflector was seated more than once.

    `count` unknown ones and the reference.
    """
    alternations = int(np.max(_seatings(readings))) + 1
    return CheckOutcome(
        "seatings",
        float(alternations),
        float(2 * (count + 1)),
        alternations >= 2 * (count + 1),
        "each retroreflector should be seated twice or more: a single one cannot show a bad seat",
        least=True,
    )


def _calibration(readings: SheetReadings, fit: CalibrationFit, unknown: list[str]) -> Calibration:
    sheet, micrometre, count = readings.sheet, 1e-3 * MILLIMETRE, len(unknown)
    difference = fit.x[:count] / MILLIMETRE
    values = sheet.pc_mm - difference
    reference = SharedInput(f"constant of the reference {sheet.reference}", sheet.u_pc_mm, "mm", np.ones(count))
    covariance = fit.covariance[:count, :count] / MILLIMETRE**2 + reference.covariance
    keys = [
        ("pc_mm" if count == 1 else f"pc_{name}_mm", "mm", f"range constant of {name}, added to the measured length")
        for name in unknown
    ]
    turn = np.eye(len(fit.x))[:count] / MILLIMETRE
    calibrated = quantities(keys, values, covariance, fit=fit, turn=turn, inputs=[reference])
    hours, on = readings.hours(), fit.active
    # What is drawn: each reading less the level of its position and the offset of its retroreflector; the drift stays.
    parameters = fit.x.copy()
    parameters[count + 1 :: 2] *= 0.0 if sheet.drift else 1.0
    line = (fit.predicted - _design(readings, unknown) @ parameters) / micrometre
    drawn = line + fit.residual / micrometre
    order = np.argsort(hours)
    drifts = fit.x[count + 1 :: 2] / micrometre if sheet.drift else np.zeros(0)
    scatter = np.sqrt(np.diag(fit.scattered)[:count]) / micrometre
    return Calibration(
        kind=KIND,
        title=f"Range constant of {', '.join(unknown)} against {sheet.reference}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("hours", "position", "retroreflector", "range_m", "residual_um", fit.test, "state"),
        rows=_rows(readings, fit),
        decisions=(_seatings_decision(readings, count), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            *(
                f"{name} reads {d:+.4f} mm against {sheet.reference}, u from the scatter alone {s:.2g} µm"
                for name, d, s in zip(unknown, difference, scatter, strict=True)
            ),
            *([f"drift removed: {', '.join(f'{d:+.3g}' for d in drifts)} µm/h"] if sheet.drift else []),
            *scatter_notes(fit, "µm", micrometre, sought=count),
        ),
        curve={
            "readings": (hours[on], drawn[on]),
            "left out": (hours[~on], drawn[~on]),
            "fit": (hours[order], line[order]),
            "residuals": (hours[on], fit.residual[on] / micrometre),
        },
        axes=("time (h)", "range less offset and level (µm)"),
        method="The retroreflectors take turns in the same seat. Their differences, the level and a line in time of "
        "each position are adjusted together, seatings and readings scattering as the sheet claims it or as the "
        "readings show it; the cyclic terms that the two lengths do not share are systematic effects with priors.",
        record={"pc_mm": calibrated[0].value, "u_pc_mm": calibrated[0].u}
        if count == 1
        else {name: {"pc_mm": q.value, "u_pc_mm": q.u} for name, q in zip(unknown, calibrated, strict=True)},
    )


RECIPE = CalibrationKind(
    "range constants of retroreflectors against a known one",
    LAYOUT,
    calibrate_retroreflector,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "µm", 1e-3 * MILLIMETRE, "3 mrad of phase, half a wavelength of 0.1 m"),
        sizes={
            "pc_*mm": PlausibleSpan(-2000.0, 0.0, "glass makes a range longer: below zero [GOLDMAN00] eq. 3.10", u=1.0)
        },
    ),
)
