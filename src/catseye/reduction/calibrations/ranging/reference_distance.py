"""Reference distance D0 from targets at known distances.

From the scan point to the internal cube.

    D = L + D0 + Pc,  L = c / (2 n f) (N - phi~ / 2 pi),  phi~ = phi_target - phi_reference in [0, 2 pi)

so that each reading says y = D - Pc - L = D0. Several distances, spread over half a wavelength, tell cyclic errors and
leakage from D0; spread over tens of metres they tell the scale too.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.records.files.readings import SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.reduction.calibrations.calibration import Calibration, Quantity
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
from catseye.reduction.calibrations.ranging.air import WEATHER, AirSheet, group_air, half_wavelength, ranger_effects
from catseye.reduction.calibrations.ranging.cyclic import cyclic_effects
from catseye.reduction.calibrations.ranging.leftover import leakage_effects
from catseye.signal.cycles.whole import fraction, unwrapped_length, whole_cycles

KIND = "reference-distance"
DISTANCE, CONSTANT = Within(0.05, 10_000), Within(-2000, 0)
PHASE, VOLTS = Within(-2 * TWO_PI, 2 * TWO_PI), Within(0, 20, above=True)
SAFE = 5.0  # standard uncertainties of the coarse length that the margin of N must cover


class ReferenceDistanceSheet(AirSheet):
    """Sheet of a calibration of D0.

    d0_nominal_mm, u_d0_nominal_mm   D0 by the drawing: decides the whole cycles
    pc_mm, u_pc_mm                   constant of the target, negative or 0; a column pc_mm where targets differ
    u_distance_mm                    of each known distance by itself (setting the target), if known
    u_distance_common_mm             of the part common to all distances (scan point to the zero of the scale)
    u_distance_ppm                   of the scale of the known distances
    u_phase_rad                      of each difference of phase, if known
    u_leakage_volt                   of each quadrature of the leakage; needs the columns of amplitudes
    u_cyclic_mm                      of each cyclic term of orders 1 and 2, not corrected for
    estimate_scale                   the ranger's scale is sought too
    """

    d0_nominal_mm: Annotated[float, Within(50, 1000)]
    u_d0_nominal_mm: Uncertainty
    pc_mm: Annotated[float, CONSTANT] = 0.0
    u_pc_mm: Annotated[float, Within(0, 10)] = 0.0
    u_distance_mm: Uncertainty | None = None
    u_distance_common_mm: Annotated[float, Within(0, 10)]
    u_distance_ppm: Annotated[float, Within(0, 1000)]
    u_phase_rad: Annotated[float, Within(0, 1, above=True)] | None = None
    u_leakage_volt: Annotated[float, Within(0, 1)] = 0.0
    u_cyclic_mm: Annotated[float, Within(0, 1)] = 0.0
    estimate_scale: bool = False


LAYOUT = SheetLayout(
    KIND,
    ReferenceDistanceSheet,
    required={"distance_m": DISTANCE, "phase_target_rad": PHASE, "phase_reference_rad": PHASE},
    optional={
        "pc_mm": CONSTANT,
        "u_distance_mm": Within(0, 100, above=True),
        "u_phase_rad": Within(0, 1, above=True),
        "amplitude_target_volt": VOLTS,
        "amplitude_reference_volt": VOLTS,
        **WEATHER,
    },
)


def calibrate_reference_distance(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Reference distance D0 with u, and optionally the ranger's scale.

    readings   columns distance_m, phase_target_rad, phase_reference_rad, see LAYOUT; sheet ReferenceDistanceSheet
    reject     leave out what the tests reject

    Raises InputError for a sheet that lacks a value, EstimationError where the readings do not hold D0 (and scale).

    Source: [PARKER04] eq. 5.18 with the range constant of 5.19 as a length (5.14 and 5.17 print a wrong sign).
    """
    sheet = readings.sheet
    air = group_air(readings)
    half = half_wavelength(readings, air)
    distance, constant = readings.get("distance_m"), readings.get("pc_mm") * MILLIMETRE
    phase = fraction(readings.get("phase_target_rad"), readings.get("phase_reference_rad"))
    coarse = distance - constant - sheet.d0_nominal_mm * MILLIMETRE
    cycles, margin = whole_cycles(coarse, phase, half)
    length = unwrapped_length(cycles, phase, half)
    observed = distance - constant - length
    fit = fit_readings(
        observed,
        _design(sheet.estimate_scale, length),
        _scatter(readings, half),
        names=["D0", "scale"][: 1 + sheet.estimate_scale],
        effects=_effects(readings, length, phase, half, ranger_effects(readings, air, length)),
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, observed=observed, cycles=cycles, margin=margin)


def _design(scale: bool, length: np.ndarray) -> np.ndarray:
    """Design of y = D0 - s L.

    A ranger whose ranges are too long by the share s makes y too small.
    """
    return np.column_stack([np.ones(len(length)), -length][: 1 + scale])


def _scatter(readings: SheetReadings, half: np.ndarray) -> ObservedScatter:
    """Scatter of y: target setting and phase noise.

    As far as they are known; estimated if neither is.
    """
    m = len(readings)
    variance = np.zeros(m)
    if readings.has("u_distance_mm"):
        variance = variance + (readings.get("u_distance_mm") * MILLIMETRE) ** 2
    if readings.has("u_phase_rad"):
        variance = variance + (readings.get("u_phase_rad") * half / TWO_PI) ** 2
    if variance.any():
        return ObservedScatter(np.diag(variance))
    return ObservedScatter(
        np.zeros((m, m)), {"scatter of one reading": np.eye(m)}, size=float(np.max(readings.get("distance_m")))
    )


