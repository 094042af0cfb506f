"""Leakage by a retroreflector moved along a rail.

Its phasors lie on a circle about the leakage.

Where the positions are known (column distance_m) each phasor is leakage + (g + h (D - mean)) exp(-2 pi i D / half):
linear in three complex numbers, and a return that fades along the rail does no harm. Where they are not, the phasors
are taken to lie on a circle, which needs a constant amplitude.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
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
from catseye.signal.systematics.leakage import circle_leakage

KIND = "leakage-lit"
SCATTER = "scatter of one quadrature"
ROUNDS = 20
FEWEST_OF_ELLIPSE = 10  # phasors; five terms are fitted, as many remain
SHORTEST_ARC = 0.5 * np.pi  # rad; with a shorter one small biases make centre and radius inseparable


class LitLeakageSheet(Sheet):
    """Sheet of a calibration of the leakage with a moving retroreflector.

    u_volt           of each quadrature of one phasor, if known
    modulation_hz    frequency of the modulation
    group_index      group index of the air; needed for the column distance_m
    u_session_volt   of the leakage from session to session, each quadrature
    """

    u_volt: Annotated[float, Within(0, 1, above=True)] | None = None
    modulation_hz: Annotated[float, Within(1e7, 1e11)] = 1500e6
    group_index: Annotated[float, Within(1, 1.001)] | None = None
    u_session_volt: Annotated[float, Within(0, 1)]


LAYOUT = SheetLayout(KIND, LitLeakageSheet, required={}, optional={"distance_m": Within(0.05, 10_000), **COLUMNS})


def calibrate_lit_leakage(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Leakage as the centre of a moving retroreflector's phasors.

    readings   columns real_volt, imaginary_volt (or amplitude_volt, phase_rad), perhaps distance_m; LitLeakageSheet
    reject     leave out what the tests reject

    Raises EstimationError where the phasors cover too little of the circle.

    Source: [PARKER04] sec. 5.2.1 names the effect; derived in the module.
    """
    z = phasors(readings)
    fit, m = (_along(readings, z, reject), len(z)) if "distance_m" in readings.numbers else (None, len(z))
    if fit is not None:
        return _calibration(readings, fit, z, np.abs(fit.statistic).reshape(2, m).max(axis=0), has_positions=True)
    fit = _circle(readings, z, reject)
    return _calibration(readings, fit, z, fit.statistic, has_positions=False)


def _along(readings: SheetReadings, z: np.ndarray, reject: bool) -> CalibrationFit:
    """Fit with known positions.

    Real and imaginary parts are linear in leakage, light and its fading.
    """
    sheet, distance = readings.sheet, readings.get("distance_m")
    if sheet.group_index is None:
        raise refusal(readings.sheet_file, "group_index is missing (needed for the column distance_m)")
    half = 0.5 * SPEED_OF_LIGHT / (sheet.group_index * sheet.modulation_hz)
    turn = np.exp(-1j * TWO_PI * distance / half)
    columns = [np.ones_like(turn), turn]
    names = ["leakage", "light"]
    if len(z) >= 8:
        columns.append(turn * (distance - distance.mean()))
        names.append("fading")
    # (a + ib)(x + iy): the real part is a x - b y, the imaginary part b x + a y.
    design = (
        np.concatenate([np.stack([c.real, -c.imag], axis=1) for c in columns], axis=1),
        np.concatenate([np.stack([c.imag, c.real], axis=1) for c in columns], axis=1),
    )
    m = len(z)
    return fit_readings(
        np.concatenate([z.real, z.imag]),
        np.concatenate(design),
        _scatter(readings, 2),
        names=[f"{part} part of the {name}" for name in names for part in ("real", "imaginary")],
        options=FitOptions(
            active=np.tile(readings.active, 2), together=np.tile(np.arange(m), 2), reject=reject, level=sheet.level
        ),
    )


