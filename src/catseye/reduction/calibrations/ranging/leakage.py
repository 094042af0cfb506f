"""Leakage from buffers with the beam blocked.

In several sessions over a day.

Each buffer's phasor is the leakage, plus what the session shifts it, plus the buffer's own noise, alike in both
quadratures. The mean is known better with every session; the leakage of a session to come is not, and that is what the
ranger's record needs.
"""

from typing import Annotated

import numpy as np

from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import SCATTER_LIMIT, CalibrationFit, FitOptions, ObservedScatter, fit_readings
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    scatter_notes,
)
from catseye.reduction.calibrations.ranging.phasors import COLUMNS, MILLIVOLT, leakage_record, phasors, polar_quantities

KIND = "leakage"
BUFFER, SESSION = "scatter of one buffer", "scatter between sessions"
FEWEST_SESSIONS = 5  # with fewer a scatter between sessions that comes out as zero means little
Volts = Annotated[float, Within(0, 1, above=True)]


class LeakageSheet(Sheet):
    """Sheet of a calibration of the leakage with the beam blocked.

    u_volt           of each quadrature of one buffer, if known; a column u_volt where buffers differ
    u_session_volt   of the leakage of one session, each quadrature; needed only where there is one session alone
    """

    u_volt: Volts | None = None
    u_session_volt: Volts | None = None


LAYOUT = SheetLayout(KIND, LeakageSheet, required={}, optional={"session": TEXT, **COLUMNS})


