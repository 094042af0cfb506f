"""Figures of an archive's trends: motion of bodies, series that changed, zeros, thermometers, alarms in time."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.trends.objects import unit_of
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, STYLE, Figure, mpl
from catseye.reduction.trends.alarms import AlarmKind, Severity
from catseye.reduction.trends.bodies import BodyTrend
from catseye.reduction.trends.drawn import DrawnSeries, motion_series
from catseye.reduction.trends.trends import TrendFindings

MOST_PANELS = 12
COLUMNS = 2
EPOCH = datetime(1858, 11, 17, tzinfo=UTC)
COLOURS = {Severity.ALARM: BAD, Severity.WARNING: SERIES[1], Severity.NOTE: FAINT}
BAND = 2.0  # standard uncertainties shown
CLOSEST = 1.2  # of a panel's height: room above the data


def dates(mjd: np.ndarray) -> np.ndarray:
    """Numbers (...) of Modified Julian Dates on an axis of dates."""
    from matplotlib.dates import date2num

    return np.asarray(mjd, dtype=float) + float(date2num(EPOCH))


def series_figure(series: list[DrawnSeries]) -> Figure:
    """Series that changed, a panel each: nights with u, outliers, drift and steps."""
    shown = series[:MOST_PANELS]
    columns = min(COLUMNS, max(len(shown), 1))
    rows = -(-max(len(shown), 1) // columns)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 0.6 + 1.9 * rows), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for panel, one in zip(panels, shown, strict=False):
            _series_panel(panel, one)
        for panel in panels[len(shown) :]:
            panel.set_axis_off()
        return figure


def _series_panel(panel: Any, one: DrawnSeries) -> None:
    scale, unit = unit_of(one.quantity)
    good = np.isfinite(one.value) & ~one.outlier
    at = dates(one.mjd)
    panel.errorbar(
        at[good],
        one.value[good] / scale,
        yerr=one.u[good] / scale,
        fmt="o",
        color=SERIES[0],
        ecolor="#b9cde2",
        elinewidth=0.7,
        markersize=1.8,
        zorder=1,
    )
    for first, last in zip((-np.inf, *sorted(one.steps)), (*sorted(one.steps), np.inf), strict=True):
        piece = (one.mjd >= first) & (one.mjd < last)
        panel.plot(at[piece], one.model[piece] / scale, color=INK, linewidth=1.3, zorder=3)
    away = np.isfinite(one.value) & one.outlier
    low, high = panel.get_ylim()
    if away.any():
        inside = np.clip(one.value[away] / scale, low, high)
        panel.plot(at[away], inside, "x", color=BAD, markersize=5, zorder=4, clip_on=False)
        panel.set_ylim(low, high)
    for when in one.steps:
        panel.axvline(float(dates(np.array(when))), color=BAD, linewidth=0.9, linestyle="--", zorder=2)
    if np.isfinite(one.prior) and np.isfinite(one.u_prior):
        band = BAND * one.u_prior / scale
        if band < CLOSEST * (high - low):
            panel.axhspan(one.prior / scale - band, one.prior / scale + band, color=SERIES[2], alpha=0.12, linewidth=0)
    named = f" ({one.part})" if one.part and one.part not in ("zero", "ranges", "stations", "scale") else ""
    panel.set_title(f"{one.subject}{named}: {one.quantity.value}" + (f", {unit}" if unit else ""))
    _dated(panel)


def _dated(panel: Any) -> None:
    """Axis of dates with few, short labels."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=3, maxticks=7)
    panel.xaxis.set_major_locator(locator)
    panel.xaxis.set_major_formatter(ConciseDateFormatter(locator))


def motion_figure(body: BodyTrend) -> Figure:
    """Shift and turn of a body against elevation: nights and model, all else taken off."""
    values, model = motion_series(body)
    e = body.points.elevation / DEGREE
    by_elevation = bool(np.isfinite(e).all() and any("E" in name for name in body.functions.names))
    x = e if by_elevation else dates(body.points.mjd)
    order = np.argsort(x)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 4.8), layout="constrained")
        axes = figure.subplots(2, 3, sharex=True)
        for c in range(6):
            scale, unit = (MILLIMETRE, "mm") if c < 3 else (ARCSECOND, "arc seconds")
            panel = axes[c // 3, c % 3]
            panel.plot(x, values[:, c] / scale, "o", color=SERIES[0], markersize=1.8)
            panel.plot(x[order], model[order, c] / scale, color=INK)
            panel.set_title(f"{'shift' if c < 3 else 'turn about'} {'xyz'[c % 3]}, {unit}")
            if by_elevation and c >= 3:
                panel.set_xlabel("elevation (°)")
            elif not by_elevation:
                _dated(panel)
        return figure


def alarm_figure(found: TrendFindings) -> Figure | None:
    """Alarms with a date, by kind; None without any."""
    dated = [alarm for alarm in found.alarms if np.isfinite(alarm.mjd)]
    if not dated:
        return None
    kinds = [kind for kind in AlarmKind if any(alarm.kind is kind for alarm in dated)]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 0.9 + 0.34 * len(kinds)), layout="constrained")
        panel = figure.subplots()
        for severity in reversed(Severity):
            some = [alarm for alarm in dated if alarm.severity is severity]
            if some:
                panel.plot(
                    dates(np.array([alarm.mjd for alarm in some])),
                    [kinds.index(alarm.kind) for alarm in some],
                    "o",
                    color=COLOURS[severity],
                    markersize=6,
                    alpha=0.8,
                    label=severity.value,
                )
        panel.vlines(dates(found.nights.mjd), -0.9, -0.6, color=FAINT, linewidth=0.4)
        panel.set_yticks(range(len(kinds)), [kind.value for kind in kinds])
        panel.set_ylim(-1.0, len(kinds) - 0.5)
        panel.invert_yaxis()
        panel.set_title("Alarms in time, and the nights")
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        _dated(panel)
        return figure


def noise_figure(found: TrendFindings) -> Figure | None:
    """Uncertainty of a night of each body's points, by point; None without bodies."""
    bodies = [body for body in found.bodies if len(body.points.names)]
    if not bodies:
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.0), layout="constrained")
        panel = figure.subplots()
        for k, body in enumerate(bodies):
            size = np.sort(np.sqrt(np.mean(body.night_u**2, axis=1))) / MILLIMETRE
            size = size[np.isfinite(size)]
            share = (np.arange(len(size)) + 0.5) / max(len(size), 1)
            panel.plot(
                size, share, color=SERIES[k % len(SERIES)], marker="." if len(size) < 40 else "", label=body.name
            )
        panel.set_xlabel("standard uncertainty of a point's coordinate in one night, mm")
        panel.set_ylabel("share of points")
        panel.set_xlim(left=0.0)
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure
