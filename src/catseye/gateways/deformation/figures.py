"""Figures of movements: plan and elevation with displacements and their confidence ellipses."""

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.patheffects import withStroke

from catseye.constants import DEGREE
from catseye.estimation.quality.ellipsoid import PLAN, confidence_scale, elevation_view, ellipse, projected
from catseye.gateways.network.figures import STATION, CaptionedFigure, scale_bar, thousands, view_frame
from catseye.gateways.writers.drawing import BAD, FAINT, INK, nice, styled
from catseye.reduction.deformation.movements import MeasuredMovements

CONFIDENCE = 0.95
REST = "#1f5a99"
SHARE = 0.12  # of the points' extent: longest displacement
FAR = 3.0  # times the points' extent: a station further away is not drawn
BEARING = 0.0  # of the elevation, rad: towards y


def movement_figures(measured: MeasuredMovements) -> dict[str, CaptionedFigure]:
    """Plan and elevation; none where no movement is determined."""
    if not measured.determined.any():
        return {}
    with styled():
        return {name: _view(measured, bearing) for name, bearing in (("plan", None), ("elevation", BEARING))}


def _view(measured: MeasuredMovements, bearing: float | None) -> CaptionedFigure:
    axes = PLAN if bearing is None else elevation_view(bearing)
    places, stations = measured.changes.x @ axes.T, measured.changes.x_stations @ axes.T
    solved_rows = np.flatnonzero(measured.determined)
    shift = measured.displacement[solved_rows] @ axes.T
    outlines = ellipse(projected(measured.covariances[solved_rows], axes))
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    size = max(float(np.max(np.ptp(places, axis=0))), 1e-3)
    factor = confidence_scale(CONFIDENCE, 2)
    longest = max(float(np.hypot(*shift.T).max()), factor * float(np.median(outlines.major)), 1e-12)
    scale = nice(SHARE * size / longest)
    low, high = _extent(places, solved_rows, shift * scale, factor * scale * outlines.major)
    figure, ax = view_frame(0.5 * (low + high), high - low + 0.12 * size)
    near = np.abs(stations - centre).max(axis=1) < FAR * size
    edge = (np.abs(stations - 0.5 * (low + high)) <= 0.5 * (high - low) + 0.06 * size).all(axis=1) & near
    if edge.any():
        ax.scatter(*stations[edge].T, s=30, c=STATION, marker="^", lw=0, zorder=4, label="station")
        _names(ax, [measured.changes.stations[k] for k in np.flatnonzero(edge)], stations[edge], STATION)
    words = np.array(measured.words)
    for word, colour in (("at rest", REST), ("moved", BAD)):
        chosen = words[solved_rows] == word
        if chosen.any():
            _arrows(ax, places[solved_rows][chosen], scale * shift[chosen], colour, word)
            ax.add_collection(
                EllipseCollection(
                    2 * scale * factor * outlines.major[chosen], 2 * scale * factor * outlines.minor[chosen],
                    90.0 - outlines.bearing[chosen] / DEGREE, units="xy",
                    offsets=places[solved_rows][chosen] + scale * shift[chosen], offset_transform=ax.transData,
                    facecolors=f"{colour}18", edgecolors=colour, linewidths=0.7, zorder=2,
                )
            )  # fmt: skip
    for word, marker, colour in (("held", "s", INK), ("undetermined", "o", FAINT)):
        at = places[words == word]
        if len(at):
            ax.scatter(*at.T, s=22, facecolors="white", edgecolors=colour, marker=marker, zorder=3, label=word)
    _names(ax, measured.changes.points, places, INK)
    scale_bar(ax, nice(0.2 * size), scale, what="displacements and ellipses")
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)" if bearing is None else "z (m)")
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", ncols=6)
    view = "Plan." if bearing is None else "Elevation, seen towards y."
    return CaptionedFigure(
        figure,
        f"{view} Arrows: movements; outlines at their tips: {100 * CONFIDENCE:g} % confidence ellipses; both enlarged "
        f"{thousands(scale)} times. Stations outside the frame are not shown.",
    )


def _extent(places: np.ndarray, solved_rows: np.ndarray, shift: np.ndarray, radius: np.ndarray) -> Any:
    """Lower and upper corner of what is drawn."""
    tips = places[solved_rows] + shift
    around = np.minimum(radius, 2.0 * float(np.median(radius)) + 1e-12)[:, None]
    drawn = np.concatenate([places, tips - around, tips + around])
    return drawn.min(axis=0), drawn.max(axis=0)


def _arrows(ax: Any, base: np.ndarray, shift: np.ndarray, colour: str, word: str) -> None:
    ax.quiver(
        *base.T, *shift.T, angles="xy", scale_units="xy", scale=1.0, color=colour, width=0.0022, headwidth=4.0,
        headlength=5.0, headaxislength=4.5, minlength=0.1, zorder=4,
    )  # fmt: skip
    ax.scatter(*base.T, s=6, c=colour, lw=0, zorder=3, label=word)


def _names(ax: Any, names: Any, places: np.ndarray, colour: str) -> None:
    for name, at in zip(names, places, strict=True):
        ax.annotate(
            name, at, xytext=(5, 5), textcoords="offset points", fontsize=7.5, color=colour, zorder=5,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )  # fmt: skip
