"""Encoder errors beside the zero: eccentricity, ellipticity, higher orders.

Once a turn, twice, and more on request.

    N = zero + 1e5/(2 pi) psi + sum c_k cos k psi + s_k sin k psi

psi is the axis's own turn from the zero: Theta' of the mount, or Phi'/2, half the beam's. True turns come from a
polygon on the axis seen by an autocollimator, from targets at known directions, or from a divided table. How these
stand to the encoder's zero is found for each run; so a constant of the waves cannot be told and is not in them.

A polygon's own errors repeat from run to run; they are parameters with the priors of its certificate, and the more the
runs begin at different faces the better they are told from the encoder's. A polygon of n faces, read at these alone,
does not tell the order k from n - k: that gives a refusal or a large u, not a wrong number.
"""

from typing import Annotated, Literal

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, TWO_PI
from catseye.geometry.mirror.encoder import COUNTS_PER_RADIAN, COUNTS_PER_TURN
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
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

KIND = "encoder"
COUNTS = Within(-1_000_000, 1_000_000)
ANGLE = Within(-720, 720)
MANY = 1e6  # degrees of freedom: F is chi-square
FAR = 2000.0  # counts, 7 degrees: no disc is so far off its centre
TURN = np.linspace(0.0, TWO_PI, 721)


class EncoderSheet(Sheet):
    """Sheet of an encoder's calibration.

    axis                 "azimuth" or "elevation"
    angle_is             "axis" (the axis's turn) or "beam" (of the elevation: Phi, twice the mirror's turn)
    zero_counts          na0 or ne0 of the record: counts at psi = 0
    orders               number of estimated waves a turn (2)
    displays             "mirror" or "beam": angle on the scale of the column reading_arcsec
    reading_sign         1 if a reading grows as the axis turns on, -1 if it falls
    u_face_arcsec        of each face of the polygon (column face), by its certificate
    u_reading_arcsec     scatter of an angle, as an angle of the axis, if known
    u_counts             of each count by itself: a servo settles within one
    """

    axis: Literal["azimuth", "elevation"]
    angle_is: Literal["axis", "beam"] = "axis"
    zero_counts: Annotated[float, COUNTS]
    orders: Annotated[int, Within(1, 8)] = 2
    displays: Literal["beam", "mirror"] = "mirror"
    reading_sign: Literal[1, -1] = 1
    u_face_arcsec: Annotated[float, Within(0, 3600)] | None = None
    u_reading_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    u_counts: Annotated[float, Within(0, 100)] = 0.29


LAYOUT = SheetLayout(
    KIND,
    EncoderSheet,
    required={"angle_deg": ANGLE, "counts": COUNTS},
    optional={"reading_arcsec": Within(-7200, 7200), "face": TEXT, "run": TEXT},
)