def _effects(
    readings: SheetReadings, length: np.ndarray, phase: np.ndarray, half: np.ndarray, ranger: list[Effect]
) -> list[Effect]:
    """Systematic effects on y.

    An error that makes the ranger read long makes y small.
    """
    sheet = readings.sheet
    ones = np.ones(len(length))
    effects = [
        Effect("known distances: common offset", ones * MILLIMETRE, sheet.u_distance_common_mm, "mm"),
        Effect("known distances: scale", readings.get("distance_m") * PPM, sheet.u_distance_ppm, "ppm"),
        Effect("constant of the target", -ones * MILLIMETRE, sheet.u_pc_mm, "mm"),
        *(Effect(e.name, -e.column, e.u, e.unit) for e in ranger),
        *(Effect(e.name, -e.column, e.u, e.unit) for e in cyclic_effects(phase, sheet.u_cyclic_mm)),
    ]
    if sheet.u_leakage_volt > 0.0:
        per_radian = half / TWO_PI  # y falls with L, which falls with the phase
        effects += [
            Effect(e.name, per_radian * e.column, e.u, e.unit) for e in leakage_effects(readings, sheet.u_leakage_volt)
        ]
    return effects


def _calibration(
    readings: SheetReadings, fit: CalibrationFit, *, observed: np.ndarray, cycles: np.ndarray, margin: np.ndarray
) -> Calibration:
    sheet, distance = readings.sheet, readings.get("distance_m")
    scale = np.array([1.0 / MILLIMETRE, 1.0 / PPM])[: len(fit.x)]
    keys = [
        ("d0_mm", "mm", "from the scan point to the internal cube, added to the measured length"),
        ("scale_ppm", "ppm", "by which ranges are too long"),
    ][: len(fit.x)]
    covariance = fit.covariance * np.outer(scale, scale)
    calibrated = quantities(keys, fit.x * scale, covariance, fit=fit, turn=np.diag(scale))
    micrometre = 1e-3 * MILLIMETRE
    rows = tuple(
        (
            float(distance[k]),
            int(cycles[k]),
            float(margin[k] / MILLIMETRE),
            float(observed[k] / MILLIMETRE),
            float(fit.residual[k] / micrometre),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )
    on, line = fit.active, np.argsort(distance)
    return Calibration(
        kind=KIND,
        title=f"Reference distance D0 of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("distance_m", "cycles", "margin_mm", "d0_mm", "residual_um", fit.test, "state"),
        rows=rows,
        decisions=(
            _cycles_decision(readings, margin, on),
            _drawing_decision(sheet, calibrated[0]),
            *fit.decisions(),
        ),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            "u holds the scatter, the known distances, frequency, air, target, leakage and cyclic terms as the sheet "
            f"states them; the scatter alone gives {np.sqrt(fit.scattered[0, 0]) / micrometre:.2g} µm",
            *scatter_notes(fit, "µm", micrometre),
        ),
        curve={
            "readings": (distance[on], observed[on] / MILLIMETRE),
            "left out": (distance[~on], observed[~on] / MILLIMETRE),
            "fit": (distance[line], fit.predicted[line] / MILLIMETRE),
            "residuals": (distance[on], fit.residual[on] / micrometre),
        },
        axes=("known distance (m)", "D0 by each reading (mm)"),
        method="The phase of a target at each known distance, less that of the internal cube at the same time, gives a "
        "length; the known distance less the target's constant less that length is the reference distance. The whole "
        "cycles are the nearest integers. The readings are adjusted together with all systematic effects as "
        "parameters with priors.",
        record={"d0_mm": calibrated[0].value, "u_d0_mm": calibrated[0].u},
    )


def _drawing_decision(sheet: ReferenceDistanceSheet, d0: Quantity) -> CheckOutcome:
    """Check of D0 against the drawing's.

    Both uncertainties together, three of them.
    """
    off, u = d0.value - sheet.d0_nominal_mm, float(np.hypot(d0.u, sheet.u_d0_nominal_mm))
    return CheckOutcome(
        "D0 less the drawing's, size in mm",
        abs(off),
        3.0 * u,
        bool(abs(off) <= 3.0 * u),
        f"{off:+.4g} mm from d0_nominal_mm; limit three standard uncertainties",
    )


def _cycles_decision(readings: SheetReadings, margin: np.ndarray, on: np.ndarray) -> CheckOutcome:
    """Check of the whole cycles of every used reading.

    The margin against the uncertainty of the coarse length.
    """
    sheet = readings.sheet
    common = np.hypot(np.hypot(sheet.u_d0_nominal_mm, sheet.u_distance_common_mm), sheet.u_pc_mm)
    doubt = np.hypot(common, readings.get("distance_m") * sheet.u_distance_ppm * PPM / MILLIMETRE)
    if readings.has("u_distance_mm"):
        doubt = np.hypot(doubt, readings.get("u_distance_mm"))
    least = int(np.argmin(np.where(on, margin / doubt, np.inf)))
    limit = SAFE * float(doubt[least])
    worst = float(margin[least]) / MILLIMETRE
    return CheckOutcome(
        "whole cycles: smallest margin, mm",
        worst,
        limit,
        worst >= limit,
        f"{readings.where[least]} decides; {SAFE:g} standard uncertainties of the coarse length must fit in",
        least=True,
    )


RECIPE = CalibrationKind(
    "reference distance D0 from targets at known distances",
    LAYOUT,
    calibrate_reference_distance,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "µm", 1e-3 * MILLIMETRE, "3 mrad of phase, half a wavelength of 0.1 m"),
        sizes={
            "d0_mm": PlausibleSpan(50.0, 1000.0, "what the sheet allows of the drawing's value", u=1.0),
            "scale_ppm": PlausibleSpan(-1e3, 1e3, "air left out makes 300 ppm, an oscillator of its own 100"),
        },
    ),
)
