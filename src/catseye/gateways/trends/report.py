"""Report of an archive's trends."""

from collections.abc import Mapping
from datetime import datetime

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.estimation.series.correlated import measured
from catseye.gateways.trends.objects import alarm_text, alarm_unit, day, trend_passages, unit_of
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    DrawingBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import Axis, Chart, ReportTable, number, text, uncertainty
from catseye.names import counted
from catseye.reduction.trends.alarms import Severity
from catseye.reduction.trends.bodies import BodyTrend, MotionTrend
from catseye.reduction.trends.drawn import DrawnSeries, drawn_series
from catseye.reduction.trends.functions import YEAR, TrendFunctions
from catseye.reduction.trends.instruments import InstrumentTrend, drift_probability
from catseye.reduction.trends.trends import TrendFindings

MOST_CHARTS = 24  # series that a report draws
MOST_POINTS = 3000  # rows of a table of points


def trends_report(findings: TrendFindings, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of an archive's trends.

    when     UTC
    inputs   SHA-256 of each index entry read, by night
    """
    first, last = day(findings.nights.mjd[0]), day(findings.nights.mjd[-1])
    return ResultReport(
        title="Trends of an archive",
        subtitle=f"{first} to {last}, by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ",
        verdict=findings.verdict,
        cards=_cards(findings),
        passages=trend_passages(findings),
        sections=[
            _alarms(findings),
            _series(findings),
            *(_body(body, k) for k, body in enumerate(findings.bodies)),
            _poses(findings),
            _instruments(findings),
            _nights(findings),
            origin_section(when, inputs),
        ],
        label="Trends",
    )


def _cards(findings: TrendFindings) -> list[Card]:
    alarms, warnings, notes = (findings.count(severity) for severity in Severity)
    points = sum(len(body.points.names) for body in findings.bodies)
    return [
        Card("Nights", str(len(findings.nights)), f"{points} points in {len(findings.bodies)} bodies"),
        Card("Alarms", str(alarms), f"{counted(warnings, 'warning')}, {counted(notes, 'note')}"),
        Card("Tested", str(findings.series), f"series; false alarm rate {findings.false_alarm:g} for all together"),
    ]


def _alarms(findings: TrendFindings) -> ReportSection:
    from catseye.gateways.trends.figures import alarm_figure
    from catseye.gateways.writers.drawing import svg

    rows = [
        (
            alarm.severity.value,
            alarm.subject,
            alarm.kind.value,
            day(alarm.mjd),
            alarm_text(alarm),
            alarm.value / alarm_unit(alarm)[0],
            alarm.u / alarm_unit(alarm)[0],
            alarm_unit(alarm)[1],
            alarm.probability,
        )
        for alarm in findings.alarms
    ]
    table = ReportTable.of_rows(
        rows,
        text("severity", "severity"),
        text("subject", "subject"),
        text("kind", "kind"),
        text("date", "date (UTC)"),
        text("text", "finding", kind="long"),
        number("value", "size", u="u"),
        uncertainty("u", "u"),
        text("unit", "unit"),
        number("probability", "by chance"),
        name="subject",
    )
    lead = (
        "A step or a drift is listed where the whole archive would show one by chance with less than the stated false "
        "alarm rate. An alarm is larger than one night's standard uncertainty, a warning is smaller but sure."
    )
    figure = alarm_figure(findings)
    drawing = None if figure is None else DrawingBlock("alarms-in-time", svg(figure), "Alarms with a date, by kind.")
    return ReportSection("alarms", "Alarms", [Text(lead), drawing, TableBlock("alarms", table)])


def _series(findings: TrendFindings) -> ReportSection | None:
    """Charts of the series that changed."""
    from catseye.gateways.trends.figures import series_figure
    from catseye.gateways.writers.drawing import svg

    series = drawn_series(findings, findings.alarms)
    if not series:
        return None
    lead = (
        "Posture, temperature and season are taken off. Points along their largest change; instruments at their mean "
        "temperature. Line: drift and steps; dashed: steps; crosses: outliers; green band: calibration with its "
        "expanded uncertainty."
    )
    blocks: list[Block] = [Text(lead), DrawingBlock("changes", svg(series_figure(series)), "Series that changed.")]
    blocks += [ChartBlock(f"series-{k + 1}", _chart(one), _caption(one)) for k, one in enumerate(series[:MOST_CHARTS])]
    if len(series) > MOST_CHARTS:
        blocks.append(Text(f"{len(series) - MOST_CHARTS} further series are in the table of alarms.", faint=True))
    return ReportSection("series", "Series that changed", blocks)


def _caption(one: DrawnSeries) -> str:
    return f"{one.subject}: {one.quantity.value}" + (f", {one.part}." if one.part else ".")


def _chart(one: DrawnSeries) -> Chart:
    scale, unit = unit_of(one.quantity)
    at = np.flatnonzero(np.isfinite(one.value))
    t = len(at)
    return Chart(
        "scatter",
        Axis("date, MJD", "d", np.concatenate([one.mjd[at], one.mjd[at]]), digits=2),
        Axis(one.subject, unit, np.concatenate([one.value[at], one.model[at]]) / scale, digits=6),
        u=np.concatenate([one.u[at] / scale, np.full(t, np.nan)]),
        group=[*np.where(one.outlier[at], 1, 0).tolist(), *[2] * t],
        groups=("nights", "outliers", "drift and steps"),
    )


def _body(body: BodyTrend, k: int) -> ReportSection:
    """Model of a body: its motion, its points."""
    blocks: list[Block | None] = [Text(_lead(body))]
    if body.motion is not None:
        from catseye.gateways.trends.figures import motion_figure
        from catseye.gateways.writers.drawing import svg

        caption = "Shift and turn of the body about its middle: nights, and the model's part by elevation."
        blocks += [
            DrawingBlock(f"motion-{k + 1}", svg(motion_figure(body)), caption),
            TableBlock(f"coefficients-{k + 1}", _coefficients(body.motion, body.functions), "Motion of the body."),
        ]
    blocks.append(TableBlock(f"points-{k + 1}", _points(body), "Points of the body."))
    return ReportSection(f"body-{k + 1}", body.name.capitalize(), blocks)


def _lead(body: BodyTrend) -> str:
    noise = body.own.noise
    lasting = f", {1e3 * noise.wander[0]:.3g} mm that lasts {noise.days[0]:.3g} days" if noise.wander[0] > 0.0 else ""
    return (
        f"{len(body.points.names)} points rest in the {body.frame} frame, {len(body.points.mjd)} nights. Reference: "
        f"{body.functions.reference_c:.2f} °C, {day(body.functions.reference_mjd)}. Beyond the claimed covariance each "
        f"coordinate scatters by {1e3 * noise.white[0]:.3g} mm in a night{lasting}. The mean variance factor is "
        f"{np.nanmean(body.own.fit.variance_factor):.2f}; {int(body.outlier.sum())} readings are outliers."
    )


def _coefficients(motion: MotionTrend, functions: TrendFunctions) -> ReportTable:
    u = np.sqrt(np.maximum(np.diag(motion.coefficient_covariance), 0.0)).reshape(-1, 6)
    units = np.repeat([MILLIMETRE, ARCSECOND], 3)
    columns = [
        column
        for c in range(6)
        for name, unit in [(f"{'shift' if c < 3 else 'turn'} {'xyz'[c % 3]}", "mm" if c < 3 else "″")]
        for column in (
            number(f"c_{c + 1}", name, motion.coefficients[:, c] / units[c], unit, 4, u=f"u_{c + 1}"),
            uncertainty(f"u_{c + 1}", f"u {name}", u[:, c] / units[c], unit, 4),
        )
    ]
    return ReportTable((text("function", "per unit of", functions.names), *columns))


def _points(body: BodyTrend) -> ReportTable:
    """Points with their rates and a night's uncertainty; those that moved most first where there are too many."""
    rate, covariance, probability = drift_probability(body.own.fit, body.functions)
    u = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
    order = np.argsort(probability, kind="stable")[:MOST_POINTS] if len(rate) > MOST_POINTS else np.arange(len(rate))
    nights = measured(body.displacement).sum(axis=0)
    size = np.sqrt(np.mean(body.night_u**2, axis=1))
    steps = np.bincount([step.series for step in body.own.steps], minlength=len(rate))
    rows = [
        (
            body.points.names[i],
            int(nights[i]),
            *(v for c in range(3) for v in (rate[i, c] / MILLIMETRE, u[i, c] / MILLIMETRE)),
            size[i] / MILLIMETRE,
            int(steps[i]),
            int(body.outlier[:, i].sum()),
        )
        for i in order
    ]
    return ReportTable.of_rows(
        rows,
        text("point", "point"),
        number("nights", "nights", digits=0),
        *(
            column
            for axis in "xyz"
            for column in (
                number(f"rate_{axis}", f"drift {axis}", unit="mm a year", digits=3, u=f"u_{axis}"),
                uncertainty(f"u_{axis}", f"u drift {axis}", unit="mm a year", digits=3),
            )
        ),
        number("night", "u of a night", unit="mm", digits=3),
        number("steps", "steps", digits=0),
        number("outliers", "outliers", digits=0),
        name="point",
    )


def _poses(findings: TrendFindings) -> ReportSection | None:
    if not findings.poses:
        return None
    blocks = [
        TableBlock(
            f"pose-{k + 1}",
            _coefficients(pose.motion, pose.functions),
            f"{pose.poses.body}, {len(pose.poses.mjd)} nights.",
        )
        for k, pose in enumerate(findings.poses)
    ]
    return ReportSection("poses", "Poses", blocks)


def _instruments(findings: TrendFindings) -> ReportSection | None:
    if not findings.instruments:
        return None
    blocks: list[Block] = []
    for k, (quantity, trend) in enumerate(findings.instruments):
        caption = f"{quantity.value.capitalize()}: {trend.parameter}."
        blocks.append(TableBlock(f"instruments-{k + 1}", _instrument_table(trend, *unit_of(quantity)), caption))
    return ReportSection("instruments", "Zeros, thermometers, scale", blocks)


def _instrument_table(trend: InstrumentTrend, scale: float, unit: str) -> ReportTable:
    rate, covariance, _ = drift_probability(trend.found.fit, trend.functions)
    latest = np.array([trend.latest(i) for i in range(len(trend.subjects))]).reshape(-1, 2) / scale
    steps = np.bincount([step.series for step in trend.found.steps], minlength=len(trend.subjects))
    yearly = f"{unit} a year".strip() if YEAR in trend.functions.names else unit
    return ReportTable(
        (
            text("subject", "instrument", trend.subjects),
            number("nights", "nights", np.isfinite(trend.values).sum(axis=0), digits=0),
            number("latest", "at the last night", latest[:, 0], unit, 4, u="u_latest"),
            uncertainty("u_latest", "u", latest[:, 1], unit, 4),
            number("rate", "drift", rate[:, 0] / scale, yearly, 4, u="u_rate"),
            uncertainty("u_rate", "u drift", np.sqrt(np.maximum(covariance[:, 0, 0], 0.0)) / scale, yearly, 4),
            number("night", "u of a night", trend.night_u / scale, unit, 4),
            number("prior", "calibration", trend.prior / scale, unit, 4, u="u_prior"),
            uncertainty("u_prior", "u calibration", trend.u_prior / scale, unit, 4),
            number("steps", "steps", steps, digits=0),
            number("outliers", "outliers", trend.outlier.sum(axis=0), digits=0),
        ),
        name="subject",
    )


def _nights(findings: TrendFindings) -> ReportSection:
    from catseye.gateways.trends.figures import noise_figure
    from catseye.gateways.writers.drawing import svg

    nights, figure = findings.nights, noise_figure(findings)
    chart = Chart(
        "scatter",
        Axis("date, MJD", "d", nights.mjd, digits=2),
        Axis("variance factor", "", nights.variance_factor, digits=3),
        names=nights.night.tolist(),
        limits=(1.0,),
    )
    table = ReportTable(
        (
            text("night", "night", nights.night.tolist()),
            text("date", "date (UTC)", [day(v) for v in nights.mjd]),
            number("points", "points", nights.points, digits=0),
            number("factor", "variance factor", nights.variance_factor, digits=2),
            number("temperature", "air", nights.temperature_c, "°C", 1),
            text("verdict", "verdict", nights.verdict.tolist()),
        ),
        name="night",
    )
    drawing = (
        None if figure is None else DrawingBlock("noise", svg(figure), "Uncertainty of one night, scatter included.")
    )
    return ReportSection(
        "nights",
        "Nights",
        [
            ChartBlock("factors", chart, "Variance factor of each night."),
            drawing,
            TableBlock("nights", table, folded="Nights"),
        ],
    )
