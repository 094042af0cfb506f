"""Figures of an adjusted network: plan, elevation, residuals, redundancy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter

from catseye.constants import DEGREE, MILLIMETRE
from catseye.estimation.quality.ellipsoid import PLAN, Ellipse, elevation_view, ellipse, projected
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, nice, styled, svg
from catseye.reduction.network.adjusted import AdjustedNetwork

STATION, TARGET, FIXED, PALE = "#1f5a99", "#1e8e74", "#22303c", "#6f8fa8"
DENSE = 300  # points or marks from which they are rasterised and only some named
LINES = 2_500  # observations drawn as lines at most
NAMED = 45  # points named at most
LOOSE = 20.0  # times the median ellipse; larger ones are not drawn
SHARE = 0.05  # longest axis of the median ellipsoid over the network's extent, for few points
RASTER = 144  # dots per inch
WIDTH = 9.4  # inches, of every figure
ROUND = np.array([(1, 0), (-1, 0), (0, 1), (0, -1), (0.8, 0.8), (-0.8, 0.8), (0.8, -0.8), (-0.8, -0.8)])


@dataclass(frozen=True)
class CaptionedFigure:
    """Figure and the text of its caption."""

    figure: Figure
    caption: str

    @property
    def svg(self) -> str:
        """Figure as the text of an SVG file."""
        return svg(self.figure)


def network_figures(adjusted: AdjustedNetwork) -> dict[str, CaptionedFigure]:
    """Plan, elevation, residuals and redundancy by name, where not empty; x east, y north, z up.

    adjusted   network
    """
    with styled():
        drawn = {name: _view(adjusted, bearing) for name, bearing in views(adjusted).items()}
        if np.isfinite(adjusted.table.standardised).any():
            drawn |= {"residuals": _residuals(adjusted), "redundancy": _redundancy(adjusted)}
        return {name: CaptionedFigure(figure, caption) for name, (figure, caption) in drawn.items()}


def views(adjusted: AdjustedNetwork) -> dict[str, float | None]:
    """Bearing of each view that has a point to show; None from above.

    adjusted   network
    """
    existing = adjusted.network.points.existing
    plan_view = {"plan": None} if existing[:, :2].all(axis=1).any() else {}
    return {**plan_view, **({"elevation": looking(adjusted)} if existing.all(axis=1).any() else {})}


def looking(adjusted: AdjustedNetwork) -> float:
    """Viewing bearing of the elevation, rad, a whole degree: across the longest extent in plan.

    adjusted   network
    """
    level = adjusted.solution.x[:, :2]
    level = level[adjusted.network.points.existing[:, :2].all(axis=1)]
    level = level - np.nanmean(level, axis=0)
    spread = level.T @ level
    if not np.isfinite(spread).all():
        return 0.0
    longest = 0.5 * np.arctan2(2.0 * spread[0, 1], spread[1, 1] - spread[0, 0])  # clockwise from north
    round_plan = np.hypot(2.0 * spread[0, 1], spread[1, 1] - spread[0, 0]) < 0.1 * np.trace(spread)
    across = 0.0 if round_plan else longest - 0.5 * np.pi
    return float(np.round(across / DEGREE) % 180.0 * DEGREE)


def enlargement(adjusted: AdjustedNetwork) -> float:
    """Enlargement of the ellipsoids, 1, 2 or 5 times a power of ten; nan for none.

    adjusted   network

    The median ellipsoid's longest axis becomes some hundredths of the network's extent, less with many points.
    """
    longest = adjusted.ellipsoid.semi_axes[:, 0]
    positive = longest[np.isfinite(longest) & (longest > 0.0)]
    if not len(positive):
        return np.nan
    share = SHARE / (1.0 + np.sqrt(len(positive) / 150.0))
    x = adjusted.solution.x[:, adjusted.network.points.existing.any(axis=0)]
    return nice(
        share * max(float(np.max(np.nanmax(x, axis=0) - np.nanmin(x, axis=0))), 1e-3) / float(np.median(positive))
    )


def _view(adjusted: AdjustedNetwork, bearing: float | None) -> tuple[Figure, str]:
    """Draw points, observation lines and ellipses, from above or along a bearing."""
    solution = adjusted.solution
    axes = PLAN if bearing is None else elevation_view(bearing)
    existing = adjusted.network.points.existing[:, :2] if bearing is None else adjusted.network.points.existing
    flat = np.where(existing.all(axis=1, keepdims=True), np.nan_to_num(solution.x) @ axes.T, np.nan)
    finite = np.isfinite(flat).all(axis=1)
    if bearing is not None:
        flat[:, 0] -= flat[finite, 0].min(initial=np.inf if finite.any() else 0.0)
    low, high = (flat[finite].min(axis=0), flat[finite].max(axis=0)) if finite.any() else (np.zeros(2), np.ones(2))
    size = max(float(np.max(high - low)), 1e-3)
    figure, ax = view_frame(0.5 * (low + high), high - low + 0.16 * size)
    lines = _lines(ax, adjusted, flat)
    scale = enlargement(adjusted)
    covariance = np.full((len(flat), 2, 2), np.nan)
    if solution.answered:
        covariance[finite] = projected(np.nan_to_num(solution.covariance[finite]) * adjusted.factor, axes)
    loose, ellipses = _ellipses(ax, adjusted, flat, ellipse(covariance), scale)
    scale_bar(ax, nice(0.2 * size), scale)
    _marks(ax, adjusted, flat, loose)
    point_names(ax, adjusted, flat)
    if bearing is None:
        file_ticks(ax.xaxis, adjusted, 0, word="east", opposite="west")
        file_ticks(ax.yaxis, adjusted, 1, word="north", opposite="south")
        words = "Plan."
    else:
        ax.set_xlabel(f"horizontal distance towards azimuth {(bearing / DEGREE + 90.0) % 360.0:.0f}° (m)")
        file_ticks(ax.yaxis, adjusted, 2, word="up", opposite="down")
        words = f"Elevation, seen towards azimuth {bearing / DEGREE:.0f}°."
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", ncols=6)
    return figure, " ".join([words, ellipses, lines])


def view_frame(centre: np.ndarray, span: np.ndarray) -> tuple[Figure, Any]:
    """Figure of standard width with one pair of equally scaled axes around a centre."""
    pad_x, pad_end, low, high = 0.8, 0.15, 0.85, 0.45  # inches beside the axes
    wide = WIDTH - pad_x - pad_end
    tall = float(np.clip(wide * span[1] / span[0], 1.6, 8.4))
    figure = Figure(figsize=(WIDTH, tall + low + high), dpi=RASTER)
    ax = figure.add_axes((pad_x / WIDTH, low / (tall + low + high), wide / WIDTH, tall / (tall + low + high)))
    metres = max(span[0] / wide, span[1] / tall)  # per inch
    half = 0.5 * metres * np.array([wide, tall])
    ax.set(xlim=(centre[0] - half[0], centre[0] + half[0]), ylim=(centre[1] - half[1], centre[1] + half[1]))
    ax.set_aspect("equal")
    return figure, ax


def file_ticks(axis: Any, adjusted: AdjustedNetwork, k: int, *, word: str, opposite: str) -> None:
    """Set ticks that show the file's own coordinate, in its direction of counting."""
    axes = adjusted.network.axes
    j = int(np.argmax(np.abs(axes[k])))
    sign = axes[k, j]
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{sign * value + 0.0:g}".replace("-", "\u2212")))
    axis.set_label_text(f"{adjusted.network.axis_names[j]}, {word if sign > 0.0 else opposite} (m)")


