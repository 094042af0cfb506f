"""Figure of the third order: displacement by the structural model, and what was measured beyond it, with u."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.patheffects import withStroke

from catseye.constants import DEGREE, MILLIMETRE
from catseye.estimation.quality.ellipsoid import PLAN, confidence_scale, elevation_view, ellipse, projected
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.writers.drawing import FAINT, INK, Figure, nice
from catseye.reduction.epoch.epoch import Reduction

CONFIDENCE = 0.95
ARROW = 0.20  # of the telescope's extent: the longest arrow
OUTLINE = 0.06  # of the telescope's extent: radius of the median ellipse
MARGIN = 0.04  # of the telescope's extent
NAMED = 3  # points with the longest arrows, and their names
DISH, PRISM, BALL = "dish prism", "triplet prism", "triplet ball"


def third_order_figure(reduction: Reduction, colours: Mapping[str, str]) -> Figure | None:
    """Arrows from above and from the side; None without a structural model.

    colours   of the kinds of points

    A triplet is drawn by its ball, and by its prisms where the ball was not measured.
    """
    order = reduction.third_order
    if order is None:
        return None
    coordinates, kinds = reduction.coordinates, kinds_of(reduction)
    names = _drawn(order.names, kinds)
    rows = [order.names.index(name) for name in names]
    places = coordinates.x[coordinates.rows(names)]
    dish = coordinates.x[[row for row, kind in enumerate(kinds.values()) if kind == DISH]]
    colour = [colours[kinds[name]] for name in names]
    azimuth = float(np.asarray(order.posture.azimuth))
    views = (PLAN, elevation_view(azimuth - 90.0 * DEGREE))  # from the side, looking to the right
    size = max(float(np.max(np.ptp(places, axis=0))), 1.0)

    figure = Figure(figsize=(9.4, 10.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex="row", sharey="row")
    for column, (title, vectors, covariance) in enumerate(
        (
            ("Displacement by the model", order.displacement[rows], None),
            ("Measured less model", order.residual[rows], order.covariance[rows]),
        )
    ):
        scale = _scale(size, vectors, covariance)
        for ax, axes in zip(panels[:, column], views, strict=True):
            ax.scatter(*(dish @ axes.T).T, s=4, c=FAINT, lw=0, alpha=0.5, zorder=1, rasterized=len(dish) > 300)
            tips = (places + scale * vectors) @ axes.T
            _arrows(ax, names, colour, places @ axes.T, tips)
            if covariance is not None:
                _outlines(ax, colour, tips, projected(covariance, axes), scale)
            ax.set_aspect("equal")
            ax.margins(MARGIN)
        panels[0, column].set_title(f"{title}\n{_enlargement(scale, vectors, covariance is not None)}", fontsize=8.5)
        panels[0, column].set_xlabel("x, east (m)")
        panels[1, column].set_xlabel(f"horizontal distance towards azimuth {azimuth / DEGREE:g}° (m)")
    panels[0, 0].set_ylabel("y, north (m)")
    panels[1, 0].set_ylabel("z, up (m)")
    for kind in dict.fromkeys(kinds[name] for name in names):
        panels[0, 0].scatter([], [], s=14, c=colours[kind], lw=0, label=kind)
    if len(dish):
        panels[0, 0].scatter([], [], s=10, c=FAINT, lw=0, alpha=0.6, label=f"{DISH}, for orientation")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _drawn(names: tuple[str, ...], kinds: Mapping[str, str]) -> tuple[str, ...]:
    """Points to draw: all but the prisms beside a ball."""
    units = {name.rpartition("-")[0] for name in names if kinds[name] == BALL}
    return tuple(name for name in names if kinds[name] != PRISM or name.rpartition("-")[0] not in units)


def _scale(size: float, vectors: np.ndarray, covariance: np.ndarray | None) -> float:
    """Factor of enlargement; 1 where there is nothing to enlarge."""
    sizes = [float(np.linalg.norm(vectors, axis=1).max()) / ARROW]
    if covariance is not None:
        radius = confidence_scale(CONFIDENCE, 2) * np.sqrt(np.linalg.eigvalsh(covariance)[:, -1])
        sizes.append(float(np.median(radius)) / OUTLINE)
    return nice(size / max(sizes)) if max(sizes) > 0.0 else 1.0


def _arrows(ax: Any, names: tuple[str, ...], colour: list[str], at: np.ndarray, tips: np.ndarray) -> None:
    """Draw an arrow for each point, with the names of the longest."""
    ax.quiver(
        *at.T, *(tips - at).T, angles="xy", scale_units="xy", scale=1.0, color=colour, width=0.005, headwidth=3.2,
        headlength=4.0, headaxislength=3.6, minlength=0.1, zorder=4,
    )  # fmt: skip
    ax.update_datalim(tips)
    ax.scatter(*at.T, s=11, c=colour, lw=0, zorder=3)
    length = np.hypot(*(tips - at).T)
    for k in np.argsort(-length, kind="stable")[: NAMED if length.any() else 0]:
        onward = (tips[k] - at[k]) / max(float(length[k]), 1e-9)
        ax.annotate(
            names[k], tips[k], xytext=8.0 * onward, textcoords="offset points", fontsize=7.5, color=INK, zorder=2.5,
            ha="left" if onward[0] > 0.3 else "right" if onward[0] < -0.3 else "center",
            va="bottom" if onward[1] > 0.3 else "top" if onward[1] < -0.3 else "center",
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )  # fmt: skip


def _outlines(ax: Any, colour: list[str], tips: np.ndarray, covariance: np.ndarray, scale: float) -> None:
    """Draw the confidence ellipses of arrows at their tips."""
    shapes, factor = ellipse(covariance), scale * confidence_scale(CONFIDENCE, 2)
    ax.add_collection(
        EllipseCollection(
            2.0 * factor * shapes.major, 2.0 * factor * shapes.minor, 90.0 - shapes.bearing / DEGREE, units="xy",
            offsets=tips, offset_transform=ax.transData, facecolors=[f"{shade}10" for shade in colour],
            edgecolors=[f"{shade}a0" for shade in colour], linewidths=0.7, zorder=2,
        )
    )  # fmt: skip
    radius = factor * shapes.major[:, None]
    ax.update_datalim(np.concatenate([tips - radius, tips + radius]))


def _enlargement(scale: float, vectors: np.ndarray, outlined: bool) -> str:
    """Line of the title: how far arrows are enlarged, by an example."""
    longest = float(np.linalg.norm(vectors, axis=1).max())
    if longest == 0.0:
        return "none"
    bar = nice(longest)
    text = f"{scale:,.0f} times: {bar / MILLIMETRE:g} mm is drawn as {bar * scale:.3g} m".replace(",", "\u2009")
    return f"{text}; {100.0 * CONFIDENCE:g} % ellipses" if outlined else text
