"""Figures of a pose: residuals of the points, and terms of the pointing offset."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, nice, styled
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.pointing_offsets import PointingOffset

NAMED = 14  # most points with names
LENGTH = 0.12  # length of the largest residual's arrow over the group's size


def pose_figures(result: PoseFindings) -> dict[str, Figure]:
    """Figures of the report, by name."""
    with styled():
        drawn = {"residuals": _residuals(result)}
        if result.beam is not None:
            drawn["terms"] = _terms(result.beam)
        return drawn


def _residuals(result: PoseFindings) -> Figure:
    """Residuals as arrows in the group's two longer extents, and as colour across them."""
    pose, places = result.pose.pose, result.pose.places
    residual = pose.motion.residual / MILLIMETRE
    extent = np.ptp(places, axis=0)
    i, j = sorted(np.argsort(-extent, kind="stable")[:2].tolist())
    k = 3 - i - j
    figure = Figure(figsize=(9.4, 6.2), layout="constrained")
    ax = figure.add_subplot()
    largest = float(np.hypot(residual[:, i], residual[:, j]).max(initial=0.0))
    size = float(max(extent[i], extent[j]))
    top = max(float(np.abs(residual[:, k]).max(initial=0.0)), 1e-9)
    dots = ax.scatter(
        places[:, i],
        places[:, j],
        c=residual[:, k],
        cmap="RdBu_r",
        vmin=-top,
        vmax=top,
        s=34,
        lw=0.6,
        ec=FAINT,
        zorder=3,
    )
    if largest > 0.0:
        unit = LENGTH * size / largest
        style: Any = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "color": INK, "width": 0.0018, "zorder": 2}
        ax.quiver(places[:, i], places[:, j], residual[:, i] * unit, residual[:, j] * unit, **style)
        key = nice(largest)
        x0, y0 = places[:, i].min() - 0.06 * size, places[:, j].min() - 0.12 * size
        ax.quiver([x0], [y0], [key * unit], [0.0], **style)
        ax.annotate(f"{key:g} mm", (x0 + key * unit, y0), xytext=(5, -3), textcoords="offset points", fontsize=8)
    if len(pose.names) <= NAMED:
        for name, place in zip(pose.names, places, strict=True):
            ax.annotate(name, (place[i], place[j]), xytext=(5, 5), textcoords="offset points", fontsize=7.5)
    ax.plot(*pose.pivot[[i, j]], "+", color=BAD, ms=11, mew=1.6, label="pivot", zorder=4, ls="none")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    ax.set_xlabel(f"{'xyz'[i]}, {pose.frame} (m)")
    ax.set_ylabel(f"{'xyz'[j]}, {pose.frame} (m)")
    figure.colorbar(dots, ax=ax, label=f"residual along {'xyz'[k]} (mm)", shrink=0.8)
    ax.legend(loc="upper right")
    return figure


def _terms(beam: PointingOffset) -> Figure:
    """Bars of each term's part of azimuth times cos E and elevation, and the sum with its u."""
    figure = Figure(figsize=(9.4, 2.2 + 0.34 * len(beam.terms)), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    names = [*beam.terms, "together"]
    for axis, (ax, title) in enumerate(zip(panels, ("azimuth times cos E", "elevation"), strict=True)):
        values = np.array([*(part[axis] for part in beam.terms.values()), beam.offset[axis]]) / ARCSECOND
        u = float(np.sqrt(max(beam.covariance[axis, axis], 0.0))) / ARCSECOND
        colours = [SERIES[0]] * len(beam.terms) + [SERIES[1]]
        rows = np.arange(len(names))
        ax.barh(rows, values, color=colours, height=0.62)
        ax.errorbar(values[-1:], rows[-1:], xerr=[2 * u], fmt="none", ecolor=INK, elinewidth=1.2, capsize=3)
        ax.axvline(0.0, color=FAINT, lw=0.8)
        for row, value in zip(rows, values, strict=True):
            right = value >= 0.0
            bar = 2 * u if row == rows[-1] else 0.0
            ax.annotate(
                f"{value:+.2f}" if abs(value) >= 0.005 else "0",
                (value + (bar if right else -bar), row),
                xytext=(4 if right else -4, 0),
                textcoords="offset points",
                ha="left" if right else "right",
                va="center",
                fontsize=7.5,
            )
        ax.margins(x=0.22)
        ax.grid(visible=False, axis="y")
        ax.set_title(title)
        ax.set_xlabel("offset of the beam (arcsec); bar of the sum: 2 u")
        ax.set_yticks(rows, names)
    panels[0].invert_yaxis()
    return figure
