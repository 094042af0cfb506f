"""Figures of a pointing fit and of a track profile."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, nice, styled
from catseye.reduction.pose.pointing_fit import PointingFit
from catseye.reduction.pose.track_profile import TrackProfile

TITLES = ("azimuth times cos E", "elevation")


def fit_figures(fit: PointingFit) -> dict[str, Figure]:
    """Residuals by azimuth and elevation, on the sky, and correlations of the terms."""
    with styled():
        return {"residuals": _residuals(fit), "sky": _sky(fit), "correlation": _correlation(fit)}


def _residuals(fit: PointingFit) -> Figure:
    figure = Figure(figsize=(9.4, 4.8), layout="constrained")
    panels = figure.subplots(2, 2, sharey=True)
    residual = fit.residual / ARCSECOND
    limit = 1.15 * float(np.abs(residual[fit.used]).max(initial=0.1))
    for row, title in enumerate(TITLES):
        for ax, x, label in (
            (panels[row, 0], np.mod(fit.azimuth, 2 * np.pi) / DEGREE, "azimuth (deg)"),
            (panels[row, 1], fit.elevation / DEGREE, "elevation (deg)"),
        ):
            ax.axhline(0.0, color=FAINT, lw=0.8)
            ax.scatter(x[fit.used], residual[fit.used, row], s=16, color=SERIES[row], lw=0)
            out = ~fit.used
            clipped = np.clip(residual[out, row], -limit, limit)
            ax.scatter(x[out], clipped, s=22, marker="x", color=BAD, lw=1.1)
            ax.set_title(title)
            ax.set_xlabel(label)
        panels[row, 0].set_ylabel("residual (arcsec)")
    panels[0, 0].set_ylim(-1.1 * limit, 1.1 * limit)
    if (~fit.used).any():
        figure.supxlabel("crosses: excluded; those outside the range are at the margin", fontsize=8, color=BAD)
    return figure


def _sky(fit: PointingFit) -> Figure:
    """Residual arrows on the sky: north up, east to the right, the zenith in the middle."""
    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    ax = figure.add_subplot()
    z = 90.0 - fit.elevation / DEGREE
    east, north = z * np.sin(fit.azimuth), z * np.cos(fit.azimuth)
    used, r = fit.used, fit.residual / ARCSECOND
    # right for the viewer is increasing azimuth; up is towards the zenith, the drawing's middle
    dx = r[:, 0] * np.cos(fit.azimuth) - r[:, 1] * np.sin(fit.azimuth)
    dy = -r[:, 0] * np.sin(fit.azimuth) - r[:, 1] * np.cos(fit.azimuth)
    turn = np.linspace(0, 2 * np.pi, 181)
    for ring in (30, 60, 90):
        ax.plot(ring * np.cos(turn), ring * np.sin(turn), color=FAINT, lw=0.6)
        ax.annotate(f"{90 - ring}°", (0, ring), fontsize=7.5, color=FAINT, xytext=(2, 2), textcoords="offset points")
    key = nice(max(float(np.hypot(dx[used], dy[used]).max(initial=0.0)), 1e-3))
    unit = 12.0 / key
    style: Any = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0035}
    ax.quiver(east[used], north[used], dx[used] * unit, dy[used] * unit, color=SERIES[0], **style)
    ax.quiver([-92], [-97], [12.0], [0.0], color=INK, **style)
    ax.annotate(f"{key:g} arcsec", (-78, -97), fontsize=8, va="center")
    for text, at in (("N", (0, 97)), ("E", (97, 0)), ("S", (0, -97)), ("W", (-97, 0))):
        ax.annotate(text, at, ha="center", va="center", fontsize=9)
    ax.set_xlim(-104, 104)
    ax.set_ylim(-104, 104)
    ax.set_aspect("equal")
    ax.axis("off")
    return figure


def _correlation(fit: PointingFit) -> Figure:
    terms, c = fit.series.terms, fit.correlation
    figure = Figure(figsize=(5.6, 4.6), layout="constrained")
    ax = figure.add_subplot()
    drawn = ax.imshow(c, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    ax.grid(visible=False)
    ax.set_xticks(range(len(terms)), terms)
    ax.set_yticks(range(len(terms)), terms)
    for i in range(len(terms)):
        for j in range(len(terms)):
            ax.annotate(
                f"{c[i, j]:.2f}",
                (j, i),
                ha="center",
                va="center",
                fontsize=7,
                color="white" if abs(c[i, j]) > 0.6 else INK,
            )
    figure.colorbar(drawn, ax=ax, label="correlation", shrink=0.85)
    return figure


def track_figures(profile: TrackProfile) -> dict[str, Figure]:
    """Tilt by azimuth with uncertainty and observations, and residuals."""
    with styled():
        return {"tilt": _tilt(profile), "residuals": _residual_tilts(profile)}


def _tilt(profile: TrackProfile) -> Figure:
    figure = Figure(figsize=(9.4, 4.2), layout="constrained")
    ax = figure.add_subplot()
    azimuth = np.linspace(0.0, 2 * np.pi, 361)
    tilt, spread = profile.series.at(azimuth)
    for axis, name in enumerate(("about east", "about north")):
        u = np.sqrt(np.maximum(spread[:, axis, axis], 0.0)) / ARCSECOND
        value = tilt[:, axis] / ARCSECOND
        ax.fill_between(azimuth / DEGREE, value - 2 * u, value + 2 * u, color=SERIES[axis], alpha=0.18, lw=0)
        ax.plot(azimuth / DEGREE, value, color=SERIES[axis], lw=1.4, label=f"{name}, band 2 u")
        ax.axhline(profile.series.values[axis] / ARCSECOND, color=SERIES[axis], lw=0.8, ls=":")
    ax.set_xticks(range(0, 361, 45))
    ax.set_xlim(0, 360)
    ax.set_xlabel("azimuth (deg)")
    ax.set_ylabel("tilt of the alidade (arcsec)")
    ax.legend(loc="upper right", ncols=2)
    return figure


def _residual_tilts(profile: TrackProfile) -> Figure:
    figure = Figure(figsize=(9.4, 4.0), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    x = np.mod(profile.azimuth, 2 * np.pi) / DEGREE
    pose = np.arange(len(x)) < profile.poses
    for axis, (ax, name) in enumerate(zip(panels, ("about x", "about y"), strict=True)):
        ax.axhline(0.0, color=FAINT, lw=0.8)
        for rows, label, colour, marker in ((~pose, "inclinometer", SERIES[2], "."), (pose, "poses", SERIES[1], "o")):
            if rows.any():
                y = profile.residual[rows, axis] / ARCSECOND
                ax.scatter(x[rows], y, s=18, marker=marker, color=colour, label=label, lw=0)
        ax.set_title(f"residual {name} of the alidade")
        ax.set_xticks(range(0, 361, 90))
        ax.set_xlabel("azimuth (deg)")
    panels[0].set_ylabel("arcsec")
    panels[1].legend(loc="upper right")
    return figure