def _lines(ax: Any, adjusted: AdjustedNetwork, flat: np.ndarray) -> str:
    """Draw thin lines for the active observations; sentence for the caption."""
    table = adjusted.table
    start, end = table.ends[table.active, 0], table.ends[table.active, 1]
    pairwise = (start >= 0) & (end >= 0)
    pairs = np.unique(np.sort(np.stack([start[pairwise], end[pairwise]], axis=1), axis=1), axis=0)
    pairs = pairs[np.isfinite(flat[pairs]).all(axis=(1, 2))]
    if not len(pairs):
        return "No lines: no observation joins two points."
    step = max(1, int(np.ceil(len(pairs) / LINES)))
    # a seeded random choice, so that every station keeps a share of its lines
    drawn = pairs[np.random.default_rng(len(pairs)).permutation(len(pairs))[::step]]
    few = len(drawn) < DENSE
    ends = np.full((len(drawn), 3, 2), np.nan)
    ends[:, :2] = flat[drawn]
    ax.plot(*ends.reshape(-1, 2).T, color=FAINT, lw=0.7 if few else 0.2, alpha=0.5 if few else 0.35, zorder=1)
    ax.plot([], [], color=FAINT, lw=0.8, label="observed")
    return "Thin lines: observations." if step == 1 else f"Thin lines: one in {step} of {len(pairs)} observed pairs."