def _circle(readings: SheetReadings, z: np.ndarray, reject: bool) -> CalibrationFit:
    """Fit with unknown positions: distances from a circle, linearised."""
    on = readings.active
    centre = circle_leakage(z[on])
    point = np.array([centre.real, centre.imag, float(np.mean(np.abs(z[on] - centre)))])
    scatter = _scatter(readings, 1)
    for _ in range(ROUNDS):
        arm = z - complex(point[0], point[1])
        away = np.abs(arm)
        design = np.stack([arm.real / away, arm.imag / away, np.ones(len(z))], axis=1)
        fit = fit_readings(
            away - point[2],
            design,
            scatter,
            names=["real part of the leakage", "imaginary part of the leakage", "amplitude of the light"],
            options=FitOptions(active=on, reject=reject, level=readings.sheet.level),
        )
        point = point + fit.x
        on = fit.active
        if np.max(np.abs(fit.x)) < 1e-12 * point[2]:
            break
    return replace(fit, x=point)


def _scatter(readings: SheetReadings, quadratures: int) -> ObservedScatter:
    m = len(readings)
    if readings.has("u_volt"):
        return ObservedScatter(np.diag(np.tile(readings.get("u_volt"), quadratures) ** 2))
    return ObservedScatter(np.zeros((quadratures * m,) * 2), {SCATTER: np.eye(quadratures * m)})


def _explained(fit: CalibrationFit, z: np.ndarray) -> float:
    """Share of the phasors' variance explained by the turning light.

    About their mean.
    """
    on = fit.active[: len(z)]
    total = float(np.sum(np.abs(z[on] - z[on].mean()) ** 2))
    return 1.0 - float(np.sum(fit.residual[fit.active] ** 2)) / total if total > 0.0 else 0.0


def _arc(arm: np.ndarray) -> float:
    """Arc covered by the phasors, rad: a turn minus the largest gap."""
    angle = np.sort(np.mod(np.angle(arm), TWO_PI))
    gaps = np.diff(np.append(angle, angle[0] + TWO_PI))
    return float(TWO_PI - gaps.max())


def _balance(fit: CalibrationFit, z: np.ndarray, leakage: complex) -> CheckOutcome:
    """Test of an ellipse against a circle.

    Quadratures of unequal gain or angle make an ellipse.

    An ellipse of half axes r (1 + e) and r (1 - e) stands r e cos 2(t - t_0) off its circle, t the angle about the
    centre; the pair of terms is tested by Fisher's F.

    Source: [FOERSTNER16] chapter 4 (test of a group of parameters), at the kind's share of the level.
    """
    from scipy.stats import f as fisher

    name, m = "ellipse: half axes' difference over their sum", len(z)
    on = fit.active[:m]
    arm = (z - leakage)[on]
    if len(arm) < FEWEST_OF_ELLIPSE:
        return CheckOutcome(name, float("nan"), float("nan"), None, "too few phasors to tell a circle from an ellipse")
    direction = arm / np.abs(arm)
    residual = fit.residual[:m][on]
    off = np.real((residual + 1j * fit.residual[m:][on]) * np.conj(direction)) if len(fit.residual) > m else residual
    twice = np.column_stack(
        [np.ones(len(arm)), direction.real, direction.imag, (direction**2).real, (direction**2).imag]
    )
    terms = np.linalg.lstsq(twice, off, rcond=None)[0]
    residual_squares, degrees = float(np.sum((off - twice @ terms) ** 2)), len(arm) - twice.shape[1]
    of_two = np.linalg.inv(twice.T @ twice)[3:, 3:]
    squares = float(terms[3:] @ np.linalg.solve(of_two, terms[3:])) / 2.0
    limit = float(fisher.isf(SCATTER_LIMIT, 2, degrees))
    radius = float(np.mean(np.abs(arm)))
    share = float(np.hypot(*terms[3:])) / radius
    most = share * np.sqrt(limit * max(residual_squares, 1e-300) / degrees / max(squares, 1e-300))
    text = "the phasors lie on a circle"
    if share > most:
        text = (
            f"the phasors lie on an ellipse of axes 1 : {(1.0 - share) / (1.0 + share):.4f}: the quadratures are "
            "out of balance (gain, or angle between them)"
        )
    return CheckOutcome(name, share, float(most), bool(share <= most), text, grave=False)


