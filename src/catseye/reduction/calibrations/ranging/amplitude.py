"""Amplitude-to-phase coupling by one fixed target and attenuations.

phase added = coefficient ln(A / A_ref), as `signal.systematics.amplitude.amplitude_phase` has it. Leakage left over
turns a weak phasor more and looks like coupling; it is a systematic effect with a prior here.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIRADIAN, TWO_PI
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.calibration import Calibration
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
from catseye.reduction.calibrations.ranging.leftover import leakage_effects
from catseye.signal.systematics.amplitude import amplitude_by_coefficient

KIND = "amplitude-to-phase"
PHASE, VOLTS = Within(-2 * TWO_PI, 2 * TWO_PI), Within(0, 20, above=True)
SCATTER = "scatter of the phase at the reference amplitude"
LINE_LEVEL = 0.05  # of the test of a further, quadratic term


class AmplitudeSheet(Sheet):
    """Sheet of a calibration of the coupling from amplitude to phase.

    reference_amplitude_volt        amplitude to which the correction refers: the return of the internal cube
    u_phasor_volt                   of each quadrature of one phasor, if known: u of phase is this over the amplitude
    u_phase_rad                     of each phase, less the reference's where given, instead; a column where they differ
    u_leakage_volt                  of each quadrature of the leakage that was taken out
    random_walk_rad_per_sqrt_hour   random walk of the electronics, where no reference phases are given; needs mjd_utc
    quadratic                       a term in the square of the logarithm is sought too
    """

    reference_amplitude_volt: Annotated[float, VOLTS]
    u_phasor_volt: Annotated[float, Within(0, 1, above=True)] | None = None
    u_phase_rad: Annotated[float, Within(0, 1, above=True)] | None = None
    u_leakage_volt: Annotated[float, Within(0, 1)]
    random_walk_rad_per_sqrt_hour: Annotated[float, Within(0, 1)] = 0.0
    quadratic: bool = False


LAYOUT = SheetLayout(
    KIND,
    AmplitudeSheet,
    required={"amplitude_target_volt": VOLTS, "phase_target_rad": PHASE},
    optional={
        "phase_reference_rad": PHASE,
        "amplitude_reference_volt": VOLTS,
        "u_phase_rad": Within(0, 1, above=True),
    },
)


def calibrate_amplitude(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Coupling coefficient, rad per factor e of amplitude.

    With a test whether a line suffices.

    readings   columns amplitude_target_volt, phase_target_rad, perhaps phase_reference_rad; sheet AmplitudeSheet
    reject     leave out what the tests reject

    Raises EstimationError where the attenuations do not separate coefficient and phase.

    Source: [PARKER04] chapter 6, item 5, names the effect without a formula; a model, tested here.
    """
    sheet, on = readings.sheet, readings.active
    amplitude, phase = readings.get("amplitude_target_volt"), readings.get("phase_target_rad")
    if "phase_reference_rad" in readings.numbers:
        phase = phase - readings.get("phase_reference_rad")
    strongest = int(np.argmax(np.where(on, amplitude, 0.0)))
    observed = np.angle(np.exp(1j * (phase - phase[strongest])))  # the shorter direction
    levels = amplitude_by_coefficient(amplitude, sheet.reference_amplitude_volt)
    design = np.column_stack([levels[:, 0], np.ones(len(amplitude)), levels[:, 1]])
    scatter, effects = _scatter(readings), []
    if sheet.u_leakage_volt > 0.0:
        effects = leakage_effects(readings, sheet.u_leakage_volt)
    names = ["coefficient", "phase", "quadratic coefficient"]
    terms = 3 if sheet.quadratic else 2
    fit = fit_readings(
        observed,
        design[:, :terms],
        scatter,
        names=names[:terms],
        effects=effects,
        options=FitOptions(active=on, reject=reject, level=sheet.level),
    )
    longer = None
    if terms == 2 and fit.active.sum() > 4 and len(set(amplitude[fit.active])) > 2:
        longer = fit_readings(
            observed, design, scatter, names=names, effects=effects, options=FitOptions(active=fit.active)
        )
    return _calibration(readings, fit, observed, levels[:, 0], longer)


def _scatter(readings: SheetReadings) -> ObservedScatter:
    """Scatter of a phase: noise by 1/amplitude, plus the electronics' walk."""
    sheet, m = readings.sheet, len(readings)
    claimed = np.zeros((m, m))
    if sheet.random_walk_rad_per_sqrt_hour > 0.0:
        hours = readings.hours()
        claimed += sheet.random_walk_rad_per_sqrt_hour**2 * np.minimum(hours[:, None], hours)
    amplitude = readings.get("amplitude_target_volt")
    if readings.has("u_phase_rad"):
        return ObservedScatter(claimed + np.diag(readings.get("u_phase_rad") ** 2))
    relative = 1.0 / amplitude**2
    if "amplitude_reference_volt" in readings.numbers:
        relative = relative + 1.0 / readings.get("amplitude_reference_volt") ** 2
    if sheet.u_phasor_volt is not None:
        return ObservedScatter(claimed + np.diag(sheet.u_phasor_volt**2 * relative))
    return ObservedScatter(claimed, {SCATTER: np.diag(sheet.reference_amplitude_volt**2 * relative)})