def _ellipses(
    ax: Any, adjusted: AdjustedNetwork, flat: np.ndarray, outline: Ellipse, scale: float
) -> tuple[np.ndarray, str]:
    """Draw standard ellipsoids to scale; mask (n,) of points without one, and the caption's sentence."""
    finite = np.isfinite(outline.major)
    if not (np.isfinite(scale) and np.any(outline.major[finite] > 0.0)):
        return ~finite, "No ellipsoids: uncertainties unknown."
    usual = float(np.median(outline.major[finite & (outline.major > 0.0)]))
    loose = ~finite | (outline.major > LOOSE * usual)
    rows = np.flatnonzero(~loose & (outline.major > 0.0))
    colour = np.where(adjusted.stations[rows], STATION, TARGET)
    many = len(rows) > DENSE
    ax.add_collection(
        EllipseCollection(
            2 * scale * outline.major[rows], 2 * scale * outline.minor[rows], 90.0 - outline.bearing[rows] / DEGREE,
            units="xy", offsets=flat[rows], offset_transform=ax.transData, facecolors=[f"{c}20" for c in colour],
            edgecolors=list(colour), linewidths=0.35 if many else 0.7, zorder=3, rasterized=many,
        )
    )  # fmt: skip
    kind = "variance factor applied" if adjusted.scaled else "a priori"
    return loose, f"Outlines: standard ellipsoids (1σ, {kind}), enlarged {thousands(scale)} times."


def thousands(value: float) -> str:
    return f"{value:,.0f}".replace(",", "\u2009")


def scale_bar(ax: Any, length: float, scale: float, *, what: str = "ellipsoids") -> None:
    """Draw a scale bar above the axes, with its length on the ground and in the enlarged parts."""
    low, high_x = ax.get_xlim()
    share = length / (high_x - low)
    box = ax.get_position().height * ax.figure.get_figheight()
    high = 1.0 + 0.16 / box
    ax.plot([0.0, share], [high, high], lw=2.2, solid_capstyle="butt", transform=ax.transAxes, clip_on=False, color=INK)
    text = f"{length:g} m"
    if np.isfinite(scale):
        text += f"; in the {what}, enlarged {thousands(scale)} times, {_length(length / scale)}"
    ax.annotate(
        text, (share, high), xycoords="axes fraction", xytext=(7, 0), textcoords="offset points", va="center",
        fontsize=8.5, color=FAINT,
    )  # fmt: skip


def _length(value: float) -> str:
    """Small length in a suitable unit.

    >>> _length(2e-4), _length(2e-6)
    ('0.2 mm', '2 µm')
    """
    return f"{value / MILLIMETRE:g} mm" if value >= 0.1 * MILLIMETRE else f"{value * 1e6:g} µm"


