"""Sentences and JSON of an archive's trends."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.reduction.trends.alarms import AlarmKind, Severity, TrendAlarm, TrendQuantity
from catseye.reduction.trends.bodies import BodyTrend, MotionTrend
from catseye.reduction.trends.functions import TrendFunctions
from catseye.reduction.trends.trends import TrendFindings

FORMAT = "catseye-trends-1"
MOST_SENTENCES = 12  # alarms in a terminal; the report and the table have all
EPOCH = datetime(1858, 11, 17, tzinfo=UTC)
LENGTHS = (TrendQuantity.POINT, TrendQuantity.BODY, TrendQuantity.ZERO)
DEGREES = (TrendQuantity.THERMOMETER, TrendQuantity.STATION, TrendQuantity.SCALE)


def unit_of(quantity: TrendQuantity) -> tuple[float, str]:
    """Unit in which a quantity is printed: its size in SI and its name."""
    if quantity in LENGTHS:
        return MILLIMETRE, "mm"
    return 1.0, "°C" if quantity in DEGREES else ""


def alarm_unit(alarm: TrendAlarm) -> tuple[float, str]:
    """Unit in which an alarm's size is printed: its size in SI and its name; shares of readings in percent."""
    if alarm.kind is AlarmKind.OUTLIERS:
        return 0.01, "%"
    return (1.0, "d") if alarm.kind is AlarmKind.GAP else unit_of(alarm.quantity)


def day(mjd: float) -> str:
    """Date of a Modified Julian Date, UTC.

    >>> day(61041.5)
    '2026-01-01'
    """
    return f"{EPOCH + timedelta(days=float(mjd)):%Y-%m-%d}" if np.isfinite(mjd) else ""


def alarm_text(alarm: TrendAlarm) -> str:
    """Alarm in one sentence, without its subject."""
    scale, unit = unit_of(alarm.quantity)
    value, u, limit = alarm.value / scale, alarm.u / scale, alarm.limit / scale
    sized = f"{value:.4g} {unit}".strip() + f" (u {u:.2g} {unit}".rstrip() + ")"
    what = alarm.quantity.value if not alarm.part or alarm.quantity not in LENGTHS[:1] else alarm.part
    chance = f"by chance {alarm.probability:.1g}" if alarm.probability >= 1e-99 else "by chance below 1e-99"
    match alarm.kind:
        case AlarmKind.STEP:
            return f"{what}: a step of {sized} before the night of {day(alarm.mjd)}; {chance} in the archive"
        case AlarmKind.DRIFT:
            return f"{what}: drifts by {sized} a year; {chance} in the archive"
        case AlarmKind.DEPARTED:
            allowed = f"{limit:.2g} {unit}".rstrip()
            return f"{alarm.part}: {sized} from its calibration, beyond its expanded uncertainty {allowed}"
        case AlarmKind.AGES:
            return f"{alarm.part}: drifts by {sized} a year, beyond its calibration's uncertainty on {day(alarm.mjd)}"
        case AlarmKind.EXPIRED:
            return f"{alarm.part} certificate ended on {day(alarm.mjd)}; {alarm.count} nights are later"
        case AlarmKind.EXPIRES:
            return f"{alarm.part} certificate ends on {day(alarm.mjd)}"
        case AlarmKind.OUTLIERS:
            return f"{what}: {alarm.count} outliers, {100.0 * alarm.value:.2g} % of its readings, left out"
        case AlarmKind.SCATTER:
            return f"scatters by {value:.2g} {unit} about its model where {limit:.2g} {unit} is claimed"
        case AlarmKind.GAP:
            return f"{alarm.value:.0f} days without a night after {day(alarm.mjd)}"
        case AlarmKind.FAILED:
            return f"{alarm.count} nights failed, the last on {day(alarm.mjd)}"


