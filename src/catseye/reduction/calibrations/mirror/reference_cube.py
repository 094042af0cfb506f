"""Reference cube ZRG: counts at which the beam meets it, from scans of the return in azimuth and elevation.

    amplitude = peak exp(-((azimuth - azm) / w_az)^2 / 2 - ((elevation - elv) / w_el)^2 / 2)

The return is symmetric about the counts at which the beam meets the cube's corner; a Gaussian beam on a corner is
nearly a Gaussian in both axes. A peak between steps, a scan that begins far off and an axis that was not quite on the
cube while the other was scanned are thereby all the same adjustment. Scans in both senses show play: the counts lag by
half of it, one way and the other, and their mean is right.
"""

from typing import Annotated

import numpy as np

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
    PlausibleSpan,
    ReadingScatter,
    provenance,
    scatter_notes,
)

KIND = "reference-cube"
COUNTS = Within(-1_000_000, 1_000_000)
SENSES = {"up": 1.0, "down": -1.0}
AXES = ("azimuth", "elevation")
LEAST_SIDE = 2  # readings on each side of the peak, in each axis


class ReferenceCubeSheet(Sheet):
    """Sheet of scans over the reference cube.

    u_amplitude_volt   scatter of one amplitude, if known
    u_counts           of the counts of each axis, common to all readings: settling of the servo
    """

    u_amplitude_volt: Annotated[float, Within(0, 10, above=True)] | None = None
    u_counts: Annotated[float, Within(0, 100)] = 0.5


LAYOUT = SheetLayout(
    KIND,
    ReferenceCubeSheet,
    required={"azimuth_counts": COUNTS, "elevation_counts": COUNTS, "amplitude_volt": Within(0, 20)},
    optional={"sense": TEXT},
)


