"""Repeatability of ranges to one target, within and between sets."""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.quality.repeatability import Repeatability
from catseye.estimation.quality.repeatability import repeatability as analysed
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.kind import CalibrationKind, Plausibility, PlausibleSpan, provenance, quantities

KIND = "repeatability"
MICROMETRE = 1e-3 * MILLIMETRE


class RepeatabilitySheet(Sheet):
    """Sheet of a repeatability test.

    test_level   significance level of the F test that the sets agree
    """

    test_level: Annotated[float, Within(0, 0.5, above=True)] = 0.05


LAYOUT = SheetLayout(KIND, RepeatabilitySheet, required={"set": TEXT, "range_m": Within(-1e5, 1e5)})


def measure_repeatability(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Standard deviations within and between sets, with a test.

    The test is whether the sets differ.

    readings   columns set (a day, a pointing, an operator) and range_m, all of one target; sheet RepeatabilitySheet
    reject     has no effect: wrong readings are left out by a reason in left_out

    Raises ValidityError where the readings do not tell the two scatters apart.

    Source: [ISO19] section 7.4; u of a standard deviation s of v degrees of freedom is s/sqrt(2 v).
    """
    from scipy.special import stdtrit

    on = np.flatnonzero(readings.active)
    value = readings.get("range_m") / MICROMETRE
    sets = readings.words["set"]
    for row, name in enumerate(sets):
        if not name:
            raise readings.refuse(row, "set is empty (expected a word for it)")
    analysis = analysed(value[on], [sets[k] for k in on], level=readings.sheet.test_level)
    means = dict.fromkeys(sets, float("nan"))  # of a set that is left out as a whole nothing is known
    means |= {name: float(np.mean([value[k] for k in on if sets[k] == name])) for name in {sets[k] for k in on}}
    rows = tuple(
        (sets[k], float(value[k] * MICROMETRE), float(value[k] - means[sets[k]]), float(means[sets[k]] - analysis.mean),
         f"left out: {readings.left_out[k]}" if readings.left_out[k] else "used")
        for k in range(len(readings))
    )  # fmt: skip
    keys = [
        ("repeatability_um", "µm", "standard deviation of a range within its set"),
        ("between_um", "µm", "standard deviation from set to set beyond that"),
        ("intermediate_um", "µm", "standard deviation of a range at another time"),
    ]
    values, inputs = _deviations(analysis)
    covariance = np.sum([each.covariance for each in inputs], axis=0)
    number = np.arange(1, len(readings) + 1)
    return Calibration(
        kind=KIND,
        title=f"Repeatability of {readings.sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities(keys, values, covariance, inputs=inputs),
        covariance=covariance,
        columns=("set", "range_m", "within_um", "set_um", "state"),
        rows=rows,
        decisions=(
            CheckOutcome(
                "sets agree: F",
                analysis.f,
                analysis.f_limit,
                not analysis.sets_differ,
                "the sets differ by more than their readings scatter"
                if analysis.sets_differ
                else "no set stands apart",
            ),
        ),
        degrees_of_freedom=analysis.degrees_within,
        notes=(
            f"mean {analysis.mean * MICROMETRE:.6f} m, u {analysis.u_mean:.2g} µm by the scatter alone, of "
            f"{analysis.degrees_between} degrees of freedom: {stdtrit(analysis.degrees_between, 0.975):.2f} u for 95 %",
        ),
        curve={
            "readings": (number[on], value[on] - analysis.mean),
            "fit": (number, np.array([means[name] for name in sets]) - analysis.mean),
        },
        axes=("reading", "range less the mean (µm); line: its set"),
        method="One-way analysis of variance: the scatter of readings about the mean of their set, and of the sets' "
        "means beyond what that explains.",
        record={key: float(v) for (key, *_), v in zip(keys, values, strict=True)},
    )


def _deviations(analysis: Repeatability) -> tuple[np.ndarray, list[SharedInput]]:
    """Within, between and intermediate standard deviation, with the inputs of their u.

    To first order.

    The mean squares are independent, each of variance 2 s^4 / v; between^2 is their difference over the size of a set.
    """
    within, between = analysis.within**2, analysis.between**2
    size = analysis.usual  # readings a set that count
    squares = np.array([within, analysis.f * within])
    u_squares = squares * np.sqrt(2.0 / np.array([analysis.degrees_within, analysis.degrees_between]))
    by_square = np.array([[1.0, 0.0], [-1.0 / size, 1.0 / size], [1.0 - 1.0 / size, 1.0 / size]])
    values = np.array([analysis.within, analysis.between, analysis.intermediate])
    moved = by_square * u_squares
    size_of = values.copy()
    if between == 0.0:  # its square is uncertain all the same, its root as the root of that
        size_of[1] = 0.5 * float(moved[1] @ moved[1]) ** 0.25
    slopes = by_square * (0.5 / size_of)[:, None]
    names = ("mean square within sets", "mean square between sets")
    return values, [
        SharedInput(name, float(u), "µm²", slope, evaluation="A", distribution="chi-square, to first order")
        for name, u, slope in zip(names, u_squares, slopes.T, strict=True)
    ]


RECIPE = CalibrationKind(
    "scatter of ranges within and between sets",
    LAYOUT,
    measure_repeatability,
    plausible=Plausibility(
        sizes={
            "*_um": PlausibleSpan(
                0.0, 1e3, "60 mrad of phase, half a wavelength of 0.1 m: twenty times a ranger's noise"
            )
        },
    ),
)