def trend_passages(found: TrendFindings) -> list[Passage]:
    """Nights, models, alarms, notes."""
    nights = found.nights
    first, last = day(nights.mjd[0]), day(nights.mjd[-1])
    tested = (
        f"{len(nights)} nights from {first} to {last}; {found.series} series tested, all together with a false alarm "
        f"rate of {found.false_alarm:g}"
    )
    passages = [Passage("Archive", tested)]
    for body in found.bodies:
        points, functions = counted(len(body.points.names), "point"), ", ".join(body.functions.names)
        words = f"{points} in the {body.frame} frame; functions {functions}"
        if body.motion is not None:
            words += f"; a night's shift scatters by {1e3 * np.linalg.norm(body.motion.night_u[:3]):.3g} mm"
        passages.append(Passage(body.name.capitalize(), words))
    for severity in Severity:
        passages += [
            Passage(severity.value.capitalize(), f"{alarm.subject}: {alarm_text(alarm)}")
            for alarm in found.alarms
            if alarm.severity is severity
        ][:MOST_SENTENCES]
    hidden = sum(max(0, found.count(severity) - MOST_SENTENCES) for severity in Severity)
    if hidden:
        passages.append(Passage("More", f"{hidden} further alarms and notes are in the table of alarms"))
    return passages + [Passage("Note", note) for note in found.notes]


def alarm_object(alarm: TrendAlarm) -> dict[str, Any]:
    """Alarm for JSON, SI units."""
    return {
        "severity": alarm.severity.value,
        "kind": alarm.kind.value,
        "quantity": alarm.quantity.value,
        "subject": alarm.subject,
        "part": alarm.part,
        "mjd": alarm.mjd,
        "value": alarm.value,
        "u": alarm.u,
        "limit": alarm.limit,
        "probability": alarm.probability,
        "count": alarm.count,
        "text": alarm_text(alarm),
    }


def _motion_object(motion: MotionTrend, functions: TrendFunctions) -> dict[str, Any]:
    return {
        "functions": list(functions.names),
        "reference_c": functions.reference_c,
        "reference_mjd": functions.reference_mjd,
        "coefficients": motion.coefficients,
        "covariance": motion.coefficient_covariance,
        "night_u": motion.night_u,
        "white": motion.found.noise.white * motion.scale,
        "wander": motion.found.noise.wander * motion.scale,
        "wander_days": motion.found.noise.days,
    }


def _body_object(body: BodyTrend) -> dict[str, Any]:
    return {
        "frame": body.frame,
        "points": len(body.points.names),
        "nights": len(body.points.mjd),
        "functions": list(body.functions.names),
        "omitted": list(body.functions.omitted),
        "middle": body.middle,
        "motion": None if body.motion is None else _motion_object(body.motion, body.functions),
        "variance_factor": float(np.nanmean(body.own.fit.variance_factor)),
        "white": float(body.own.noise.white[0]),
        "wander": float(body.own.noise.wander[0]),
        "wander_days": float(body.own.noise.days[0]),
        "outliers": int(body.outlier.sum()),
    }


def trends_object(found: TrendFindings) -> dict[str, Any]:
    """Object that `catseye trends --json` prints."""
    return {
        "verdict": found.verdict.to_object(),
        "nights": len(found.nights),
        "first_mjd": float(found.nights.mjd[0]),
        "last_mjd": float(found.nights.mjd[-1]),
        "false_alarm": found.false_alarm,
        "series": found.series,
        "alarms": [alarm_object(alarm) for alarm in found.alarms],
        "bodies": {body.name: _body_object(body) for body in found.bodies},
        "poses": {pose.poses.body: _motion_object(pose.motion, pose.functions) for pose in found.poses},
        "notes": list(found.notes),
    }


def motion_lines(motion: MotionTrend, functions: TrendFunctions) -> list[str]:
    """Lines of a terminal: shift and turn by each function, with u."""
    u = np.sqrt(np.maximum(np.diag(motion.coefficient_covariance), 0.0)).reshape(-1, 6)
    lines = []
    for name, six, spread in zip(functions.names, motion.coefficients, u, strict=True):
        shift = ", ".join(
            f"{v / MILLIMETRE:9.4f} ({w / MILLIMETRE:.4f})" for v, w in zip(six[:3], spread[:3], strict=True)
        )
        turn = ", ".join(
            f"{v / ARCSECOND:8.4f} ({w / ARCSECOND:.4f})" for v, w in zip(six[3:], spread[3:], strict=True)
        )
        lines.append(f"{name:<10} {shift} mm   {turn} arcsec")
    return lines
