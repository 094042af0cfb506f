"""Figures of answers from an archive: series against date, elevation and temperature, maps, differences."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled

if TYPE_CHECKING:
    from catseye.reduction.query.again import ReReduction
    from catseye.reduction.query.point import PointSeries
    from catseye.reduction.query.pose import PoseSeries
    from catseye.reduction.query.ranger import RangerSeries
    from catseye.reduction.query.surface import SurfaceSeries

UNIX_EPOCH = 40587.0  # MJD of 1970-01-01, from which matplotlib counts days
MICROMETRE = 1e-6  # m
DENSE = 120  # rows beyond which bars of uncertainty hide the dots
WIDTH, HEIGHT = 9.2, 1.9  # inches: of a figure, and of a panel
SHOWN_TERMS = 4  # Zernike terms in a figure, those that vary most


class Panel(NamedTuple):
    """Panel of a series.

    label    its title, with the unit
    values   (n,) in the label's unit
    u        (n,) in the same; None for none
    """

    label: str
    values: np.ndarray
    u: np.ndarray | None = None


def point_figures(series: "PointSeries") -> dict[str, Figure]:
    """Deviations from the mean against date, elevation and temperature."""
    u = series.u / MILLIMETRE
    deviation = series.deviation / MILLIMETRE
    panels = [Panel(f"{axis} less mean (mm)", deviation[:, k], u[:, k]) for k, axis in enumerate("xyz")]
    return _against(series, panels)


def pose_figures(series: "PoseSeries") -> dict[str, Figure]:
    """Translation and rotation against date, elevation and temperature."""
    u = series.u
    panels = [
        *(
            Panel(f"translation {axis} (mm)", series.translation[:, k] / MILLIMETRE, u[:, k] / MILLIMETRE)
            for k, axis in enumerate("xyz")
        ),
        *(
            Panel(f"rotation {axis} (arcsec)", series.rotation[:, k] / ARCSECOND, u[:, 3 + k] / ARCSECOND)
            for k, axis in enumerate("xyz")
        ),
    ]
    return _against(series, panels, columns=2)


def surface_figures(series: "SurfaceSeries") -> dict[str, Figure]:
    """Focal length, rms and the terms that vary most, against date, elevation and temperature; map of the prisms."""
    focal, u_focal = series.column("focal_length") / MILLIMETRE, series.column("u_focal_length") / MILLIMETRE
    term, u_term = series.column("term") / MICROMETRE, series.column("u_term") / MICROMETRE
    chosen = np.sort(np.argsort(-np.ptp(term, axis=0), kind="stable")[:SHOWN_TERMS])
    panels = [
        Panel("focal length less mean (mm)", focal - focal.mean(), u_focal),
        Panel("half-path rms (µm)", series.rms / MICROMETRE),
        *(Panel(f"{series.terms[k].name} (µm)", term[:, k], u_term[:, k]) for k in chosen.tolist()),
    ]
    return {**_against(series, panels, columns=2), "prisms": _prisms(series)}


def ranger_figures(series: "RangerSeries") -> dict[str, Figure]:
    """Estimates of each parameter with its calibration and drift."""
    with styled():
        names = series.parameters
        figure = Figure(figsize=(WIDTH, 0.6 + 2.6 * len(names)), layout="constrained")
        panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for ax, name, drift in zip(panels, names, series.drifts, strict=True):
            rows = series.rows_of(name)
            scale, unit = (MILLIMETRE, "mm") if name == "zero" else (1.0, "own unit")
            days = series.mjd[rows] - UNIX_EPOCH
            prior, u_prior = series.prior[rows] / scale, series.u_prior[rows] / scale
            own, u_own = series.own[0][rows] / scale, series.own[1][rows] / scale
            _series(ax, days, Panel(f"{name} ({unit})", own, u_own))
            low, high = ax.get_ylim()
            ax.fill_between(days, prior - u_prior, prior + u_prior, step="mid", color=SERIES[2], alpha=0.16, lw=0)
            ax.plot(days, prior, drawstyle="steps-mid", color=SERIES[2], lw=1.1, label="calibration ± u")
            if np.isfinite(drift.rate) and drift.line is not None:
                from catseye.reduction.query.ranger import DAYS_PER_YEAR

                line = drift.line.at((series.mjd[rows] - drift.epoch) / DAYS_PER_YEAR) / scale
                rate, u = drift.rate / scale, drift.u_rate / scale
                ax.plot(days, line, color=SERIES[1], lw=1.5, label=f"{rate:+.3g} ± {u:.1g} {unit} a year")
                low, high = min(low, line.min()), max(high, line.max())
            low, high = min(low, prior.min()), max(high, prior.max())
            ax.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
            ax.legend(loc="best")
        _dated(panels[-1])
        return {"date": figure}


def again_figures(found: "ReReduction") -> dict[str, Figure]:
    """Difference of each point by axis, with its uncertainty."""
    with styled():
        figure = Figure(figsize=(WIDTH, 0.8 + 3 * HEIGHT), layout="constrained")
        panels = figure.subplots(3, 1, sharex=True)
        rows = np.arange(len(found.point))
        change, u = found.change / MILLIMETRE, found.u_change / MILLIMETRE
        for k, ax in enumerate(panels):
            _series(ax, rows, Panel(f"{'xyz'[k]} today less archived (mm)", change[:, k], u[:, k]))
        if len(rows) <= 40:
            panels[-1].set_xticks(rows, found.point.tolist(), rotation=90, fontsize=7)
        else:
            panels[-1].set_xlabel("point, in the order of names")
        return {"differences": figure}


def _against(series: Any, panels: Sequence[Panel], columns: int = 1) -> dict[str, Figure]:
    """Figures of panels against date, elevation and temperature; one without values is left out."""
    axes = {
        "date": (series.mjd - UNIX_EPOCH, ""),
        "elevation": (series.elevation / DEGREE, "elevation (deg)"),
        "temperature": (series.temperature_c, "air temperature (°C)"),
    }
    return {name: _stacked(x, label, panels, columns) for name, (x, label) in axes.items() if np.isfinite(x).any()}


def _stacked(x: np.ndarray, label: str, panels: Sequence[Panel], columns: int) -> Figure:
    with styled():
        rows = -(-len(panels) // columns)
        figure = Figure(figsize=(WIDTH, 0.6 + HEIGHT * rows), layout="constrained")
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        places = grid.T.ravel()
        for ax, panel in zip(places, panels, strict=False):
            _series(ax, x, panel)
        for ax in places[len(panels) :]:
            ax.set_visible(False)
        for ax in grid[-1]:
            if label:
                ax.set_xlabel(label)
            else:
                _dated(ax)
        return figure


def _series(ax: Any, x: np.ndarray, panel: Panel) -> None:
    """Dots of a panel with bars of one u, or where these would hide the dots, one bar of the usual u."""
    ax.axhline(0.0, color=FAINT, lw=0.6)
    dots = {"marker": "o", "ms": 2.6, "ls": "none", "color": SERIES[0], "zorder": 3}
    if panel.u is None or not np.isfinite(panel.u).any():
        ax.plot(x, panel.values, **dots)
    elif len(x) <= DENSE:
        ax.errorbar(x, panel.values, yerr=panel.u, ecolor=FAINT, elinewidth=0.8, capsize=0, **dots)
    else:
        ax.plot(x, panel.values, **dots)
        usual = float(np.nanmedian(panel.u))
        ax.errorbar(
            [0.985],
            [0.5 * sum(ax.get_ylim())],
            yerr=[usual],
            transform=ax.get_yaxis_transform(),
            ecolor=BAD,
            elinewidth=1.4,
            capsize=3,
            fmt="none",
            zorder=4,
        )
        ax.annotate(
            f"u {usual:.2g}", (0.985, 1.0), xycoords="axes fraction", ha="right", va="bottom", fontsize=7.5, color=BAD
        )
    finite = panel.values[np.isfinite(panel.values)]
    if len(finite) and not finite.min() <= 0.0 <= finite.max():  # zero is no landmark here
        spread = max(float(np.ptp(finite)), 3.0 * float(np.nanmedian(panel.u)) if panel.u is not None else 0.0)
        middle = 0.5 * float(finite.min() + finite.max())
        ax.set_ylim(middle - 0.6 * spread - 1e-9, middle + 0.6 * spread + 1e-9)
    ax.set_title(panel.label, fontsize=8.5, pad=4.0)
    ax.margins(x=0.02)


def _dated(ax: Any) -> None:
    """Horizontal axis of dates, UTC, in days since 1970."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=3, maxticks=9)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    ax.set_xlabel("date (UTC)")


def _prisms(series: "SurfaceSeries") -> Figure:
    """Mean half-path error and scatter of each prism over the nights, on the aperture."""
    with styled():
        figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
        _, mean, scatter = series.of_prisms()
        known = np.isfinite(series.places).all(axis=1)
        x, y = series.places[known].T
        size = float(np.clip(9000.0 / max(len(x), 1), 4.0, 60.0))
        top = float(np.nanquantile(np.abs(mean[known]), 0.98)) / MICROMETRE or 1.0
        maps: tuple[tuple[str, np.ndarray, Any], ...] = (
            ("mean half-path error (µm)", mean, {"cmap": "RdBu_r", "vmin": -top, "vmax": top}),
            ("scatter over the nights (µm)", scatter, {"cmap": "viridis"}),
        )
        for ax, (label, values, colours) in zip(figure.subplots(1, 2, sharey=True), maps, strict=True):
            dots = ax.scatter(x, y, c=values[known] / MICROMETRE, s=size, lw=0.2, ec=INK, **colours)
            ax.set_aspect("equal")
            ax.set_xlabel("x, nominal reflector (m)")
            figure.colorbar(dots, ax=ax, label=label, shrink=0.86)
        figure.axes[0].set_ylabel("y (m)")
        return figure