def calibrate_encoder(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Waves of an encoder, counts, from true turns of its axis.

    readings   columns angle_deg (true turn from the run's first direction, growing as the counts grow) and counts;
               perhaps reading_arcsec (autocollimator, added), face (of a polygon), run (a word: set up once);
               sheet EncoderSheet
    reject     leave out what the tests reject

    Raises EstimationError where the angles do not separate all orders.

    Source: [PARKER04] eq. 2.21 and 2.22 are the encoder without waves; a Fourier series of them, tested order by order.
    """
    sheet, m = readings.sheet, len(readings)
    if sheet.axis == "azimuth" and sheet.angle_is == "beam":
        raise refusal(readings.sheet_file, "angle_is = 'beam' belongs to axis = 'elevation' (expected 'axis')")
    turn = readings.get("angle_deg") * DEGREE * (0.5 if sheet.angle_is == "beam" else 1.0)
    if "reading_arcsec" in readings.numbers:
        display_factor = 0.5 if sheet.displays == "beam" else 1.0
        turn = turn + sheet.reading_sign * display_factor * readings.get("reading_arcsec") * ARCSECOND
    runs, which = _labels(readings, "run")
    faces, face = _labels(readings, "face")
    if "face" in readings.words and sheet.u_face_arcsec is None:
        raise refusal(readings.sheet_file, "u_face_arcsec is missing (expected with the column face)")
    counts, order = readings.get("counts"), np.arange(1, sheet.orders + 1)
    off = (counts - sheet.zero_counts) / COUNTS_PER_RADIAN - turn
    for k in range(len(runs)):  # a table that begins again at 360 degrees: the counts decide the whole turns
        rows = which == k
        whole_turns = TWO_PI * np.round((off[rows] - off[rows][0]) / TWO_PI)
        turn[rows], off[rows] = turn[rows] + whole_turns, off[rows] - whole_turns
    _refuse_far(readings, which, off)
    parameters = _parameters(sheet, runs, which, off)
    if "face" in readings.words:
        u = sheet.u_face_arcsec * ARCSECOND
        parameters += [ModelParameter(f"face {name}", 0.0, 1e-5, u, "rad") for name in faces]
    waves, n = 2 * sheet.orders, len(runs)

    def predict(values: np.ndarray) -> np.ndarray:
        psi = turn + values[waves : waves + n][which]
        if "face" in readings.words:
            psi = psi + values[waves + n :][face]
        return sheet.zero_counts + COUNTS_PER_RADIAN * psi + _wave(psi, values[:waves], order)

    eye = np.eye(m)
    scatter = ObservedScatter(sheet.u_counts**2 * eye, {"scatter of an angle, as counts": eye}, size=COUNTS_PER_TURN)
    if sheet.u_reading_arcsec is not None:
        u = sheet.u_reading_arcsec * ARCSECOND * COUNTS_PER_RADIAN
        scatter = ObservedScatter((sheet.u_counts**2 + u**2) * eye)
    solution = fit_curved(
        counts,
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, solution, turn + solution.values[waves : waves + n][which])


def _labels(readings: SheetReadings, name: str) -> tuple[list[str], np.ndarray]:
    """Distinct words of a column and (m,) their index.

    A single one without such a column.
    """
    words = readings.words.get(name, ("",) * len(readings))
    names = list(dict.fromkeys(words))
    return names, np.array([names.index(word) for word in words])


def _refuse_far(readings: SheetReadings, which: np.ndarray, off: np.ndarray) -> None:
    """Raise InputError for counts that do not follow the angles.

    Such are no waves: another unit, sense or axis.
    """
    for row in np.flatnonzero(readings.active):
        run = (which == which[row]) & readings.active
        far = float(COUNTS_PER_RADIAN * (off[row] - np.median(off[run])))
        if abs(far) > FAR:
            raise readings.refuse(
                int(row),
                f"counts = {readings.get('counts')[row]:g} lie {far:+.0f} from where the run's angles have them "
                f"(expected within {FAR:g}: do counts and angles grow together, is angle_is right?)",
            )


def _wave(psi: np.ndarray, terms: np.ndarray, order: np.ndarray) -> np.ndarray:
    angle = psi[:, None] * order
    return np.cos(angle) @ terms[: len(order)] + np.sin(angle) @ terms[len(order) :]


def _parameters(sheet: EncoderSheet, runs: list[str], which: np.ndarray, off: np.ndarray) -> list[ModelParameter]:
    """Parameters: cosines, sines, then the start of each run."""
    waves = [f"{part} {k}" for part in ("cosine", "sine") for k in range(1, sheet.orders + 1)]
    return [ModelParameter(name, 0.0, 0.1) for name in waves] + [
        ModelParameter(f"start of run {name}".rstrip(), float(np.median(off[which == k])), 1e-5)
        for k, name in enumerate(runs)
    ]


def _calibration(readings: SheetReadings, solution: CurvedFit, psi: np.ndarray) -> Calibration:
    sheet, fit, n = readings.sheet, solution.fit, readings.sheet.orders
    selection = [
        (f"{part} {k}", f"{sheet.axis}_encoder_{part}_{k}_counts", "counts", "term of what it reads too high", 1.0)
        for part in ("cosine", "sine") for k in range(1, n + 1)
    ]  # fmt: skip
    calibrated, covariance = solution.quantities(selection)
    values = [q.value for q in calibrated]
    record: dict[str, RecordValue] = {
        f"{sheet.axis}_encoder_cosine_counts": values[:n],
        f"{sheet.axis}_encoder_sine_counts": values[n:],
        "u_encoder_counts": max(q.u for q in calibrated),
    }
    order, terms = np.arange(1, n + 1), np.array(values)
    grid = np.linspace(psi.min(), psi.max(), 361)
    observed = _wave(psi, terms, order) + fit.residual
    on = fit.active
    rows = tuple(
        (readings.words["run"][k] if "run" in readings.words else "", float(psi[k] / DEGREE),
         float(readings.get("counts")[k]), float(fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"{sheet.axis.capitalize()} encoder of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("run", "psi_deg", "counts", "residual_counts", fit.test, "state"),
        rows=rows,
        decisions=(*_order_decisions(solution, n, sheet.level), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the waves reach {np.abs(_wave(TURN, terms, order)).max():.2f} counts; one count is "
            f'{DEGREE / ARCSECOND * 360 / COUNTS_PER_TURN:.2f}" of the axis',
            *scatter_notes(fit, "counts", 1.0, sought=2 * n),
        ),
        curve={
            "readings": (psi[on] / DEGREE, observed[on]),
            "left out": (psi[~on] / DEGREE, observed[~on]),
            "fit": (grid / DEGREE, _wave(grid, terms, order)),
            "residuals": (psi[on] / DEGREE, fit.residual[on]),
        },
        axes=("turn of the axis from the zero (degrees)", "encoder reads too high (counts)"),
        method="Counts against true turns of the axis: a start for each run and waves of once, twice, ... a turn are "
        "adjusted together. The faces of a polygon are parameters with the priors of its certificate.",
        record=record,
    )


def _order_decisions(solution: CurvedFit, n: int, level: float) -> tuple[CheckOutcome, ...]:
    """Significance test of each order by its squared Mahalanobis distance.

    From zero.

    Chi-square of two degrees where the scatter is claimed, else twice Fisher's F with the scatter's own degrees.

    Source: [FOERSTNER16] chapter 4, test of a group of parameters.
    """
    from scipy.special import fdtri

    outcomes = []
    sought = [p.name for p in solution.parameters if np.isinf(p.u)]
    for k in range(1, n + 1):
        at = [solution.index(f"cosine {k}"), solution.index(f"sine {k}")]
        pair = solution.values[at]
        statistic = float(pair @ np.linalg.solve(solution.covariance[np.ix_(at, at)], pair))
        degrees = min(solution.fit.effective[sought.index(f"{part} {k}")] for part in ("cosine", "sine"))
        # chi-square of two degrees is exponential
        limit = 2.0 * fdtri(2.0, degrees, 1.0 - level / n) if degrees < MANY else -2.0 * np.log(level / n)
        size = float(np.hypot(*pair))
        text = f"{size:.3g} counts, {'more than chance makes' if statistic > limit else 'which chance makes as well'}"
        outcomes.append(CheckOutcome(f"order {k}: squared distance from none", statistic, float(limit), None, text))
    return tuple(outcomes)


RECIPE = CalibrationKind(
    "an encoder's waves, once and twice a turn, from true angles",
    LAYOUT,
    calibrate_encoder,
    plausible=Plausibility(
        scatter=ReadingScatter(1.0, "counts", 1.0, "a servo settles within a count [PARKER04] section 2.4"),
        sizes={"*_counts": PlausibleSpan(-200.0, 200.0, "0.7 degrees: no disc is so far off its centre", u=20.0)},
        varying={"angle_deg": 360.0},
    ),
)
