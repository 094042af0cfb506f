"""Light back into the laser, by the scatter of a phase beyond its noise.

The fringe of the returned light runs through a period for each half wavelength of light, 0.4 µm, that the path changes:
from shot to shot it is noise of its own size, whatever the return's amplitude. Readings of a target whose path is moved
by some micrometres, or that moves by itself, hold it beside the noise of the samples, which is known.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from catseye.constants import MILLIRADIAN, TWO_PI
from catseye.errors import EstimationError
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.kind import CalibrationKind, Plausibility, PlausibleSpan, provenance, quantities

KIND = "feedback"
PHASE, VOLTS = Within(-2 * TWO_PI, 2 * TWO_PI), Within(0, 20, above=True)
LEVEL = 0.05  # chance of an excess that is none
DRIFT = 3.1  # standard deviations of the ratio of steps: once in a thousand
FEWEST = 10  # readings beyond the means of their sets: u of the excess is then a quarter of it


class FeedbackSheet(Sheet):
    """Sheet of a calibration of light back into the laser.

    u_phasor_volt   of each quadrature of one phasor: u of phase is this over the amplitude
    u_walk_rad      of the electronics' walk between neighbouring readings
    """

    u_phasor_volt: Annotated[float, Within(0, 1, above=True)]
    u_walk_rad: Annotated[float, Within(0, 0.1)] = 0.0


LAYOUT = SheetLayout(
    KIND,
    FeedbackSheet,
    required={"set": TEXT, "phase_target_rad": PHASE, "amplitude_target_volt": VOLTS},
    optional={"phase_reference_rad": PHASE, "amplitude_reference_volt": VOLTS},
)


def calibrate_feedback(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Standard deviation of a shot's phase by light back into the laser.

    readings   columns set (readings whose path differs by micrometres alone), phase and amplitude; sheet FeedbackSheet
    reject     has no effect: wrong readings are left out by a reason in left_out

    The mean square within sets, less what the samples' noise explains; its u is that of a chi-square. Raises
    EstimationError for fewer than 10 degrees of freedom, and where weak readings hide the excess of strong ones.

    Source: [PARKER04] chapter 6, item 4, names the cause; `signal.systematics.feedback` has the sizes.
    """
    from scipy.stats import chi2

    sheet, on = readings.sheet, np.flatnonzero(readings.active)
    sets = readings.words["set"]
    phase, noise = _phases(readings)
    means = {name: _mean_angle(phase[[k for k in on if sets[k] == name]]) for name in dict.fromkeys(sets)}
    departure = np.array([float(np.angle(np.exp(1j * (phase[k] - means[sets[k]])))) for k in range(len(phase))])
    degrees = len(on) - len({sets[k] for k in on})
    if degrees < FEWEST:
        raise EstimationError(
            f"{readings.file}: {degrees} readings beyond the means of their sets (expected {FEWEST} or more)"
        )
    square = float(np.sum(departure[on] ** 2)) / degrees
    expected = float(np.mean(noise[on] ** 2)) + sheet.u_walk_rad**2
    excess = square - expected
    u_square = square * np.sqrt(2.0 / degrees)
    value = np.sqrt(max(excess, 0.0))
    limit = float(chi2.isf(LEVEL, degrees)) / degrees
    steps = _steps(departure, on, sets)
    statistic = float(np.sum(departure[on] ** 2 / (noise[on] ** 2 + sheet.u_walk_rad**2))) / degrees
    significant = statistic > limit
    upper = float(np.sqrt(max(square * degrees / float(chi2.ppf(LEVEL, degrees)) - expected, 0.0)))
    if significant and excess <= 0.0:
        raise EstimationError(
            f"{readings.file}: the strong readings scatter more than their noise, but the weak ones' noise, up to "
            f"{float(np.max(noise[on])) / MILLIRADIAN:.3g} mrad, hides by how much (expected similar amplitudes: leave "
            "the weak ones out)"
        )
    slope = 0.5 / value if significant else 0.5 / max(np.sqrt(u_square), np.finfo(float).tiny)
    inputs = [
        SharedInput(
            "mean square of the phases",
            float(u_square),
            "rad²",
            np.array([slope]),
            evaluation="A",
            distribution="chi-square, to first order",
        )
    ]
    covariance = np.array([[(slope * u_square) ** 2]])
    number = np.arange(1, len(phase) + 1)
    return Calibration(
        kind=KIND,
        title=f"Light back into the laser of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities(
            [("feedback_rad", "rad", "standard deviation of a shot's phase by the fringe of its own light")],
            np.array([value]),
            covariance,
            inputs=inputs,
        ),
        covariance=covariance,
        columns=("set", "phase_rad", "departure_mrad", "noise_mrad", "state"),
        rows=tuple(
            (
                sets[k],
                float(phase[k]),
                float(departure[k] / MILLIRADIAN),
                float(noise[k] / MILLIRADIAN),
                f"left out: {readings.left_out[k]}" if readings.left_out[k] else "used",
            )
            for k in range(len(phase))
        ),
        decisions=(
            CheckOutcome(
                "scatter beyond the noise: mean square over the expected",
                statistic,
                limit,
                None,
                "light comes back into the laser" if significant else "the noise of the samples explains all",
            ),
            CheckOutcome(
                "readings do not follow each other: mean square step over twice the mean square",
                steps.ratio,
                steps.limit,
                steps.ratio >= steps.limit,
                "neighbours are as far apart as any others"
                if steps.ratio >= steps.limit
                else "neighbours are alike: the path or the electronics drift within a set, and their drift would be "
                "called light",
                least=True,
            ),
        ),
        degrees_of_freedom=degrees,
        notes=(
            f"scatter {np.sqrt(square) / MILLIRADIAN:.3g} mrad, of which the samples explain "
            f"{np.sqrt(expected) / MILLIRADIAN:.3g} mrad; with 95 % the rest is below {upper / MILLIRADIAN:.3g} mrad",
            "a path at rest to 0.1 µm shows one fringe alone, which no scatter tells from the distance",
        ),
        curve={
            "readings": (number[on], departure[on] / MILLIRADIAN),
            "fit": (number, np.zeros(len(number))),
        },
        axes=("reading", "phase less the mean of its set (mrad)"),
        method="The phase of one target is read many times while its path changes by micrometres. The mean square of "
        "the phases about the means of their sets, less what the noise of the samples explains, is that of the fringe "
        "of light back into the laser.",
        record={"u_feedback_rad": float(value if significant else upper)} if upper > 0.0 else {},
    )


