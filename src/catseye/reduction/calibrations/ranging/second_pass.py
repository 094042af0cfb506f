"""Light that the detector sends out again, by one target on a slide at two attenuations.

    full - attenuated = offset - (A_1 - A_2) (cosine cos x + sine sin x)

x is the phase of the full return after the electronics'. The second pass grows with the return, so that attenuating the
light shows it apart from a cyclic deviation, which both readings share with distance, air and drift. The offset holds
the glass of the attenuator (1 mm of it delays the phase by some 30 mrad) and the coupling of amplitude to phase, which
`amplitude-to-phase` finds from attenuations of several strengths; it is free.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIRADIAN, TWO_PI
from catseye.errors import EstimationError
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.calibration import Calibration
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
from catseye.reduction.calibrations.ranging.leftover import NAMES
from catseye.signal.systematics.cyclic import separable_orders
from catseye.signal.systematics.leakage import phase_by_leakage
from catseye.signal.systematics.multipath import second_pass_turn

KIND = "second-pass"
PHASE, VOLTS = Within(-2 * TWO_PI, 2 * TWO_PI), Within(0, 20, above=True)
SCATTER = "scatter of a difference of phases"
LEAST_RATIO = 1.5  # of the two amplitudes: below it the second pass is little more than a third of itself


class SecondPassSheet(Sheet):
    """Sheet of a calibration of light that the detector sends out again.

    u_phasor_volt    of each quadrature of one phasor, if known: u of phase is this over the amplitude
    u_leakage_volt   of each quadrature of the leakage that was taken out
    """

    u_phasor_volt: Annotated[float, Within(0, 1, above=True)] | None = None
    u_leakage_volt: Annotated[float, Within(0, 1)]


LAYOUT = SheetLayout(
    KIND,
    SecondPassSheet,
    required={
        "phase_full_rad": PHASE,
        "amplitude_full_volt": VOLTS,
        "phase_attenuated_rad": PHASE,
        "amplitude_attenuated_volt": VOLTS,
        "phase_reference_rad": PHASE,
    },
)


def calibrate_second_pass(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Second pass for each volt of return, and what the attenuator itself turns the phase by.

    readings   columns of LAYOUT, one row a place of the slide; sheet SecondPassSheet
    reject     leave out what the tests reject

    Raises EstimationError where the places do not spread over half a wavelength or the attenuator does too little.

    Source: [PARKER04] chapter 6, item 3, names the effect; `multipath.second_pass_turn`.
    """
    sheet, on = readings.sheet, readings.active
    full, weak = readings.get("amplitude_full_volt"), readings.get("amplitude_attenuated_volt")
    ratio = full / weak
    if np.any(ratio[on] < LEAST_RATIO):
        row = int(np.flatnonzero(on & (ratio < LEAST_RATIO))[0])
        raise readings.refuse(
            row, f"amplitudes differ by a factor of {ratio[row]:.3g} (expected {LEAST_RATIO} or more)"
        )
    x = readings.get("phase_full_rad") - readings.get("phase_reference_rad")
    if not separable_orders(x[on], 1).orders:
        raise EstimationError(
            f"{readings.file}: the places do not tell cosine and sine apart: let the slide move over half a modulation "
            "wavelength (0.1 m at 1500 MHz), eight places or more"
        )
    observed = np.angle(np.exp(1j * (readings.get("phase_full_rad") - readings.get("phase_attenuated_rad"))))
    scatter = (
        ObservedScatter(np.zeros((len(x), len(x))), {SCATTER: np.eye(len(x))})
        if sheet.u_phasor_volt is None
        else ObservedScatter(np.diag(sheet.u_phasor_volt**2 * (1.0 / full**2 + 1.0 / weak**2)))
    )
    design = _design(x, full, weak)
    fit = fit_readings(
        observed,
        design,
        scatter,
        names=["offset", "cosine", "sine"],
        effects=_leakage(readings, sheet.u_leakage_volt),
        options=FitOptions(active=on, reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, x, observed)


def _design(x: np.ndarray, full: np.ndarray, weak: np.ndarray) -> np.ndarray:
    """Derivatives (m, 3) of the difference by offset, cosine and sine; at zero, where q^2 is below the noise."""
    _, strong_slopes = second_pass_turn(x, full, 0.0, 0.0)
    _, weak_slopes = second_pass_turn(x, weak, 0.0, 0.0)
    return np.column_stack([np.ones_like(x), weak_slopes - strong_slopes])


def _leakage(readings: SheetReadings, u_leakage_volt: float) -> list[Effect]:
    """Effects of residual leakage, which turns the weaker phasor more."""
    if u_leakage_volt == 0.0:
        return []
    phasors = [
        readings.get(f"amplitude_{level}_volt") * np.exp(1j * readings.get(f"phase_{level}_rad"))
        for level in ("full", "attenuated")
    ]
    slopes = -phase_by_leakage(*phasors)
    return [Effect(name, column, u_leakage_volt, "V") for name, column in zip(NAMES, slopes.T, strict=True)]


def _calibration(readings: SheetReadings, fit: CalibrationFit, x: np.ndarray, observed: np.ndarray) -> Calibration:
    on = fit.active
    full, weak = readings.get("amplitude_full_volt"), readings.get("amplitude_attenuated_volt")
    keys = [
        ("offset_rad", "rad", "full less attenuated: the attenuator's glass and the coupling of amplitude to phase"),
        ("second_pass_cosine_per_volt", "1/V", "turn, range too long, for each volt of return, times cos x"),
        ("second_pass_sine_per_volt", "1/V", "the same times sin x, x the phase after the electronics'"),
    ]
    calibrated = quantities(keys, fit.x, fit.covariance, fit=fit)
    wave = (observed - fit.x[0]) / MILLIRADIAN
    grid = np.linspace(0.0, TWO_PI, 200)
    level = np.full(200, float(np.mean(full[on]))), np.full(200, float(np.mean(weak[on])))
    curve = _design(grid, *level)[:, 1:] @ fit.x[1:] / MILLIRADIAN
    phase = np.mod(x, TWO_PI)
    strongest = float(np.max(full[on]))
    share = float(np.hypot(*fit.x[1:])) * strongest
    u = max(float(q.u) for q in calibrated[1:])
    return Calibration(
        kind=KIND,
        title=f"Second pass of light in {readings.sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=fit.covariance,
        columns=("reading", "phase_rad", "difference_mrad", "residual_mrad", fit.test, "state"),
        rows=tuple(
            (
                readings.where[k],
                float(phase[k]),
                float(observed[k] / MILLIRADIAN),
                float(fit.residual[k] / MILLIRADIAN),
                float(fit.statistic[k]),
                state,
            )
            for k, state in enumerate(fit.state(readings.left_out))
        ),
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the strongest return used, {strongest:.3g} V, has a second pass of {share:.2g} of the light: up to "
            f"{share / TWO_PI / 2.0:.2g} of a modulation wavelength of range",
            *scatter_notes(fit, "mrad", MILLIRADIAN),
        ),
        curve={
            "readings": (phase[on], wave[on]),
            "left out": (phase[~on], wave[~on]),
            "fit": (grid, curve),
            "residuals": (phase[on], fit.residual[on] / MILLIRADIAN),
        },
        axes=("phase after the electronics' (rad)", "full less attenuated (mrad)"),
        method="At each place of the slide the phase is read at full return and through an attenuator. The difference "
        "holds neither distance nor air: a wave of the phase that grows with the return is light that the detector "
        "sends out again. The attenuator's glass and the coupling of amplitude to phase are a constant, estimated with "
        "it; what is left of the leakage is a systematic effect with a prior.",
        record={
            "second_pass_cosine_per_volt": calibrated[1].value,
            "second_pass_sine_per_volt": calibrated[2].value,
            "u_second_pass_per_volt": u,
        },
    )


RECIPE = CalibrationKind(
    "light that the detector sends out again, a target on a slide at two attenuations",
    LAYOUT,
    calibrate_second_pass,
    plausible=Plausibility(
        scatter=ReadingScatter(0.5, "mrad", MILLIRADIAN, "two phasors, 1 mV of noise in 5 V and in a third of it"),
        sizes={
            "offset_rad": PlausibleSpan(-np.pi, np.pi, "glass of any thickness"),
            "second_pass_*_per_volt": PlausibleSpan(
                -0.01, 0.01, "a detector that returns a twentieth of the light at 5 V has no filter"
            ),
        },
        varying={"phase_full_rad": 0.0},
    ),
)