def _rows(
    readings: SheetReadings, fit: CalibrationFit, z: np.ndarray, statistic: np.ndarray, *, has_positions: bool
) -> tuple[tuple[Cell, ...], ...]:
    """Table of readings: phasor and residual in mV, statistic and state.

    With known positions of the worse quadrature.
    """
    m = len(z)
    states = fit.state(readings.left_out * (2 if has_positions else 1))
    states = tuple(b if b == "suspect" else a for a, b in zip(states[:m], states[-m:], strict=True))
    residual = np.hypot(fit.residual[:m], fit.residual[m:]) if has_positions else fit.residual
    return tuple(
        (
            readings.where[k],
            float(z[k].real / MILLIVOLT),
            float(z[k].imag / MILLIVOLT),
            float(residual[k] / MILLIVOLT),
            float(statistic[k]),
            states[k],
        )
        for k in range(m)
    )


def _calibration(
    readings: SheetReadings, fit: CalibrationFit, z: np.ndarray, statistic: np.ndarray, *, has_positions: bool
) -> Calibration:
    sheet = readings.sheet
    leakage = complex(fit.x[0], fit.x[1])
    centre = fit.covariance[:2, :2]
    calibrated, polar = polar_quantities(leakage, centre, fit)
    u_centre = float(np.sqrt(0.5 * np.trace(centre)))
    to_come = float(np.hypot(u_centre, sheet.u_session_volt))
    on = fit.active[: len(z)]
    arc = _arc((z - leakage)[on])
    radius = float(np.median(np.abs(z - leakage)[on]))
    ring = leakage + radius * np.exp(1j * np.linspace(0.0, TWO_PI, 361))
    covered = CheckOutcome(
        "arc of the circle, rad",
        arc,
        SHORTEST_ARC,
        arc >= SHORTEST_ARC,
        f"the phasors cover {np.degrees(arc):.0f}° of the circle"
        + ("" if has_positions else ", and its amplitude is taken to be constant"),
        least=True,
    )
    return Calibration(
        kind=KIND,
        title=f"Leakage of {sheet.instrument}, from a moving retroreflector",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=polar,
        columns=("reading", "real_mv", "imaginary_mv", "residual_mv", f"largest |{fit.test}|", "state"),
        rows=_rows(readings, fit, z, statistic, has_positions=has_positions),
        decisions=(covered, *fit.decisions(), _balance(fit, z, leakage)),
        explained=_explained(fit, z),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the light has {radius / MILLIVOLT:.4g} mV, the leakage {abs(leakage) / radius:.2%} of it",
            f"u_leakage_volt of the record is {to_come / MILLIVOLT:.3g} mV: of the centre {u_centre / MILLIVOLT:.3g} mV"
            f", and u_session_volt = {sheet.u_session_volt:g} of the sheet",
            *scatter_notes(fit, "mV", MILLIVOLT, sought=2),
        ),
        curve={
            "readings": (z[on].real / MILLIVOLT, z[on].imag / MILLIVOLT),
            "left out": (z[~on].real / MILLIVOLT, z[~on].imag / MILLIVOLT),
            "fit": (ring.real / MILLIVOLT, ring.imag / MILLIVOLT),
        },
        axes=("real part (mV)", "imaginary part (mV)"),
        method="A retroreflector moves along a rail; the phasor of its light turns by a cycle for each half "
        "wavelength, the leakage stays. The point about which the phasors turn is the leakage: "
        + (
            "with the known distances it is a linear adjustment that allows for fading."
            if has_positions
            else "the centre of the circle that fits them best."
        ),
        record=leakage_record(calibrated, to_come),
        equal_axes=True,
    )


RECIPE = CalibrationKind(
    "leakage from a retroreflector moved along a rail",
    LAYOUT,
    calibrate_lit_leakage,
    plausible=Plausibility(
        scatter=ReadingScatter(5.0, "mV", MILLIVOLT, "a thousandth of a full return of 5 V"),
        sizes={"leakage_amplitude_volt": PlausibleSpan(0.0, 0.5, "a tenth of a full return of 5 V", u=0.05)},
        explained=0.99,
        varying={"distance_m": 0.0},
    ),
)
