"""Zero, scale and cyclic terms against an interferometer on a rail.

    range - D = zero + scale D + sum of cosine_k cos(k x) + sine_k sin(k x)

D is the interferometer's length, away from the ranger, x the phase after the electronics', which falls by 2 pi for each
half wavelength of range. The notes leave their chapter 7.5 empty; figure "ranger vs interferometer" of chapter 8 is
this measurement.
"""

import numpy as np

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.errors import EstimationError
from catseye.estimation.quality.reliability import single_level
from catseye.records.files.readings import SheetReadings
from catseye.reduction.calibrations.calibration import Calibration, Cell, Quantity, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import TESTS, CalibrationFit, Effect, FitOptions, fit_readings
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
from catseye.reduction.calibrations.ranging.rail import KIND, LAYOUT, LinearitySheet, Rail, rail_of
from catseye.reduction.calibrations.ranging.spectrum import spectrum
from catseye.signal.systematics.cyclic import cyclic_design, separable_orders

ORDER_LEVEL = 0.05  # chance that any order is taken where there is none
LINE_LEVEL = 0.05 / TESTS  # chance that noise alone is called a line


def calibrate_linearity(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Zero (or offset), scale and cyclic terms of a ranger.

    readings   columns range_m and interferometer_m or interferometer_vacuum_m, see LAYOUT; sheet LinearitySheet
    reject     leave out what the tests reject

    Raises InputError for a sheet that lacks a value, EstimationError where the readings do not determine offset and
    scale.

    Source: [PARKER04] chapters 7.5 and 8 name the measurement; [FOERSTNER16] chapter 4 (adjustment);
    [RUEGER90] (cyclic error of EDM instruments).
    """
    sheet, rail = readings.sheet, rail_of(readings)
    orders, reason = _separable(rail, readings)
    requested = sheet.max_order if sheet.orders is None else sheet.orders
    effects = list(rail.effects)
    if len(orders) < min(requested, 2):  # terms that cannot be estimated stay a systematic effect of their prior size
        missing = [k for k in (1, 2) if k not in orders and k <= requested]
        prior = cyclic_effects(rail.phase, sheet.u_cyclic_mm)  # cosines, then sines
        effects += [e for k, e in zip((1, 2, 1, 2), prior, strict=True) if k in missing]
    active = readings.active
    if reject:
        active = _fit(rail, orders, effects, active, sheet.level, reject=True).active
    chosen, decisions = _chosen(rail, orders, effects, active, sheet)
    fit = _fit(rail, chosen, effects, active, sheet.level)
    return _calibration(readings, rail, fit, chosen, (*decisions, *fit.decisions()), reason)


def _design(rail: Rail, orders: tuple[int, ...]) -> np.ndarray:
    """Design (m, 2 + 2 K): mean offset, scale, cosines, sines."""
    middle = rail.length - rail.length.mean()
    return np.column_stack([np.ones(len(middle)), middle, cyclic_design(rail.phase, orders)])


def _fit(
    rail: Rail,
    orders: tuple[int, ...],
    effects: list[Effect],
    active: np.ndarray,
    level: float,
    reject: bool = False,
) -> CalibrationFit:
    names = ["offset", "scale", *(f"cyclic {part} {k}" for part in ("cosine", "sine") for k in orders)]
    return fit_readings(
        rail.observed,
        _design(rail, orders),
        rail.scatter,
        names=names,
        effects=effects,
        options=FitOptions(active=active, reject=reject, level=level),
    )


def _separable(rail: Rail, readings: SheetReadings) -> tuple[tuple[int, ...], str]:
    """Cyclic orders that are separable, and the reason against others.

    Separable from offset and scale by the positions.
    """
    sheet = readings.sheet
    requested = sheet.max_order if sheet.orders is None else sheet.orders
    on = readings.active
    length, phase = rail.length[on], rail.phase[on]
    span = float(np.ptp(length))
    if requested == 0:
        return (), ""
    omission = "left out: what there is of them stays in the offset" + (
        f", with u_cyclic_mm = {sheet.u_cyclic_mm:g} as prior" if sheet.u_cyclic_mm > 0.0 else ", and is not in its u"
    )
    if span < rail.half:
        return (), (
            f"cyclic terms {omission}, because the positions cover {span:.4g} m, less than half a modulation "
            f"wavelength ({rail.half:.4g} m); a longer rail separates them"
        )
    room = (int(on.sum()) - 4) // 2  # readings that are left over must tell the scatter
    tried = min(requested, max(room, 0))
    columns = np.column_stack([np.ones(len(length)), length - length.mean()])
    separate = separable_orders(phase, tried, nuisance=columns).orders if tried else ()
    orders = tuple(k for k, got in zip(range(1, tried + 1), separate, strict=False) if k == got)
    if len(orders) < requested:
        text = (
            f"cyclic orders above {len(orders)} {omission}, because {int(on.sum())} positions over {span:.4g} m do not "
            "separate them"
        )
        return orders, text
    return orders, ""


def _chosen(
    rail: Rail, candidates: tuple[int, ...], effects: list[Effect], active: np.ndarray, sheet: LinearitySheet
) -> tuple[tuple[int, ...], tuple[CheckOutcome, ...]]:
    """Significant cyclic orders, by the F test against one order less.

    Up to the highest whose pair of terms is significant.

    Each order is tested with the scatter of the longest series; [FOERSTNER16] chapter 4 (tests of hypotheses). The
    level is shared among the orders, so that any is taken in vain once in twenty times.
    """
    from scipy.stats import f as fisher

    if sheet.orders is not None:
        return candidates[: sheet.orders], ()
    if not candidates:
        return (), ()
    degrees = int(active.sum()) - 2 - 2 * len(candidates)
    if degrees < 1:
        raise EstimationError(
            "no readings are left to test the cyclic orders: state `orders` in the sheet, or read more"
        )
    longest = _fit(rail, candidates, effects, active, sheet.level)
    single = single_level(ORDER_LEVEL, len(candidates))
    limit = float(fisher.isf(single, 2.0, degrees))
    highest, outcomes = 0, []
    weight = np.linalg.inv(_covariance(rail, longest)[np.ix_(active, active)])
    squares = [_squares(rail, candidates[:k], active, weight) for k in range(len(candidates) + 1)]
    scale = max(squares[-1] / degrees, np.finfo(float).tiny)  # readings without any scatter are no division by zero
    for k in range(1, len(candidates) + 1):
        statistic = (squares[k - 1] - squares[k]) / 2.0 / scale
        significant = bool(statistic > limit)
        highest = k if significant else highest
        verdict = "significant" if significant else "not significant"
        text = f"{verdict} by the F test of its two terms at the level {single:.2g}"
        outcomes.append(CheckOutcome(f"cyclic order {k}: F", float(statistic), limit, None, text))
    return candidates[:highest], tuple(outcomes)


def _covariance(rail: Rail, fit: CalibrationFit) -> np.ndarray:
    """Covariance of the observed values by a fit's scatter."""
    return rail.scatter.claimed + sum(
        (fit.components[name] ** 2 * matrix for name, matrix in rail.scatter.unknown.items()),
        np.zeros_like(rail.scatter.claimed),
    )


def _squares(rail: Rail, orders: tuple[int, ...], active: np.ndarray, weight: np.ndarray) -> float:
    """Weighted squares v' W v of the best fit.

    Effects that the free parameters do not absorb are far below the scatter.
    """
    design, y = _design(rail, orders)[active], rail.observed[active]
    x = np.linalg.lstsq(design.T @ weight @ design, design.T @ weight @ y, rcond=None)[0]
    v = y - design @ x
    return float(v @ weight @ v)


def _quantities(rail: Rail, orders: tuple[int, ...], absolute: bool) -> tuple[list, np.ndarray]:
    """Keys, and the matrix to the quantities.

    From (offset at the mean, scale, cosines, sines).
    """
    count = len(orders)
    turn = np.diag([1.0 / MILLIMETRE, 1.0 / PPM, *([1.0 / MILLIMETRE] * 2 * count)])
    middle = float(rail.length.mean())
    if absolute:
        turn[0, 1] = -middle / MILLIMETRE  # carried back to distance zero
        first = ("zero_mm", "mm", "by which ranges are too long at distance zero; d0_mm less this is the better D0")
    else:
        text = f"range less interferometer at its reading {middle:.4f} m; its zero is arbitrary, so is this"
        first = ("offset_mm", "mm", text)
    keys = [first, ("scale_ppm", "ppm", "by which ranges are too long in proportion")]
    for part in ("cosine", "sine"):
        keys += [
            (f"cyclic_{part}_{k}_mm", "mm", f"range too long by this times {part[:3]} {k}x, x the phase")
            for k in orders
        ]
    return keys, turn


def _rows(readings: SheetReadings, rail: Rail, fit: CalibrationFit) -> tuple[tuple[Cell, ...], ...]:
    """Table of carriage positions: readings and residual."""
    micrometre = 1e-3 * MILLIMETRE
    residual = fit.residual / micrometre
    return tuple(
        (
            float(rail.length[k]),
            float(readings.numbers["range_m"][k]),
            float(rail.observed[k] / micrometre),
            float(rail.phase[k]),
            float(residual[k]),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )


def _line_decision(period: np.ndarray, height: np.ndarray, chance: np.ndarray) -> CheckOutcome:
    """Test for a line in the residuals' spectrum.

    Periods and heights in m, and each line's probability.
    """
    top = int(np.argmin(chance))
    return CheckOutcome(
        "spectrum of residuals: chance of the highest line",
        float(chance[top]),
        LINE_LEVEL,
        bool(chance[top] >= LINE_LEVEL),
        f"{height[top] / (1e-3 * MILLIMETRE):.2g} µm at a period of {period[top] * 1e3:.4g} mm, where the line is "
        "least likely",
        least=True,
    )


def _notes(
    fit: CalibrationFit, calibrated: tuple[Quantity, ...], count: int, reason: str, *, chosen: bool
) -> tuple[str, ...]:
    """Notes on the model and the content of its u.

    count    of the cyclic orders modelled
    reason   for these
    chosen   the tests chose them, not the sheet
    """
    micrometre = 1e-3 * MILLIMETRE
    notes = [
        reason,
        f"{count} cyclic {'order is' if count == 1 else 'orders are'} modelled"
        + ("; " + ", ".join(_amplitude(calibrated, fit, k, count) for k in range(count)) if count else ""),
        f"u of the offset from the scatter alone {np.sqrt(fit.scattered[0, 0]) / micrometre:.2g} µm; the rest are "
        "interferometer, air and start as the sheet states them",
        "the orders were chosen by the tests from these readings; their u takes the choice as given"
        if chosen and count
        else "",
        *scatter_notes(fit, "µm", micrometre),
    ]
    return tuple(note for note in notes if note)


def _calibration(
    readings: SheetReadings,
    rail: Rail,
    fit: CalibrationFit,
    orders: tuple[int, ...],
    decisions: tuple[CheckOutcome, ...],
    reason: str,
) -> Calibration:
    sheet, micrometre = readings.sheet, 1e-3 * MILLIMETRE
    keys, turn = _quantities(rail, orders, sheet.start_m is not None)
    covariance = turn @ fit.covariance @ turn.T
    calibrated = quantities(keys, turn @ fit.x, covariance, fit=fit, turn=turn)
    count = len(orders)
    record: dict[str, RecordValue] = {}
    if count:
        cyclic = calibrated[2:]
        record = {
            "cyclic_cosine_mm": [q.value for q in cyclic[:count]],
            "cyclic_sine_mm": [q.value for q in cyclic[count:]],
            "u_cyclic_mm": max(q.u for q in cyclic),
        }
    on, residual = fit.active, fit.residual / micrometre
    noise = _covariance(rail, fit)[np.ix_(on, on)]
    period, height, chance = spectrum(rail.path[on], fit.residual[on], noise, half=rail.half)
    smooth = rail.observed - fit.predicted
    dense = np.linspace(rail.length[on].min(), rail.length[on].max(), 2000)
    return Calibration(
        kind=KIND,
        title=f"Zero and linearity of {sheet.instrument} against an interferometer",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=(
            "distance_m",
            "range_m",
            "range_less_distance_um",
            "phase_rad",
            "residual_um",
            fit.test,
            "state",
        ),
        rows=_rows(readings, rail, fit),
        decisions=(*decisions, _line_decision(period, height, chance)),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=_notes(fit, calibrated, count, reason, chosen=sheet.orders is None),
        curve={
            "readings": (rail.length[on], rail.observed[on] / micrometre),
            "left out": (rail.length[~on], rail.observed[~on] / micrometre),
            "fit": (dense, _curve(rail, fit, orders, dense, float(np.mean(smooth[on] - fit.residual[on])))),
            "residuals": (rail.length[on], residual[on]),
            "spectrum": (period * 1e3, height / micrometre),
        },
        axes=("interferometer (m)", "range less interferometer (µm)"),
        method="At each position of the carriage the ranger's range less the interferometer's length is read. Offset, "
        "scale and cyclic terms of the phase after the electronics are adjusted together, with interferometer, air and "
        "start as systematic effects with priors. Cyclic orders are kept up to the highest that the F test calls "
        "significant.",
        record=record,
    )


def _amplitude(calibrated: tuple[Quantity, ...], fit: CalibrationFit, k: int, count: int) -> str:
    """Amplitude of one order with its u, in micrometres."""
    cosine, sine = calibrated[2 + k].value, calibrated[2 + count + k].value
    size = float(np.hypot(cosine, sine))
    at = [2 + k, 2 + count + k]
    gradient = np.array([cosine, sine]) / size
    u = float(np.sqrt(gradient @ fit.covariance[np.ix_(at, at)] @ gradient)) / MILLIMETRE
    return f"order {k + 1}: {size * 1e3:.2f} µm, u {u * 1e3:.2f} µm"


def _curve(rail: Rail, fit: CalibrationFit, orders: tuple[int, ...], at: np.ndarray, shift: float) -> np.ndarray:
    """Fitted line in micrometres at lengths.

    `shift` is the mean effect of the systematic parameters.
    """
    phase = np.interp(at, np.sort(rail.length), np.sort(rail.path))
    x = -TWO_PI * phase / rail.half
    design = np.column_stack([np.ones(len(at)), at - rail.length.mean(), cyclic_design(x, orders)])
    return (design @ fit.x + shift) / (1e-3 * MILLIMETRE)


RECIPE = CalibrationKind(
    "zero, scale and cyclic terms against an interferometer along a rail",
    LAYOUT,
    calibrate_linearity,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "µm", 1e-3 * MILLIMETRE, "3 mrad of phase, half a wavelength of 0.1 m"),
        sizes={
            "zero_mm": PlausibleSpan(-20.0, 20.0, "a reference distance that was taken from the drawing"),
            "scale_ppm": PlausibleSpan(-1e3, 1e3, "air left out makes 300 ppm, an oscillator of its own 100"),
            "cyclic_*_mm": PlausibleSpan(-5.0, 5.0, "a leakage of a third of the return", u=0.5),
        },
    ),
)
