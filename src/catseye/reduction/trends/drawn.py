"""Series of an archive as a figure shows them: posture, temperature and season taken off, time and steps left."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.reduction.trends.alarms import AlarmKind, TrendAlarm, TrendQuantity
from catseye.reduction.trends.bodies import BodyTrend
from catseye.reduction.trends.functions import YEAR, TrendFunctions
from catseye.reduction.trends.instruments import InstrumentTrend
from catseye.reduction.trends.trends import TrendFindings

CHANGES = (AlarmKind.STEP, AlarmKind.DRIFT, AlarmKind.DEPARTED, AlarmKind.AGES)


@dataclass(frozen=True, eq=False)
class DrawnSeries:
    """Series of one quantity.

    quantity   of it
    subject    point, body, ranger or station
    part       body or parameter
    mjd        (T,) days
    value, u   (T,) m, degrees C or the parameter's unit; NaN where there is none
    model      (T,) drift and steps
    outlier    (T,) True for readings that were left out
    steps      MJD of the steps
    prior, u_prior   of the newest calibration; NaN without
    """

    quantity: TrendQuantity
    subject: str
    part: str
    mjd: Array
    value: Array
    u: Array
    model: Array
    outlier: np.ndarray
    steps: tuple[float, ...]
    prior: float = float("nan")
    u_prior: float = float("nan")


def drawn_series(findings: TrendFindings, alarms: tuple[TrendAlarm, ...]) -> list[DrawnSeries]:
    """Series of points and instruments with a change, each once, in the alarms' order."""
    found: dict[tuple[TrendQuantity, str, str], DrawnSeries] = {}
    for alarm in alarms:
        key = (alarm.quantity, alarm.subject, alarm.part)
        if alarm.kind not in CHANGES or key in found:
            continue
        if alarm.quantity is TrendQuantity.POINT:
            for body in findings.bodies:
                if body.name == alarm.part and alarm.subject in body.points.names:
                    found[key] = point_series(body, body.points.names.index(alarm.subject))
        for quantity, trend in findings.instruments:
            same = quantity is alarm.quantity and alarm.part in ("", trend.parameter)
            if same and alarm.subject in trend.subjects:
                found[key] = instrument_series(quantity, trend, trend.subjects.index(alarm.subject))
    return list(found.values())


def point_series(body: BodyTrend, point: int) -> DrawnSeries:
    """Place of a point along its largest change: its steps' direction, or its drift's."""
    steps_of_point = [step for step in body.own.steps if step.series == point]
    coefficients = np.nan_to_num(body.own.fit.coefficients[point])
    if steps_of_point:
        change = max((step.size for step in steps_of_point), key=lambda size: float(np.linalg.norm(size)))
    else:
        change = coefficients[body.functions.names.index(YEAR)] if YEAR in body.functions.names else np.ones(3)
    size = float(np.linalg.norm(change))
    along = change / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
    rows = body.functions.rows(body.points.elevation, body.points.temperature_c, body.points.mjd)
    value = body.displacement[:, point] @ along
    u = np.sqrt(np.maximum(np.einsum("i,tij,j->t", along, body.spread[:, point], along), 0.0))
    model = np.zeros(len(value))
    for step in steps_of_point:
        model[step.at :] += float(step.size @ along)
    value, model = _lasting(value, model, rows, coefficients @ along, body.functions)
    return DrawnSeries(
        quantity=TrendQuantity.POINT,
        subject=body.points.names[point],
        part=body.name,
        mjd=body.points.mjd,
        value=value,
        u=u,
        model=model,
        outlier=body.outlier[:, point],
        steps=tuple(float(body.points.mjd[step.at]) for step in steps_of_point),
    )


def instrument_series(quantity: TrendQuantity, trend: InstrumentTrend, series: int) -> DrawnSeries:
    """Values of an instrument at the mean temperature."""
    return DrawnSeries(
        quantity=quantity,
        subject=trend.subjects[series],
        part=trend.parameter,
        mjd=trend.mjd,
        value=trend.values[:, series],
        u=trend.u[:, series],
        model=trend.model[:, series],
        outlier=trend.outlier[:, series],
        steps=tuple(float(trend.mjd[step.at]) for step in trend.found.steps if step.series == series),
        prior=float(trend.prior[series]),
        u_prior=float(trend.u_prior[series]),
    )


def motion_series(body: BodyTrend) -> tuple[Array, Array]:
    """Shift and turn (T, 6) of each night less its elevation terms' complement, and the model of elevation.

    The first has temperature, time, season and steps taken off, at the reference of the model; the second is the
    model's part by elevation alone. m and rad.
    """
    motion = body.motion
    assert motion is not None  # its caller looked
    rows = body.functions.rows(body.points.elevation, body.points.temperature_c, body.points.mjd)
    waves = np.array(["E" in name for name in body.functions.names])
    level = motion.found.level(len(rows))[:, 0] * motion.scale
    others = rows[:, ~waves] @ motion.coefficients[~waves] + level
    return motion.values - others, rows[:, waves] @ motion.coefficients[waves]


def _lasting(
    value: Array, steps: Array, rows: Array, coefficients: Array, functions: TrendFunctions
) -> tuple[Array, Array]:
    """Values with all but time and steps taken off, and the model of these."""
    time = np.array([name == YEAR for name in functions.names])
    others = rows[:, ~time] @ coefficients[~time]
    return value - others, rows[:, time] @ coefficients[time] + steps