def calibrate_leakage(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Leakage phasor, its u, and that of the leakage in a future session.

    readings   columns real_volt, imaginary_volt (or amplitude_volt, phase_rad) and session; sheet LeakageSheet
    reject     leave out what the tests reject

    Source: [PARKER04] sec. 5.2.1 names the effect; variance components within and between sessions by [PATTERSON71].
    """
    sheet, z = readings.sheet, phasors(readings)
    m = len(z)
    names = readings.words.get("session", ("1",) * m)
    on = readings.active
    sessions = sorted({name for name, a in zip(names, on, strict=True) if a})
    fit = fit_readings(
        np.concatenate([z.real, z.imag]),
        np.kron(np.eye(2), np.ones((m, 1))),
        _scatter(readings, names, len(sessions)),
        names=["real part", "imaginary part"],
        options=FitOptions(active=np.tile(on, 2), together=np.tile(np.arange(m), 2), reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, z, names, len(sessions))


def _scatter(readings: SheetReadings, names: tuple[str, ...], sessions: int) -> ObservedScatter:
    """Scatter of each buffer, and one shift a session.

    Real parts, then imaginary parts.
    """
    m, sheet = len(readings), readings.sheet
    same_session = np.kron(np.eye(2), np.array(names)[:, None] == np.array(names)).astype(float)
    claimed, unknown = np.zeros((2 * m, 2 * m)), {}
    if readings.has("u_volt"):
        claimed += np.diag(np.tile(readings.get("u_volt"), 2) ** 2)
    else:
        unknown[BUFFER] = np.eye(2 * m)
    if sheet.u_session_volt is not None:
        claimed += sheet.u_session_volt**2 * same_session
    elif sessions > 1:
        unknown[SESSION] = same_session
    return ObservedScatter(claimed, unknown)


def _quadratures_decision(fit: CalibrationFit, z: np.ndarray, names: tuple[str, ...]) -> CheckOutcome:
    """Check that both quadratures scatter alike within sessions.

    A channel of other gain, or a changed column, fails.

    Source: [FOERSTNER16] chapter 4 (Fisher's test of two variances), both sides, at the kind's share of the level.
    """
    from scipy.stats import f as fisher

    on, name = fit.active[: len(z)], "quadratures: ratio of their scatters"
    used_phasors, groups = z[on], np.array(names)[on]
    inner = used_phasors - np.array([used_phasors[groups == one].mean() for one in groups])
    degrees = len(used_phasors) - len(set(groups))
    squares = np.array([np.sum(inner.real**2), np.sum(inner.imag**2)])
    if degrees < 1 or not squares.all():
        return CheckOutcome(name, float("nan"), float("nan"), None, "too few buffers in a session to compare them")
    ratio, limit = float(squares.max() / squares.min()), float(fisher.isf(0.5 * SCATTER_LIMIT, degrees, degrees))
    larger = ("the real part", "the imaginary part")[int(np.argmax(squares))]
    text = "both quadratures scatter alike"
    if ratio > limit:
        text = (
            f"{larger} scatters {np.sqrt(ratio):.2f} times as much as the other: gains out of balance, or a "
            "column that is not in volts"
        )
    return CheckOutcome(name, float(np.sqrt(ratio)), float(np.sqrt(limit)), bool(ratio <= limit), text)


def _sessions_decision(sheet: LeakageSheet, sessions: int) -> CheckOutcome:
    """Check that the sessions determine the leakage's variation."""
    name = "sessions"
    if sheet.u_session_volt is not None:
        return CheckOutcome(name, float(sessions), float("nan"), None, "the sheet states how sessions differ")
    enough = sessions >= FEWEST_SESSIONS
    text = "they tell how the leakage differs from one to the next"
    if not enough:
        text = (
            "too few to tell how the leakage differs from one to the next: u_leakage_volt may be far too small; "
            "measure more, or state u_session_volt"
        )
    return CheckOutcome(name, float(sessions), float(FEWEST_SESSIONS), enough, text, least=True)


def _rows(
    readings: SheetReadings, fit: CalibrationFit, z: np.ndarray, names: tuple[str, ...]
) -> tuple[tuple[Cell, ...], ...]:
    """Table of buffers: phasor and residual in mV.

    Statistic and state are those of the worse quadrature.
    """
    m = len(z)
    residual = z - complex(*fit.x)
    statistic = np.abs(fit.statistic).reshape(2, m).max(axis=0)
    states = fit.state((*readings.left_out, *readings.left_out))
    worst = [b if b == "suspect" else a for a, b in zip(states[:m], states[m:], strict=True)]
    return tuple(
        (
            readings.where[k],
            names[k],
            float(z[k].real / MILLIVOLT),
            float(z[k].imag / MILLIVOLT),
            float(residual[k].real / MILLIVOLT),
            float(residual[k].imag / MILLIVOLT),
            float(statistic[k]),
            worst[k],
        )
        for k in range(m)
    )


def _calibration(
    readings: SheetReadings, fit: CalibrationFit, z: np.ndarray, names: tuple[str, ...], sessions: int
) -> Calibration:
    sheet = readings.sheet
    leakage = complex(*fit.x)
    calibrated, polar = polar_quantities(leakage, fit.covariance, fit)
    between = sheet.u_session_volt if sheet.u_session_volt is not None else fit.components.get(SESSION, 0.0)
    u_mean = float(np.sqrt(0.5 * np.trace(fit.covariance)))
    to_come = float(np.hypot(u_mean, between))
    on = fit.active[: len(z)]
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = leakage + 2.0 * to_come * np.exp(1j * turn)
    notes = [
        f"{int(on.sum())} buffers of {sessions} {'session' if sessions == 1 else 'sessions'}; the mean is known to "
        f"{u_mean / MILLIVOLT:.3g} mV in each quadrature",
        f"u_leakage_volt of the record is {to_come / MILLIVOLT:.3g} mV: of the leakage of a session to come, that of "
        f"the mean and {between / MILLIVOLT:.3g} mV between sessions together",
    ]
    if sessions == 1 and sheet.u_session_volt is None:
        notes.append("one session says nothing of other days: measure others, or state u_session_volt")
    return Calibration(
        kind=KIND,
        title=f"Leakage of {sheet.instrument}, beam blocked",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=polar,
        columns=(
            "reading",
            "session",
            "real_mv",
            "imaginary_mv",
            "residual_real_mv",
            "residual_imaginary_mv",
            f"largest |{fit.test}|",
            "state",
        ),
        rows=_rows(readings, fit, z, names),
        decisions=(
            _sessions_decision(sheet, sessions),
            _quadratures_decision(fit, z, names),
            *fit.decisions(),
        ),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(*notes, *scatter_notes(fit, "mV", MILLIVOLT)),
        curve={
            "readings": (z[on].real / MILLIVOLT, z[on].imag / MILLIVOLT),
            "left out": (z[~on].real / MILLIVOLT, z[~on].imag / MILLIVOLT),
            "fit": (circle.real / MILLIVOLT, circle.imag / MILLIVOLT),
        },
        axes=("real part (mV)", "imaginary part (mV)"),
        method="With the beam blocked the detected phasor is the leakage. Its mean over buffers and sessions is "
        "adjusted, alike in both quadratures, with the scatter of buffers and between sessions as the sheet claims it "
        "or as the readings show it. The circle of the figure holds two standard uncertainties of the leakage of a "
        "session to come.",
        record=leakage_record(calibrated, to_come),
        equal_axes=True,
    )


RECIPE = CalibrationKind(
    "leakage from buffers with the beam blocked",
    LAYOUT,
    calibrate_leakage,
    plausible=Plausibility(
        scatter=ReadingScatter(5.0, "mV", MILLIVOLT, "a thousandth of a full return of 5 V"),
        sizes={"leakage_amplitude_volt": PlausibleSpan(0.0, 0.5, "a tenth of a full return of 5 V", u=0.05)},
    ),
)
