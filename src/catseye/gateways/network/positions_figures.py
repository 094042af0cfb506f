"""Figures of located targets: stations, ranges, positions with their ellipses, second solutions."""

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.patheffects import withStroke

from catseye.constants import DEGREE
from catseye.estimation.quality.ellipsoid import PLAN, elevation_view, ellipse, projected
from catseye.gateways.network.figures import STATION, TARGET, CaptionedFigure, scale_bar, thousands, view_frame
from catseye.gateways.writers.drawing import BAD, FAINT, INK, nice, styled
from catseye.reduction.network.positions import LocatedTargets

SHARE = 0.05  # of the extent: longest axis of the median ellipse
NAMED = 30  # targets named at most
LINES = 1500  # ranges drawn at most


def positions_figures(located: LocatedTargets) -> dict[str, CaptionedFigure]:
    """Plan and elevation of stations and targets; none where no target was found."""
    if not np.isfinite(located.positions.x).all(axis=1).any():
        return {}
    with styled():
        return {name: _view(located, bearing) for name, bearing in (("plan", None), ("elevation", _across(located)))}


def _across(located: LocatedTargets) -> float:
    """Bearing of the elevation, rad, a whole degree: across the longest extent of the stations in plan."""
    level = located.stations[:, :2] - located.stations[:, :2].mean(axis=0)
    spread = level.T @ level
    longest = 0.5 * np.arctan2(2.0 * spread[0, 1], spread[1, 1] - spread[0, 0])
    return float(np.round((longest - 0.5 * np.pi) / DEGREE) % 180.0 * DEGREE)


def _view(located: LocatedTargets, bearing: float | None) -> CaptionedFigure:
    axes = PLAN if bearing is None else elevation_view(bearing)
    x, covariance = located.positions.x, located.positions.covariance
    located_rows = np.flatnonzero(np.isfinite(x).all(axis=1))
    stations, targets = located.stations @ axes.T, x[located_rows] @ axes.T
    two = np.zeros(0, dtype=int)
    images = np.zeros((0, 2))
    if located.other is not None:
        two = np.flatnonzero(np.isfinite(located.other.x).all(axis=1))
        images = located.other.x[two] @ axes.T
    places = np.concatenate([stations, targets, images])
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float(np.max(high - low)), 1e-3)
    figure, ax = view_frame(0.5 * (low + high), high - low + 0.2 * size)
    outlines = ellipse(projected(covariance[located_rows], axes))
    scale = nice(SHARE * size / float(np.median(outlines.major)))
    _lines(ax, located, located_rows, (stations, targets))
    colours = np.where(located.contradicting[located_rows], BAD, TARGET)
    ax.add_collection(
        EllipseCollection(
            2 * scale * outlines.major, 2 * scale * outlines.minor, 90.0 - outlines.bearing / DEGREE, units="xy",
            offsets=targets, offset_transform=ax.transData, facecolors=[f"{c}20" for c in colours],
            edgecolors=list(colours), linewidths=0.7, zorder=3,
        )
    )  # fmt: skip
    ax.scatter(*stations.T, s=30, c=STATION, marker="^", lw=0, zorder=4, label="station")
    good = ~located.contradicting[located_rows]
    ax.scatter(*targets[good].T, s=12, c=TARGET, lw=0, zorder=4, label="target")
    if not good.all():
        ax.scatter(*targets[~good].T, s=16, c=BAD, lw=0, marker="D", zorder=4, label="ranges contradict each other")
    if len(two):
        ax.scatter(*images.T, s=18, facecolors="white", edgecolors=TARGET, zorder=4, label="second solution")
        pairs = np.full((len(two), 3, 2), np.nan)
        pairs[:, 0], pairs[:, 1] = x[two] @ axes.T, images
        ax.plot(*pairs.reshape(-1, 2).T, color=TARGET, lw=0.7, ls=":", zorder=2)
    _names(ax, located.station_names, stations, STATION)
    _names(ax, [located.target_names[k] for k in located_rows[:NAMED]], targets[:NAMED], INK)
    scale_bar(ax, nice(0.2 * size), scale)
    ax.set_xlabel("x (m)" if bearing is None else f"horizontal distance towards azimuth {_towards(bearing):.0f}° (m)")
    ax.set_ylabel("y (m)" if bearing is None else "z (m)")
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", ncols=6)
    view = "Plan." if bearing is None else f"Elevation, seen towards azimuth {bearing / DEGREE:.0f}°."
    return CaptionedFigure(
        figure, f"{view} Thin lines: ranges. Outlines: standard ellipses (1σ), enlarged {thousands(scale)} times."
    )


def _towards(bearing: float) -> float:
    return float((bearing / DEGREE + 90.0) % 360.0)


def _lines(ax: Any, located: LocatedTargets, located_rows: np.ndarray, places: tuple[np.ndarray, np.ndarray]) -> None:
    stations, targets = places
    target, station = np.nonzero(np.isfinite(located.ranges[located_rows]))
    step = max(1, int(np.ceil(len(target) / LINES)))
    ends = np.full((len(target[::step]), 3, 2), np.nan)
    ends[:, 0], ends[:, 1] = stations[station[::step]], targets[target[::step]]
    ax.plot(*ends.reshape(-1, 2).T, color=FAINT, lw=0.7, alpha=0.5, zorder=1, label="range")


def _names(ax: Any, names: Any, places: np.ndarray, colour: str) -> None:
    for name, at in zip(names, places, strict=True):
        ax.annotate(
            name, at, xytext=(5, 5), textcoords="offset points", fontsize=7.5, color=colour, zorder=5,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )  # fmt: skip
