"""Alarms of an archive's trends: what changed, drifts, ages or is missing, each with its numbers."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.estimation.series.correlated import measured
from catseye.reduction.trends.bodies import BodyTrend, MotionTrend
from catseye.reduction.trends.functions import DAYS_PER_YEAR, TrendFunctions
from catseye.reduction.trends.instruments import InstrumentTrend, drift_probability
from catseye.reduction.trends.tables import ArchivedNights

COVERAGE = 2.0  # standard uncertainties of an expanded uncertainty
SURE = 3.0  # standard uncertainties of a departure
SOON = 60.0  # days before a certificate ends
GAP = 5.0  # usual distances of two nights: a longer time without is a gap
MANY_OUTLIERS = 0.05  # of the readings of a series
SCATTER = 1.5  # times the claimed standard uncertainty


class Severity(Enum):
    """Severity of an alarm, the worst first."""

    ALARM = "alarm"
    WARNING = "warning"
    NOTE = "note"


class AlarmKind(Enum):
    """Kind of an alarm, as reports print it."""

    STEP = "step"
    DRIFT = "drift"
    DEPARTED = "departed from its calibration"
    AGES = "leaves its calibration"
    EXPIRED = "certificate ended"
    EXPIRES = "certificate ends"
    OUTLIERS = "outliers"
    SCATTER = "scatter"
    GAP = "nights missing"
    FAILED = "nights failed"


class TrendQuantity(Enum):
    """Quantity of a series, as reports print it."""

    POINT = "point"
    BODY = "body"
    ZERO = "zero"
    PARAMETER = "parameter"
    THERMOMETER = "thermometer against the ranges"
    STATION = "thermometer against the stations"
    SCALE = "scale of the ground"
    CERTIFICATE = "certificate"
    NIGHTS = "nights"


@dataclass(frozen=True, eq=False)
class TrendAlarm:
    """One alarm; lengths are m, temperatures degrees C, drifts are per year.

    severity      of it
    kind          of it
    quantity      of its series
    subject       point, body, ranger, station or instrument
    mjd           when it was or will be; NaN: over all nights
    value, u      size; NaN without
    limit         with which it was compared; NaN without
    probability   without a cause, for all series together; NaN where it is no test
    count         readings or nights concerned
    part          of the subject: a parameter, a body, a file
    """

    severity: Severity
    kind: AlarmKind
    quantity: TrendQuantity
    subject: str
    mjd: float = float("nan")
    value: float = float("nan")
    u: float = float("nan")
    limit: float = float("nan")
    probability: float = float("nan")
    count: int = 0
    part: str = ""


def body_alarms(body: BodyTrend, series: int, limit: float) -> list[TrendAlarm]:
    """Alarms of a body and its points.

    series   number of all series that are tested, for the probability
    limit    probability of a false alarm in one series
    """
    alarms = []
    span = float(np.ptp(body.points.mjd)) / DAYS_PER_YEAR
    night = np.sqrt(np.mean(body.night_u**2, axis=1))
    for step in body.own.steps:
        alarms.append(
            _step(
                TrendQuantity.POINT,
                body.points.names[step.series],
                body.points.mjd[step.at],
                step.size,
                step.covariance,
                night[step.series],
                min(1.0, step.probability * series),
                part=body.name,
            )
        )
    rate, covariance, probability = drift_probability(body.own.fit, body.functions)
    for i in np.flatnonzero(probability < limit):
        alarms.append(
            _drift(
                TrendQuantity.POINT,
                body.points.names[i],
                rate[i],
                covariance[i],
                night[i],
                span,
                min(1.0, float(probability[i]) * series),
                part=body.name,
            )
        )
    if body.motion is not None:
        length = float(np.sqrt(np.mean(np.sum((body.place - body.middle) ** 2, axis=1))))
        alarms += motion_alarms(body.name, body.motion, body.points.mjd, body.functions, length, series, limit)
    present = measured(body.displacement)
    alarms += _outliers(body.outlier, present, body.points.names, TrendQuantity.POINT, body.name)
    claimed = float(np.sqrt(np.nanmedian(np.einsum("tnii->tn", body.spread)) / 3.0)) if len(body.spread) else 0.0
    total = float(np.hypot(claimed, np.hypot(body.own.noise.white[0], body.own.noise.wander[0])))
    if total > SCATTER * claimed > 0.0:
        alarms.append(
            TrendAlarm(
                severity=Severity.WARNING,
                kind=AlarmKind.SCATTER,
                quantity=TrendQuantity.POINT,
                subject=body.name,
                value=total,
                limit=claimed,
                count=len(body.points.names),
            )
        )
    return alarms


def motion_alarms(
    name: str, motion: MotionTrend, mjd: Array, functions: TrendFunctions, length: float, series: int, limit: float
) -> list[TrendAlarm]:
    """Steps and drifts of a body as a whole.

    name        of the body
    motion      its model
    mjd         (T,) of its nights
    functions   of its model
    length      m, at which its turns count
    series, limit   as for `body_alarms`
    """
    lever = np.repeat([1.0, length], 3) * motion.scale
    night = float(np.linalg.norm(motion.night_u * np.repeat([1.0, length], 3)) / np.sqrt(3.0))
    alarms = []
    for step in motion.found.steps:
        covariance = step.covariance * np.outer(lever, lever)
        chance = min(1.0, step.probability * series)
        alarms.append(_step(TrendQuantity.BODY, name, mjd[step.at], step.size * lever, covariance, night, chance))
    rate, covariance, probability = drift_probability(motion.found.fit, functions)
    if probability[0] < limit:
        chance, spread = min(1.0, float(probability[0]) * series), covariance[0] * np.outer(lever, lever)
        span = float(np.ptp(mjd)) / DAYS_PER_YEAR
        alarms.append(_drift(TrendQuantity.BODY, name, rate[0] * lever, spread, night, span, chance))
    return alarms


def instrument_alarms(trend: InstrumentTrend, quantity: TrendQuantity, series: int, limit: float) -> list[TrendAlarm]:
    """Alarms of zeros, thermometers or a scale; arguments as for `body_alarms`."""
    alarms, span = [], float(np.ptp(trend.mjd)) / DAYS_PER_YEAR
    night = trend.night_u
    part = trend.parameter if quantity in (TrendQuantity.ZERO, TrendQuantity.PARAMETER) else ""
    for step in trend.found.steps:
        alarms.append(
            _step(
                quantity,
                trend.subjects[step.series],
                trend.mjd[step.at],
                step.size,
                step.covariance,
                float(night[step.series]),
                min(1.0, step.probability * series),
                part=part,
            )
        )
    rate, covariance, probability = drift_probability(trend.found.fit, trend.functions)
    for i in np.flatnonzero(probability < limit):
        alarms.append(
            _drift(
                quantity,
                trend.subjects[i],
                rate[i],
                covariance[i],
                float(night[i]),
                span,
                min(1.0, float(probability[i]) * series),
                part=part,
            )
        )
    return alarms + _outliers(trend.outlier, np.isfinite(trend.values), trend.subjects, quantity, part)


def calibration_alarms(trend: InstrumentTrend, certificates: dict[str, np.ndarray], limit: float) -> list[TrendAlarm]:
    """Zeros that departed from their calibration, or will before its end.

    trend          of zeros
    certificates   rows of the archive
    limit          probability below which a drift counts
    """
    quantity = TrendQuantity.ZERO if trend.parameter == "zero" else TrendQuantity.PARAMETER
    rate, covariance, probability = drift_probability(trend.found.fit, trend.functions)
    alarms, last = [], float(trend.mjd[-1])
    for i, subject in enumerate(trend.subjects):
        expanded = COVERAGE * float(trend.u_prior[i])
        if not (np.isfinite(trend.prior[i]) and expanded > 0.0):
            continue
        value, u = trend.latest(i)
        away = value - float(trend.prior[i])
        common = TrendAlarm(
            severity=Severity.ALARM,
            kind=AlarmKind.DEPARTED,
            quantity=quantity,
            subject=subject,
            mjd=last,
            value=away,
            u=u,
            limit=expanded,
            part=trend.parameter,
        )
        if abs(away) > expanded and abs(away) > SURE * u:
            alarms.append(common)
        elif probability[i] < limit and rate[i, 0] != 0.0:
            years = (np.sign(rate[i, 0]) * expanded - away) / float(rate[i, 0])
            when, end = last + DAYS_PER_YEAR * years, _end_of(certificates, subject)
            if when < (end if np.isfinite(end) else last + DAYS_PER_YEAR):
                u_rate = float(np.sqrt(covariance[i, 0, 0]))
                warning = {"severity": Severity.WARNING, "kind": AlarmKind.AGES, "mjd": when}
                alarms.append(replace(common, **warning, value=float(rate[i, 0]), u=u_rate))
    return alarms


def _beyond(valid_until: ArrayLike) -> Array:
    """MJD at which certificates no longer hold: the day after their last one begins."""
    return np.asarray(np.floor(valid_until) + 1.0)


def certificate_alarms(certificates: dict[str, np.ndarray], nights: ArchivedNights) -> list[TrendAlarm]:
    """Certificates that had ended when nights were measured, or end soon."""
    alarms, last = [], float(nights.mjd[-1])
    for instrument in np.unique(certificates["instrument"]).tolist():
        chosen = certificates["instrument"] == instrument
        for kind in np.unique(certificates["kind"][chosen]):
            at = np.flatnonzero(chosen & (certificates["kind"] == kind))
            newest = at[np.argmax(certificates["mjd"][at])]
            end = float(certificates["valid_until"][newest])
            if not np.isfinite(end) or end > last + SOON:
                continue
            with np.errstate(invalid="ignore"):
                after = int(np.sum(certificates["mjd"][at] >= _beyond(certificates["valid_until"][at])))
            ended = bool(last >= _beyond(end))
            alarms.append(
                TrendAlarm(
                    severity=Severity.ALARM if ended else Severity.WARNING,
                    kind=AlarmKind.EXPIRED if ended else AlarmKind.EXPIRES,
                    quantity=TrendQuantity.CERTIFICATE,
                    subject=str(instrument),
                    mjd=end,
                    count=after,
                    part=str(kind),
                )
            )
    return alarms


def night_alarms(nights: ArchivedNights) -> list[TrendAlarm]:
    """Gaps between nights, and nights that failed."""
    alarms = []
    steps = np.diff(nights.mjd)
    usual = max(float(np.median(steps)), 1.0) if len(steps) else 1.0
    for i in np.flatnonzero(steps > GAP * usual):
        alarms.append(
            TrendAlarm(
                severity=Severity.NOTE,
                kind=AlarmKind.GAP,
                quantity=TrendQuantity.NIGHTS,
                subject=str(nights.night[i]),
                mjd=float(nights.mjd[i]),
                value=float(steps[i]),
                limit=GAP * usual,
            )
        )
    failed = np.flatnonzero(nights.verdict == "failed")
    if len(failed):
        alarms.append(
            TrendAlarm(
                severity=Severity.WARNING,
                kind=AlarmKind.FAILED,
                quantity=TrendQuantity.NIGHTS,
                subject=str(nights.night[failed[-1]]),
                mjd=float(nights.mjd[failed[-1]]),
                count=len(failed),
            )
        )
    return alarms


def in_order(alarms: list[TrendAlarm]) -> tuple[TrendAlarm, ...]:
    """Alarms, the worst first, then by probability and size."""
    order = list(Severity)

    def key(alarm: TrendAlarm) -> tuple[int, str, float, float, str]:
        chance = alarm.probability if np.isfinite(alarm.probability) else 1.0
        size = -abs(alarm.value) if np.isfinite(alarm.value) else 0.0
        return order.index(alarm.severity), alarm.kind.value, chance, size, alarm.subject

    return tuple(sorted(alarms, key=key))


def _end_of(certificates: dict[str, np.ndarray], instrument: str) -> float:
    """End of the newest certificate of an instrument, or of what a ranger carries, MJD; NaN without."""
    theirs = (certificates["instrument"] == instrument) | (certificates["ranger"] == instrument)
    at = np.flatnonzero(theirs & np.isfinite(certificates["valid_until"]))
    return float(certificates["valid_until"][at[np.argmax(certificates["mjd"][at])]]) if len(at) else float("nan")


def _size(values: Array, covariance: Array) -> tuple[float, float]:
    """Length of a vector, signed for one component, and its standard uncertainty along it."""
    if len(values) == 1:
        return float(values[0]), float(np.sqrt(covariance[0, 0]))
    size = float(np.sqrt(values @ values))
    along = values / size if size > 0.0 else values
    return size, float(np.sqrt(max(float(along @ covariance @ along), 0.0)))


def _step(
    quantity: TrendQuantity,
    subject: str,
    mjd: float,
    size: Array,
    covariance: Array,
    night: float,
    probability: float,
    *,
    part: str = "",
) -> TrendAlarm:
    value, u = _size(size, covariance)
    return TrendAlarm(
        severity=Severity.ALARM if abs(value) >= night else Severity.WARNING,
        kind=AlarmKind.STEP,
        quantity=quantity,
        subject=subject,
        mjd=float(mjd),
        value=value,
        u=u,
        limit=night,
        probability=probability,
        part=part,
    )


def _drift(
    quantity: TrendQuantity,
    subject: str,
    rate: Array,
    covariance: Array,
    night: float,
    span: float,
    probability: float,
    *,
    part: str = "",
) -> TrendAlarm:
    value, u = _size(rate, covariance)
    return TrendAlarm(
        severity=Severity.ALARM if abs(value) * max(span, 1.0) >= night else Severity.WARNING,
        kind=AlarmKind.DRIFT,
        quantity=quantity,
        subject=subject,
        value=value,
        u=u,
        limit=night,
        probability=probability,
        part=part,
    )


def _outliers(
    outlier: np.ndarray, present: np.ndarray, subjects: tuple[str, ...], quantity: TrendQuantity, part: str
) -> list[TrendAlarm]:
    """A warning for each series with many outliers, a note for all others together."""
    count, readings = outlier.sum(axis=0), np.maximum(present.sum(axis=0), 1)
    many = np.flatnonzero((count > 1) & (count > MANY_OUTLIERS * readings))
    alarms = [
        TrendAlarm(
            severity=Severity.WARNING,
            kind=AlarmKind.OUTLIERS,
            quantity=quantity,
            subject=subjects[i],
            value=float(count[i] / readings[i]),
            limit=MANY_OUTLIERS,
            count=int(count[i]),
            part=part,
        )
        for i in many
    ]
    others = int(count.sum() - count[many].sum())
    if others:
        alarms.append(
            TrendAlarm(
                severity=Severity.NOTE,
                kind=AlarmKind.OUTLIERS,
                quantity=quantity,
                subject=part or quantity.value,
                value=others / float(readings.sum()),
                limit=MANY_OUTLIERS,
                count=others,
                part=part,
            )
        )
    return alarms
