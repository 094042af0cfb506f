"""Focus of the detector: place, depth, and cost of defocus.

The return's amplitude against the detector's place z along the optical axis, about its top at z_0:

    gaussian_beam   A = A_0 (1 - exp(-fill / (1 + x^2))) / (1 - exp(-fill)),  x = (z - z_0) / d
                    the part of a Gaussian spot, (1 + x^2) w_0^2 in its square, that falls on a round detector;
                    fill = 2 (radius / w_0)^2, and A = A_0 / (1 + x^2) for a small one (fill = 0)
    curve           ln A = ln A_0 - y^2 + c_3 y^3 + c_4 y^4,  y = (z - z_0) / depth, of whatever shape was measured

Amplitude goes with the light's power. The *depth* is the same for both: near the top A = A_0 (1 - ((z - z_0)/depth)^2).
Lost amplitude goes into range by the electronics' coupling (`amplitude_to_phase_rad`): a phase read too high for each
factor e above the reference's amplitude, so a weaker return with a coupling above zero reads long.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Literal

import numpy as np

from catseye.constants import TWO_PI
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, Quantity, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    scatter_notes,
    student,
)

KIND = "detector-focus"
PLACE, VOLTS = Within(-100, 100), Within(0, 20, above=True)
BEAM, CURVE = "gaussian_beam", "curve"
SMALL = 1e-6  # fill: the detector is a point
SHARED = 6  # parameters before the shape's own
LEAST = 5  # readings, of a test for a further parameter
ODD = 3.0  # standard uncertainties of an odd term; more where few readings show the scatter
Model = Callable[..., np.ndarray]


class FocusSheet(Sheet):
    """Sheet of a run through focus.

    model                  "gaussian_beam" or "curve"
    fill                   2 (radius of the detector over the spot's waist) squared, of the Gaussian beam; 0 if small
    degree                 degree of the curve: 2, 3 or 4 (4)
    installed_mm, u_installed_mm   position of the fixed detector, in the column's scale
    u_amplitude_share      relative scatter of an amplitude, if known
    amplitude_to_phase_rad, u_amplitude_to_phase_rad   coefficient of the mirror's record; for the effect on range
    half_wavelength_mm     half wavelength of the modulation in air (99.93)
    """

    model: Literal["gaussian_beam", "curve"] = "gaussian_beam"
    fill: Annotated[float, Within(0, 50)] = 0.0
    degree: Annotated[int, Within(2, 4)] = 4
    installed_mm: Annotated[float, PLACE]
    u_installed_mm: Annotated[float, Within(0, 10)]
    u_amplitude_share: Annotated[float, Within(0, 1, above=True)] | None = None
    amplitude_to_phase_rad: Annotated[float, Within(-0.1, 0.1)] | None = None
    u_amplitude_to_phase_rad: Annotated[float, Within(0, 0.1)] = 0.0
    half_wavelength_mm: Annotated[float, Within(1, 10_000)] = 99.93


LAYOUT = SheetLayout(KIND, FocusSheet, required={"position_mm": PLACE, "amplitude_volt": VOLTS})


def calibrate_detector_focus(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Best focus and depth of focus, and the detector's defocus as installed.

    readings   columns position_mm (growing one way along the optical axis) and amplitude_volt, leakage taken out; sheet
               FocusSheet
    reject     leave out what the tests reject

    Raises InputError where a curve was installed outside of its run, EstimationError where the amplitudes show no top.

    Source: [SIEGMAN86] chapter 17 for the Gaussian spot and the part of it in a round aperture; [PARKER04] chapter 6.
    """
    sheet, place = readings.sheet, readings.get("position_mm")
    low, high = place[readings.active].min(), place[readings.active].max()
    if sheet.model == CURVE and not low <= sheet.installed_mm <= high:
        raise refusal(
            readings.sheet_file,
            f"installed_mm = {sheet.installed_mm:g} lies outside of the run, {low:g} to {high:g} mm: a curve says "
            f"nothing there (expected a longer run, or model = {BEAM!r})",
        )
    observed = np.log(readings.get("amplitude_volt"))
    model = _model(sheet, place)
    solution = _fitted(readings, observed, model, _parameters(sheet, place, observed), reject)
    longer = None
    if sheet.model == BEAM and solution.fit.active.sum() > LEAST:
        parameters = [*solution.parameters, ModelParameter("skew", 0.0, 1e-3)]
        longer = _fitted(readings, observed, model, parameters, False, solution.fit.active)
    return _calibration(readings, solution, model, longer)


def _model(sheet: FocusSheet, place: np.ndarray) -> Model:
    """Function for ln A at places.

    Those of the readings by default.
    """

    def level(values: np.ndarray, at: np.ndarray = place) -> np.ndarray:
        top, middle, depth = values[:3]
        if sheet.model == CURVE:
            y = (at - middle) / depth
            return top - y**2 + sum(c * y**k for k, c in enumerate(values[SHARED:], start=3))
        x = (at - middle) / (depth * np.sqrt(_steepness(sheet.fill)))
        skew = values[SHARED] * x**3 / (1.0 + x**2) if len(values) > SHARED else 0.0
        if sheet.fill < SMALL:
            return top - np.log1p(x**2) + skew
        return top + np.log(np.expm1(-sheet.fill / (1.0 + x**2)) / np.expm1(-sheet.fill)) + skew

    return level


def _steepness(fill: float) -> float:
    """-d ln A / d(x^2) at the top: 1 for a small detector, less for one that holds the spot."""
    return 1.0 if fill < SMALL else fill / np.expm1(fill)


def _parameters(sheet: FocusSheet, place: np.ndarray, observed: np.ndarray) -> list[ModelParameter]:
    """Parameters: top, place and depth, then derived inputs.

    The latter change nothing of the readings and only enter their meaning.
    """
    best = place[np.argmax(observed)]
    falls = observed.max() - observed
    far = falls > 0.05
    depth = (
        float(np.median(np.abs(place[far] - best) / np.sqrt(np.expm1(falls[far]))))
        if far.any()
        else float(np.ptp(place))
    )
    start = [
        ModelParameter("top", float(observed.max()), 1e-3),
        ModelParameter("best focus", float(best), 1e-4),
        ModelParameter("depth", max(depth, 1e-3), 1e-4),
        ModelParameter("installed", sheet.installed_mm, 1e-4, sheet.u_installed_mm, "mm"),
        ModelParameter("coupling", sheet.amplitude_to_phase_rad or 0.0, 1e-6, sheet.u_amplitude_to_phase_rad, "rad"),
        ModelParameter("half wavelength", sheet.half_wavelength_mm, 1e-3, 0.0),
    ]
    if sheet.model == CURVE:
        start += [ModelParameter(f"order {k}", 0.0, 1e-3) for k in range(3, sheet.degree + 1)]
    return start


def _fitted(
    readings: SheetReadings,
    observed: np.ndarray,
    model: Model,
    parameters: Sequence[ModelParameter],
    reject: bool,
    active: np.ndarray | None = None,
) -> CurvedFit:
    eye, u = np.eye(len(readings)), readings.sheet.u_amplitude_share
    scatter = (
        ObservedScatter(np.zeros_like(eye), {"scatter of an amplitude": eye})
        if u is None
        else ObservedScatter(u**2 * eye)
    )
    on = readings.active if active is None else active
    return fit_curved(
        observed,
        model,
        parameters,
        scatter=scatter,
        options=FitOptions(active=on, reject=reject, level=readings.sheet.level),
    )


def _derived(values: np.ndarray, model: Model) -> np.ndarray:
    """Derived best focus, depth, defocus (mm), amplitude share, change of range (um)."""
    middle, depth, installed, coupling, half = values[1:SHARED]
    log_ratio = float(model(values, np.array([installed]))[0] - model(values, np.array([middle]))[0])
    return np.array([middle, depth, installed - middle, np.exp(log_ratio), -1e3 * half / TWO_PI * coupling * log_ratio])


def _results(solution: CurvedFit, model: Model, coupled: bool) -> tuple[tuple[Quantity, ...], np.ndarray]:
    keys = [
        ("best_focus_mm", "mm", "place of the detector where the return is strongest"),
        ("depth_mm", "mm", "near it the amplitude falls by the square of the way off over this"),
        ("detector_defocus_mm", "mm", "detector as installed, from the best focus, along the scale"),
        ("amplitude_share", "", "of the amplitude in best focus, as installed"),
        (
            "range_change_um",
            "µm",
            "range reads longer for the lost amplitude, if the internal cube's return is not weaker too",
        ),
    ][: 5 if coupled else 4]
    slopes = []
    for k, p in enumerate(solution.parameters):
        aside = np.zeros(len(solution.values))
        aside[k] = p.step
        slopes.append(
            (_derived(solution.values + aside, model) - _derived(solution.values - aside, model)) / (2.0 * p.step)
        )
    turn = np.column_stack(slopes)[: len(keys)]
    covariance = turn @ solution.covariance @ turn.T
    values = _derived(solution.values, model)[: len(keys)]
    return quantities(keys, values, covariance, fit=solution.fit, turn=turn[:, solution.uncertain]), covariance


def _calibration(readings: SheetReadings, solution: CurvedFit, model: Model, longer: CurvedFit | None) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    place = readings.get("position_mm")
    calibrated, covariance = _results(solution, model, sheet.amplitude_to_phase_rad is not None)
    by_key = {q.key: q for q in calibrated}
    defocus, share = by_key["detector_defocus_mm"], by_key["amplitude_share"]
    record: dict[str, RecordValue] = {"detector_defocus_mm": defocus.value, "u_detector_defocus_mm": defocus.u}
    on, grid = fit.active, np.linspace(place.min(), place.max(), 200)
    rows = tuple(
        (float(place[k]), float(readings.get("amplitude_volt")[k]), float(100.0 * fit.residual[k]),
         float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    amplitude = readings.get("amplitude_volt")
    unsaid = () if sheet.amplitude_to_phase_rad is not None else ("no amplitude_to_phase_rad: range is not judged",)
    shape = "as the part of a Gaussian spot on the detector." if sheet.model == BEAM else "as a curve about its top."
    return Calibration(
        kind=KIND,
        title=f"Detector focus of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("position_mm", "amplitude_volt", "residual_percent", fit.test, "state"),
        rows=rows,
        decisions=(_within_the_run(solution, place), *_symmetry(longer), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"as installed the return has {share.value:.2%} of its best amplitude",
            *unsaid,
            *scatter_notes(fit, "%", 0.01),
        ),
        curve={
            "readings": (place[on], amplitude[on]),
            "left out": (place[~on], amplitude[~on]),
            "fit": (grid, np.exp(model(solution.values, grid))),
            "residuals": (place[on], 100.0 * fit.residual[on]),
        },
        axes=("position of the detector (mm)", "amplitude (V)"),
        method=f"The logarithm of the return's amplitude against the detector's place is adjusted, {shape} "
        "Where the detector was fixed and the electronics' coupling enter with their own uncertainties.",
        record=record,
    )  # fmt: skip


def _within_the_run(solution: CurvedFit, place: np.ndarray) -> CheckOutcome:
    """Check that best focus lies among the readings.

    Beyond them it is a guess of the model.
    """
    on = place[solution.fit.active]
    middle, low, high = solution.value("best focus"), float(on.min()), float(on.max())
    nearer = min(middle - low, high - middle)
    text = (
        "amplitudes fall on both sides" if nearer > 0.0 else "the top lies outside of the readings: go on with the run"
    )
    return CheckOutcome("best focus from the nearer end of the run, mm", nearer, 0.0, nearer > 0.0, text, least=True)


def _symmetry(longer: CurvedFit | None) -> tuple[CheckOutcome, ...]:
    """Check of symmetry by an odd term.

    Spherical aberration makes the sides differ.
    """
    if longer is None:
        return ()
    ratio = abs(longer.value("skew")) / longer.u("skew")
    limit = float(student(longer.fit.effective[-1], ODD))  # the skew is the last that is sought
    text = "both sides fall alike" if ratio <= limit else "the sides differ (aberration): take model = 'curve'"
    return (CheckOutcome("odd term: |skew| / u", ratio, limit, bool(ratio <= limit), text),)


RECIPE = CalibrationKind(
    "best focus and depth of the detector, with its effect on amplitude and range",
    LAYOUT,
    calibrate_detector_focus,
    plausible=Plausibility(
        scatter=ReadingScatter(
            5.0, "%", 0.01, "an amplitude of many cycles repeats to a per cent [PARKER04] chapter 6"
        ),
        sizes={"depth_mm": PlausibleSpan(0.0, 100.0, "of a focus within the reach of the stage")},
        explained=0.9,
        varying={"position_mm": 0.0},
    ),
)
