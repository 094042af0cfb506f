"""Figures of two compared epochs: plan and elevation with displacements."""

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from catseye.constants import DEGREE
from catseye.estimation.deformation.deformation import Deformation
from catseye.estimation.quality.ellipsoid import PLAN, confidence_scale, elevation_view, ellipse
from catseye.gateways.network.figures import (
    CaptionedFigure,
    file_ticks,
    point_names,
    scale_bar,
    thousands,
    view_frame,
    views,
)
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, nice, styled
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import UNTESTED, ComparedEpochs

CONFIDENCE = 0.95
STILL = "#1f5a99"
DOUBT = SERIES[4]
SHARE = 0.12  # approximate size of the longest displacement or ellipse, share of the network's extent


def comparison_figures(compared: ComparedEpochs) -> dict[str, CaptionedFigure]:
    """Plan and elevation with displacements and confidence ellipses, if any point can be shown.

    compared   two epochs
    """
    with styled():
        drawn = {name: _view(compared, bearing) for name, bearing in views(compared.first).items()}
        return {name: CaptionedFigure(figure, caption) for name, (figure, caption) in drawn.items()}


def _view(compared: ComparedEpochs, bearing: float | None) -> tuple[Figure, str]:
    d, first = compared.deformation, compared.first
    axes = PLAN if bearing is None else elevation_view(bearing)
    existing = first.network.points.existing
    visible = existing[:, :2] if bearing is None else existing
    placed = np.asarray(visible.all(axis=1))
    flat = np.where(placed[:, None], np.nan_to_num(first.solution.x) @ axes.T, np.nan)
    view_rows = compared.rows[np.isfinite(flat[compared.rows]).all(axis=1)]
    if not len(view_rows):
        view_rows = np.flatnonzero(np.isfinite(flat).all(axis=1))
    if bearing is not None:
        flat[:, 0] -= flat[view_rows, 0].min()
    low, high = flat[view_rows].min(axis=0), flat[view_rows].max(axis=0)
    size = max(float(np.max(high - low)), 1e-3)
    shift, spread = _in_view(d, axes)
    factor = confidence_scale(CONFIDENCE, 2, compared.variance_factor.degrees_of_freedom)
    outlines = ellipse(spread)
    longest = np.fmax(np.hypot(*shift.T), factor * outlines.major)
    longest = longest[np.isfinite(longest) & (longest > 0.0)]
    scale = nice(SHARE * size / float(np.max(longest))) if len(longest) else np.nan
    figure, ax = view_frame(0.5 * (low + high), high - low + (0.16 + 2.0 * SHARE) * size)
    scale_bar(ax, nice(0.2 * size), scale, what="displacements and ellipses")
    common = np.zeros(len(flat), dtype=bool)
    common[compared.rows] = True
    if not common.all():
        ax.scatter(*flat[~common].T, s=10, c=FAINT, marker="o", lw=0, zorder=2, label="not compared", alpha=0.6)
    if np.isfinite(scale):
        _arrows(ax, compared, (flat[compared.rows], scale * shift), (outlines, scale * factor))
    point_names(ax, first, np.where(common[:, None], flat, np.nan))
    _labels(ax, first, bearing)
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", ncols=6)
    view = "Plan." if bearing is None else f"Elevation, seen towards azimuth {bearing / DEGREE:.0f}°."
    if not np.isfinite(scale):
        return figure, f"{view} No displacement is known in this view."
    return figure, (
        f"{view} Arrows: displacements; outlines: their {100 * CONFIDENCE:g} % confidence ellipses about no "
        f"displacement; both enlarged {thousands(scale)} times. A point is judged by all of its coordinates together."
    )


def _in_view(d: Deformation, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, 2) and covariances (n, 2, 2) in a view; nan where a component is unknown."""
    in_plane = axes.any(axis=0)
    finite = np.isfinite(d.displacement[:, in_plane]).all(axis=1)
    shift = np.where(finite[:, None], np.nan_to_num(d.displacement) @ axes.T, np.nan)
    return shift, np.where(finite[:, None, None], axes @ np.nan_to_num(d.covariance) @ axes.T, np.nan)


def _arrows(ax: Any, compared: ComparedEpochs, drawn: tuple[np.ndarray, np.ndarray], shape: tuple[Any, float]) -> None:
    """Draw displacements and ellipses by verdict."""
    (base, shift), (shapes, scale) = drawn, shape
    verdicts = np.array(compared.verdicts)
    for word, colour in (("stable", STILL), ("undecided", DOUBT), ("moved", BAD)):
        chosen = (verdicts == word) & np.isfinite(shift).all(axis=1)
        if not chosen.any():
            continue
        ax.add_collection(
            EllipseCollection(
                2 * scale * shapes.major[chosen], 2 * scale * shapes.minor[chosen],
                90.0 - shapes.bearing[chosen] / DEGREE,
                units="xy", offsets=base[chosen], offset_transform=ax.transData, facecolors=f"{colour}18",
                edgecolors=colour, linewidths=0.7, zorder=2,
            )
        )  # fmt: skip
        ax.quiver(
            *base[chosen].T, *shift[chosen].T, angles="xy", scale_units="xy", scale=1.0, color=colour, width=0.0022,
            headwidth=4.0, headlength=5.0, headaxislength=4.5, minlength=0.1, zorder=4,
        )  # fmt: skip
        ax.scatter(*base[chosen].T, s=5, c=colour, lw=0, zorder=3, label=word)
    for word, marker in (("held", "s"), (UNTESTED, "o")):
        chosen = verdicts == word
        if chosen.any():
            ax.scatter(
                *base[chosen].T, s=20, facecolors="white", edgecolors=INK, marker=marker, lw=0.9, zorder=3, label=word
            )


def _labels(ax: Any, adjusted: AdjustedNetwork, bearing: float | None) -> None:
    if bearing is None:
        file_ticks(ax.xaxis, adjusted, 0, word="east", opposite="west")
        file_ticks(ax.yaxis, adjusted, 1, word="north", opposite="south")
    else:
        ax.set_xlabel(f"horizontal distance towards azimuth {(bearing / DEGREE + 90.0) % 360.0:.0f}° (m)")
        file_ticks(ax.yaxis, adjusted, 2, word="up", opposite="down")