def _marks(ax: Any, adjusted: AdjustedNetwork, flat: np.ndarray, loose: np.ndarray) -> None:
    """Draw stations, targets, held and loose points, each with its own mark."""
    fixed = ~adjusted.network.points.free.any(axis=1)
    many = len(flat) > DENSE
    for mine, marker, colour, area, name in (
        (~adjusted.stations & ~fixed & ~loose, "o", TARGET, 4 if many else 12, "target"),
        (adjusted.stations & ~fixed & ~loose, "^", STATION, 26, "station"),
        (~adjusted.stations & fixed, "s", FIXED, 20, "held point"),
        (adjusted.stations & fixed, "^", FIXED, 26, "held station"),
    ):
        if mine.any():
            ax.scatter(*flat[mine].T, s=area, c=colour, marker=marker, lw=0, zorder=4, label=name, rasterized=many)
    if loose.any() and adjusted.answered:
        ax.scatter(
            *flat[loose].T, s=26, facecolors="white", edgecolors=BAD, lw=1.2, zorder=4,
            label=f"no ellipsoid: over {LOOSE:g} times the median",
        )  # fmt: skip
    elif loose.any():
        ax.scatter(*flat[loose].T, s=20, facecolors="white", edgecolors=FAINT, lw=1.0, zorder=4, label="not adjusted")
    chosen = adjusted.network.points.datum.any(axis=1)
    if chosen.any() and not chosen.all() and not many:
        ax.scatter(*flat[chosen].T, s=85, facecolors="none", edgecolors=SERIES[4], lw=0.8, zorder=3, label="datum")


def point_names(ax: Any, adjusted: AdjustedNetwork, flat: np.ndarray) -> None:
    """Draw point names where they fit, stations first, at the side with least overlap."""
    order = [*np.flatnonzero(adjusted.stations), *np.flatnonzero(~adjusted.stations)]
    order = [i for i in order if np.isfinite(flat[i]).all()]
    chosen = order if len(order) <= NAMED else [i for i in order if adjusted.stations[i]][:NAMED]
    if not chosen:
        return
    where = ax.transData.transform(flat[chosen])
    outward = where - where.mean(axis=0)
    outward /= np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
    point = ax.figure.dpi / 72.0
    occupied = [*np.concatenate([where - 4.0 * point, where + 4.0 * point], axis=1)]  # left, low, right, high
    for i, at, out in zip(chosen, where, outward, strict=True):
        half = point * np.array([2.5 * len(adjusted.names[i]), 4.0])
        centres = at + ROUND * (6.0 * point + half)
        boxes = np.concatenate([centres - half, centres + half], axis=1)
        cost = _overlap(boxes, np.array(occupied)) - point * ROUND @ out
        best = int(np.argmin(cost))
        occupied.append(boxes[best])
        ax.annotate(
            adjusted.names[i], flat[i], xytext=(centres[best] - at) / point, textcoords="offset points", ha="center",
            va="center", fontsize=7.5, zorder=5, color=STATION if adjusted.stations[i] else INK,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )  # fmt: skip


def _overlap(boxes: np.ndarray, other_boxes: np.ndarray) -> np.ndarray:
    """Overlap area of each of k boxes with others, (k,).

    Boxes are left, low, right, high.
    """
    low = np.maximum(boxes[:, None, :2], other_boxes[:, :2])
    high = np.minimum(boxes[:, None, 2:], other_boxes[:, 2:])
    return np.prod(np.maximum(high - low, 0.0), axis=2).sum(axis=1)