def calibrate_reference_cube(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Counts of both axes that point at the reference cube, with play.

    readings   columns azimuth_counts, elevation_counts, amplitude_volt; perhaps sense ("up" where counts grew before
               the reading, "down"); sheet ReferenceCubeSheet
    reject     leave out what the tests reject

    Raises InputError for an unknown sense and a scan that has not passed the peak in both axes.

    Source: [PARKER04] section 7.1.6, which has its heading alone; AZM ZRG and ELV ZRG of figure 2.4.
    """
    sheet, m = readings.sheet, len(readings)
    counts = np.stack([readings.get("azimuth_counts"), readings.get("elevation_counts")], axis=1)
    volts = readings.get("amplitude_volt")
    sense = _senses(readings)
    peak = counts[int(np.argmax(np.where(readings.active, volts, -1.0)))]
    _refuse_one_sided(readings, counts, peak)
    with_play = bool(np.any(sense > 0.0) and np.any(sense < 0.0))
    widths = [float(np.ptp(counts[:, k])) / 5.0 for k in range(2)]
    parameters = [
        ModelParameter("azimuth", float(peak[0]), 0.05),
        ModelParameter("elevation", float(peak[1]), 0.05),
        ModelParameter("width in azimuth", widths[0], 0.05),
        ModelParameter("width in elevation", widths[1], 0.05),
        ModelParameter("peak", float(volts[readings.active].max()), 1e-4),
    ]
    parameters += [ModelParameter(f"settling in {axis}", 0.0, 0.05, sheet.u_counts, "counts") for axis in AXES]
    if with_play:
        parameters.append(ModelParameter("play", 0.0, 0.05))

    def predict(values: np.ndarray) -> np.ndarray:
        lag = 0.5 * values[7] * sense if with_play else 0.0
        off = [(counts[:, k] - lag - values[k] - values[5 + k]) / values[2 + k] for k in range(2)]
        return values[4] * np.exp(-0.5 * (off[0] ** 2 + off[1] ** 2))

    eye = np.eye(m)
    scatter = (
        ObservedScatter(np.zeros((m, m)), {"scatter of one amplitude": eye})
        if sheet.u_amplitude_volt is None
        else ObservedScatter(sheet.u_amplitude_volt**2 * eye)
    )
    solution = fit_curved(
        volts,
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, solution, with_play=with_play)


def _senses(readings: SheetReadings) -> np.ndarray:
    """Sign (m,) of each reading's approach; 0 without the column."""
    words = readings.words.get("sense", ("",) * len(readings))
    for row, word in enumerate(words):
        if "sense" in readings.words and word not in SENSES:
            raise readings.refuse(row, f"sense = {word!r} (expected 'up' or 'down')")
    return np.array([SENSES.get(word, 0.0) for word in words])


def _refuse_one_sided(readings: SheetReadings, counts: np.ndarray, peak: np.ndarray) -> None:
    """Raise InputError where an axis has too few readings on one side of the strongest return."""
    for k, axis in enumerate(AXES):
        off = counts[readings.active, k] - peak[k]
        if np.count_nonzero(off < 0.0) < LEAST_SIDE or np.count_nonzero(off > 0.0) < LEAST_SIDE:
            raise refusal(
                readings.file,
                f"the scan in {axis} has not passed its peak at {peak[k]:.0f} counts (expected {LEAST_SIDE} readings "
                "or more on each side)",
            )


def _calibration(readings: SheetReadings, solution: CurvedFit, *, with_play: bool) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    keys = [
        ("azimuth", "azm_zrg_counts", "counts", "azimuth counts that point at the reference cube", 1.0),
        ("elevation", "elv_zrg_counts", "counts", "elevation counts that point at it", 1.0),
        ("width in azimuth", "width_azimuth_counts", "counts", "standard deviation of the return in azimuth", 1.0),
        (
            "width in elevation",
            "width_elevation_counts",
            "counts",
            "standard deviation of the return in elevation",
            1.0,
        ),
        ("peak", "peak_volt", "V", "amplitude at the cube", 1.0),
    ]
    if with_play:
        keys.append(("play", "play_counts", "counts", "counts going up less going down, at the same place", 1.0))
    calibrated, covariance = solution.quantities(keys)
    counts = [readings.get(f"{axis}_counts") for axis in AXES]
    rows = tuple(
        (float(counts[0][k]), float(counts[1][k]), float(readings.get("amplitude_volt")[k]),
         float(1e3 * fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    on, place = fit.active, np.arange(1, len(readings) + 1)
    return Calibration(
        kind=KIND,
        title=f"Reference cube of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("azimuth_counts", "elevation_counts", "amplitude_volt", "residual_mv", fit.test, "state"),
        rows=rows,
        decisions=(_narrow(solution), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=scatter_notes(fit, "mV", 1e-3),
        curve={
            "readings": (place[on], 1e3 * (fit.predicted + fit.residual)[on]),
            "left out": (place[~on], 1e3 * (fit.predicted + fit.residual)[~on]),
            "fit": (place, 1e3 * fit.predicted),
        },
        axes=("reading", "amplitude (mV)"),
        method="Amplitudes of scans over the cube in azimuth and elevation are one Gaussian in both axes; its centre "
        "is where the beam meets the cube. The settling of both axes is a parameter with a prior. Readings after "
        "counts that grew and that fell show the play.",
        record={
            "azm_zrg": round(solution.value("azimuth")),
            "elv_zrg": round(solution.value("elevation")),
        },
    )


def _narrow(solution: CurvedFit) -> CheckOutcome:
    """Check that the centre is known to a tenth of the return's width."""
    share = max(solution.u(axis) / abs(solution.value(f"width in {axis}")) for axis in AXES)
    text = "centre known well within the return: the cube is met"
    return CheckOutcome("u of the centre over the width", float(share), 0.1, bool(share <= 0.1), text)


RECIPE = CalibrationKind(
    "counts that point at the reference cube ZRG, from scans of its return",
    LAYOUT,
    calibrate_reference_cube,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "mV", 1e-3, "a hundredth of the usual return of the cube, 5 V"),
        explained=0.95,
        sizes={
            "width_*_counts": PlausibleSpan(1.0, 2000.0, "beam of some cm on a cube at 0.2 m: 0.1 to 7 degrees"),
            "play_counts": PlausibleSpan(-30.0, 30.0, "a tenth of a degree: the encoder is on the axis"),
            "peak_volt": PlausibleSpan(0.05, 10.0, "converter of 10 V"),
        },
        columns={"amplitude_volt": PlausibleSpan(0.0, 10.0, "converter of 10 V")},
        varying={"azimuth_counts": 0.0, "elevation_counts": 0.0},
    ),
)
