"""Azimuth limits from touches of the mechanical stops.

A stop's place is the mean of its touches. The limit stands inside of it by the margin and by as much as a touch to
come may differ, rounded inwards to whole counts: three standard deviations, or where the touches themselves show the
scatter as many as Student's distribution needs for the same chance.
"""

from typing import Annotated

import numpy as np

from catseye.geometry.mirror.encoder import COUNTS_PER_TURN, HALF_TURN
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    ReadingScatter,
    provenance,
    scatter_notes,
    student,
)

KIND = "limits"
COUNTS = Within(-1_000_000, 1_000_000)
STOPS = ("low", "high")
WIDE = 3.0  # standard deviations of a single touch, within the limit


class LimitsSheet(Sheet):
    """Sheet of the stops.

    margin_counts   distance of the limits inside the stops
    u_touch_counts  scatter of a touch, if known
    na0             counts at Theta = 0, if known: then the directions out of reach are named
    """

    margin_counts: Annotated[float, Within(0, 20_000)]
    u_touch_counts: Annotated[float, Within(0, 1000, above=True)] | None = None
    na0: Annotated[float, COUNTS] | None = None


LAYOUT = SheetLayout(KIND, LimitsSheet, required={"stop": TEXT, "azimuth_counts": COUNTS})


def calibrate_limits(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Azimuth limits from touches of both stops.

    readings   columns stop ("low" where the counts end downwards, "high") and azimuth_counts; sheet LimitsSheet
    reject     leave out what the tests reject

    Raises InputError where a stop was not touched or the margins leave nothing between, EstimationError where the
    scatter is not stated and nothing shows it.

    Source: [PARKER04] section 2.4 (mechanical stops, eq. 2.19; AZ LOW LIMIT and AZ HIGH LIMIT of figure 2.4).
    """
    sheet, counts = readings.sheet, readings.get("azimuth_counts")
    for row, word in enumerate(readings.words["stop"]):
        if word not in STOPS:
            raise readings.refuse(row, f"stop = {word!r} is unknown (expected 'low' or 'high')")
    high = np.array([word == "high" for word in readings.words["stop"]])
    for name, at_stop in (("low", ~high), ("high", high)):
        if not np.any(at_stop & readings.active):
            raise refusal(readings.file, f"column 'stop': {name!r} was never touched (expected touches of both stops)")
    eye = np.eye(len(counts))
    claimed = sheet.u_touch_counts
    scatter = (
        ObservedScatter(np.zeros_like(eye), {"scatter of a touch": eye})
        if claimed is None
        else ObservedScatter(claimed**2 * eye)
    )
    solution = fit_curved(
        counts,
        lambda values: np.where(high, values[1], values[0]),
        [
            ModelParameter(f"{name} stop", float(np.median(counts[at_stop])), 0.1)
            for name, at_stop in (("low", ~high), ("high", high))
        ],
        scatter=scatter,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    single = claimed if claimed is not None else solution.fit.components["scatter of a touch"]
    return _calibration(readings, solution, single)


def _calibration(readings: SheetReadings, solution: CurvedFit, single: float) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    wide = [float(times) for times in student(fit.effective, WIDE)]
    inwards = [
        sheet.margin_counts + times * float(np.hypot(single, solution.u(f"{name} stop")))
        for name, times in zip(STOPS, wide, strict=True)
    ]
    low_limit = int(np.ceil(solution.value("low stop") + inwards[0]))
    high_limit = int(np.floor(solution.value("high stop") - inwards[1]))
    if low_limit >= high_limit:
        raise refusal(
            readings.file,
            f"the stops lie at {solution.value('low stop'):.1f} and {solution.value('high stop'):.1f}: with the margin "
            f"of {sheet.margin_counts:g} nothing is left between (expected low below high; are the words swapped?)",
        )
    calibrated, covariance = solution.quantities(
        [
            (f"{name} stop", f"az_{name}_stop_counts", "counts", f"where the azimuth meets its {name} stop", 1.0)
            for name in STOPS
        ]
    )
    counts = readings.get("azimuth_counts")
    on, place = fit.active, np.arange(1, len(counts) + 1)
    rows = tuple(
        (readings.words["stop"][k], float(counts[k]), float(fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )
    return Calibration(
        kind=KIND,
        title=f"Azimuth limits of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("stop", "azimuth_counts", "residual_counts", fit.test, "state"),
        rows=rows,
        decisions=(_reach(low_limit, high_limit), _travel(solution), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(*_unreached(low_limit, high_limit, sheet.na0), *scatter_notes(fit, "counts", 1.0)),
        curve={
            "readings": (place[on], fit.residual[on]),
            "left out": (place[~on], fit.residual[~on]),
            "fit": (place, np.zeros(len(place))),
        },
        axes=("touch", "counts from the stop's mean (counts)"),
        method=f"Each stop is the mean of its touches. The limits stand inside by the margin of "
        f"{sheet.margin_counts:g} counts and by {max(wide):.3g} standard deviations of a touch to come, rounded "
        "inwards.",
        record={"az_low_limit": low_limit, "az_high_limit": high_limit},
    )


def _reach(low: int, high: int) -> CheckOutcome:
    """Check that every direction is reached, direct or prime.

    The pointings lie half a turn apart.
    """
    travel = float(high - low)
    reached = "every direction is reached" if travel >= HALF_TURN else "some directions are not reached"
    text = f"{reached}, in the direct or the prime pointing"
    return CheckOutcome("travel between the limits, counts", travel, HALF_TURN, travel >= HALF_TURN, text, least=True)


def _travel(solution: CurvedFit) -> CheckOutcome:
    """Check that two stops of one axis can be so far apart.

    A lever lets a pin by, once.
    """
    travel, most = solution.value("high stop") - solution.value("low stop"), 1.5 * COUNTS_PER_TURN
    text = "stops of one axis"
    if travel > most:
        text = f"the stops lie {travel / COUNTS_PER_TURN:.2f} turns apart: counts of another encoder, or doubled"
    return CheckOutcome("stops apart, counts", travel, most, bool(travel <= most), text)


def _unreached(low: int, high: int, na0: float | None) -> tuple[str, ...]:
    if high - low >= COUNTS_PER_TURN:
        return ("the travel is a turn or more: every azimuth is reached in the direct pointing",)
    size = (COUNTS_PER_TURN - (high - low)) * 360.0 / COUNTS_PER_TURN
    if na0 is None:
        return (f"{size:.2f} degrees of azimuth are not reached in the direct pointing",)
    first, last = ((n - na0) * 360.0 / COUNTS_PER_TURN for n in (high, low + COUNTS_PER_TURN))
    return (f"Theta from {first:.2f} to {last:.2f} degrees is not reached in the direct pointing, {size:.2f} degrees",)


RECIPE = CalibrationKind(
    "azimuth limits from touches of both mechanical stops",
    LAYOUT,
    calibrate_limits,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "counts", 1.0, "a stop gives way by less than a fifth of a degree"),
    ),
)