def _residuals(adjusted: AdjustedNetwork) -> tuple[Figure, str]:
    """Standardised residuals in file order, and their histogram against the normal distribution."""
    table = adjusted.table
    tested = np.flatnonzero(np.isfinite(adjusted.statistic))
    w = adjusted.statistic[tested]
    figure = Figure(figsize=(WIDTH, 3.9), dpi=RASTER)
    sequence, histogram = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    figure.subplots_adjust(left=0.065, right=0.985, bottom=0.21, top=0.91, wspace=0.17)
    span = max(1.25 * (adjusted.critical if np.isfinite(adjusted.critical) else 4.0), 4.0)
    inside = np.abs(w) <= span
    many = len(w) > 5 * DENSE
    for k, kind in enumerate(table.kinds):
        mine = inside & (table.kind[tested] == k)
        if mine.any():
            sequence.scatter(
                tested[mine], w[mine], s=2 if many else 10, c=SERIES[k % len(SERIES)], lw=0, alpha=0.5 if many else 0.8,
                rasterized=many, label=kind.replace("_", " "),
            )  # fmt: skip
    if not inside.all():
        far = w[~inside]
        sequence.scatter(
            tested[~inside], np.clip(far, -0.97 * span, 0.97 * span), s=26, c=BAD, marker="D", lw=0, zorder=3,
            label=f"beyond the edge, to {np.max(np.abs(far)):.3g}",
        )  # fmt: skip
    for limit in (-adjusted.critical, adjusted.critical):
        sequence.axhline(limit, color=BAD, lw=0.8, ls="--")
    sequence.set_ylim(-span, span)
    sequence.set_title("All tested observations")
    sequence.set_xlabel("number in the file")
    sequence.set_ylabel(f"test statistic {'τ' if adjusted.test == 'tau' else 'w'}")
    figure.legend(
        *sequence.get_legend_handles_labels(),
        loc="lower left",
        bbox_to_anchor=(0.05, 0.0),
        ncols=5,
        markerscale=3 if many else 1,
    )
    step = 0.4 if len(w) < 2000 else 0.2
    edges = np.arange(-4.0, 4.0 + 1e-9, step)
    histogram.hist(np.clip(w, -3.999, 3.999), edges, color=PALE, alpha=0.8, label="observed")
    t = np.linspace(-4.0, 4.0, 161)
    histogram.plot(t, len(w) * step * np.exp(-0.5 * t**2) / np.sqrt(2 * np.pi), color=INK, lw=1.2, label="normal")
    histogram.set_title("Against the normal distribution")
    histogram.set_xlabel("test statistic w, clipped at ±4")
    histogram.set_ylabel("observations")
    histogram.legend(loc="upper left", handlelength=1.2)
    histogram.set_ylim(top=histogram.get_ylim()[1] * 1.25)
    return figure, (
        f"Left: test statistics of {len(w)} observations; dashed: ±{adjusted.critical:.2f}, beyond which an "
        f"observation is suspect (level {adjusted.level:g} for all tests together). Right: their histogram, and the "
        "normal distribution that the claimed uncertainties predict."
    )


def _redundancy(adjusted: AdjustedNetwork) -> tuple[Figure, str]:
    """Share of an error that would show in each observation's residual, by kind."""
    table = adjusted.table
    active = table.active & np.isfinite(table.redundancy)
    kinds = [k for k in range(len(table.kinds)) if (active & (table.kind == k)).any()]
    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.add_axes((0.085, 0.2, 0.9, 0.66))
    parts = [np.clip(table.redundancy[active & (table.kind == k)], 0.0, 1.0) for k in kinds]
    colours = [SERIES[k % len(SERIES)] for k in kinds]
    names = [table.kinds[k].replace("_", " ") for k in kinds]
    ax.hist(parts, np.linspace(0.0, 1.0, 41).tolist(), stacked=True, color=colours, label=names, alpha=0.85)
    ax.axvspan(0.0, 0.1, color=GRID, alpha=0.7, zorder=0, lw=0)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("redundancy number: share of an error that shows in the observation's own residual")
    ax.set_ylabel("observations")
    figure.legend(*ax.get_legend_handles_labels(), loc="upper right", ncols=5)
    return figure, (
        "Redundancy numbers. In the grey zone, below 0.1, an observation is hardly checked: over nine tenths of an "
        "error would affect the coordinates."
    )