def _line_decision(longer: CalibrationFit | None) -> CheckOutcome:
    """Test whether a line suffices, by a quadratic term.

    t against Student's, or the normal where the scatter is claimed.
    """
    from scipy.stats import norm
    from scipy.stats import t as student

    name = "line in the logarithm: |t| of a quadratic term"
    if longer is None:
        text = "too few different amplitudes to test it, or the term is in the model"
        return CheckOutcome(name, float("nan"), float("nan"), None, text)
    statistic = abs(float(longer.x[2]) / float(np.sqrt(longer.covariance[2, 2])))
    half = 1.0 - 0.5 * LINE_LEVEL
    limit = float(student.ppf(half, longer.degrees_of_freedom) if longer.components else norm.ppf(half))
    passed = statistic <= limit
    text = "a line suffices" if passed else "a line does not suffice: set quadratic = true, or use fewer attenuations"
    return CheckOutcome(name, statistic, limit, passed, text)


def _calibration(
    readings: SheetReadings, fit: CalibrationFit, observed: np.ndarray, level: np.ndarray, longer: CalibrationFit | None
) -> Calibration:
    sheet, on = readings.sheet, fit.active
    keep = [0, 2] if sheet.quadratic else [0]
    keys = [
        ("amplitude_to_phase_rad", "rad", "growth of the measured phase for each factor e of amplitude"),
        ("amplitude_to_phase_quadratic_rad", "rad", "the same for its square"),
    ][: len(keep)]
    covariance = fit.covariance[np.ix_(keep, keep)]
    calibrated = quantities(keys, fit.x[keep], covariance, fit=fit, turn=np.eye(len(fit.x))[keep])
    amplitude = readings.get("amplitude_target_volt")
    weakest = float(np.min(np.log(amplitude[on] / sheet.reference_amplitude_volt)))
    effect = float(fit.x[0] * weakest + (fit.x[2] * weakest**2 if sheet.quadratic else 0.0))
    grid = np.linspace(level[on].min(), level[on].max(), 100)
    curve = np.column_stack([grid, np.ones(100), grid**2])[:, : len(fit.x)] @ fit.x
    rows = tuple(
        (
            readings.where[k],
            float(amplitude[k]),
            float(level[k]),
            float(observed[k] / MILLIRADIAN),
            float(fit.residual[k] / MILLIRADIAN),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )
    return Calibration(
        kind=KIND,
        title=f"Amplitude-to-phase coupling of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("reading", "amplitude_volt", "ln_amplitude", "phase_mrad", "residual_mrad", fit.test, "state"),
        rows=rows,
        decisions=(_line_decision(longer), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the weakest return used, {np.exp(weakest):.1%} of the reference amplitude, gains "
            f"{effect / MILLIRADIAN:+.3g} mrad of phase",
            f"u from the scatter alone {np.sqrt(fit.scattered[0, 0]) / MILLIRADIAN:.2g} mrad; the rest is leakage left "
            "over",
            *scatter_notes(fit, "mrad", MILLIRADIAN, sought=1),
        ),
        curve={
            "readings": (level[on], observed[on] / MILLIRADIAN),
            "left out": (level[~on], observed[~on] / MILLIRADIAN),
            "fit": (grid, curve / MILLIRADIAN),
            "residuals": (level[on], fit.residual[on] / MILLIRADIAN),
        },
        axes=("ln (amplitude / reference amplitude)", "phase after the strongest (mrad)"),
        method="One target that does not move is seen through several attenuations. A line of its phase, leakage taken "
        "out, against the logarithm of amplitude is adjusted; noise goes with one over the amplitude, and what is left "
        "of the leakage is a systematic effect with a prior.",
        record={"amplitude_to_phase_rad": calibrated[0].value, "u_amplitude_to_phase_rad": calibrated[0].u}
        if not sheet.quadratic
        else {},
    )


RECIPE = CalibrationKind(
    "coupling from amplitude to phase, one target at several attenuations",
    LAYOUT,
    calibrate_amplitude,
    plausible=Plausibility(
        scatter=ReadingScatter(
            0.2, "mrad", MILLIRADIAN, "1 mV of noise in a phasor of 5 V, the converter's full range"
        ),
        sizes={"amplitude_to_phase*_rad": PlausibleSpan(-0.1, 0.1, "what a mirror's record may hold of it")},
        varying={"amplitude_target_volt": 0.0},
    ),
)