class StepRatio(NamedTuple):
    """Von Neumann's ratio of neighbouring readings, 1 for independent ones, and its least value for these."""

    ratio: float
    limit: float


def _steps(departure: np.ndarray, on: np.ndarray, sets: Sequence[str]) -> StepRatio:
    """Mean square of the steps within sets over twice the mean square about their means.

    A step is that to the set's next reading, also where other sets were read in between. Of independent readings the
    ratio is 1 with the variance 1/n, whatever their distribution, for many readings.
    """
    names = np.array([sets[k] for k in on])
    step = np.concatenate([np.diff(departure[on][names == name]) for name in np.unique(names)])
    squares = float(np.sum(departure[on] ** 2)) / len(step)
    ratio = float(np.mean(step**2) / (2.0 * squares)) if squares > 0.0 else 1.0
    return StepRatio(ratio, 1.0 - DRIFT / np.sqrt(len(step)))


def _phases(readings: SheetReadings) -> tuple[np.ndarray, np.ndarray]:
    """Phases after the reference's where there is one, rad, and the standard uncertainty of each by the samples."""
    phase = readings.get("phase_target_rad")
    noise = readings.sheet.u_phasor_volt / readings.get("amplitude_target_volt")
    if "phase_reference_rad" in readings.numbers:
        phase = phase - readings.get("phase_reference_rad")
        noise = np.hypot(noise, readings.sheet.u_phasor_volt / readings.get("amplitude_reference_volt"))
    return phase, noise


def _mean_angle(phase: np.ndarray) -> float:
    return float(np.angle(np.mean(np.exp(1j * phase)))) if len(phase) else float("nan")


RECIPE = CalibrationKind(
    "light back into the laser, by the scatter of a phase beyond its noise",
    LAYOUT,
    calibrate_feedback,
    plausible=Plausibility(
        sizes={"feedback_rad": PlausibleSpan(0.0, 0.05, "0.8 mm of range from shot to shot would be seen by eye")},
        varying={"phase_target_rad": 0.0},
    ),
)
